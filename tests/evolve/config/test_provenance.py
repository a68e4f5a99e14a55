"""Errors name the file and line, or the option, of the setting."""

import tomllib

import pytest

from evolve.config.assemble import assemble
from evolve.config.provenance import _line_of, _spellings
from evolve.config.run_config import ConfigError

LINES = {
    "value": (
        "# mine\n[search]\nsigma = 0.1\npopulation = 0\n",
        "line 4: search.population = 0: must be in [2, 10",
    ),
    "type": (
        "[search]\n\npopulation = 'many'\n",
        "line 3: search.population = 'many': must be an integer in [2",
    ),
    "dotted": ("seed = 1\nsearch.population = 0\n", "line 2: search.population = 0"),
    "inline": ("search = { sigma = 0.1, population = 0 }\n", "line 1: search.population = 0"),
    "key": (
        "[search]\nsigma = 1\npoplation = 4\n",
        "line 3: unknown key 'search.poplation'; did you mean 'popul",
    ),
    "section": ("seed = 1\n\n[serch]\nsigma = 1\n", "line 3: unknown key 'serch'; did you mean 'search'?"),
    "gene": ("[genome.fov]\nstart = 3\n", "line 1: unknown gene 'fov'; did you mean 'fov_deg'?"),
    "gene's key": ("[genome.fov_deg]\nopen = true\nstat = 3\n", "line 3: unknown key 'genome.fov_deg.stat'"),
    "gene's value": ("[genome.fov_deg]\nstart = 300\n", "line 2: genome.fov_deg.start = 300: must be in [1, 100]"),
    "elsewhere": ("[search]\nlearning_rate = 1e-4\n", "line 2: unknown key 'search.learning_rate'; did you mean"),
    "top level": ("population = 4\n", "line 1: unknown key 'population'; did you mean 'search.population'?"),
    "of no 4 x 4 relief": ("\n[genome.doe_55]\nstart = 0.2\n", "genome.doe_55: the relief has 4 x 4 genes"),
}


@pytest.mark.parametrize("case", LINES)
def test_error_in_a_file_names_file_and_line(tmp_path, case):
    text, message = LINES[case]
    (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(ConfigError) as caught:
        assemble("detection", file=tmp_path / "mine.toml")
    assert message in str(caught.value)
    assert "mine.toml, line " in str(caught.value)
    assert "\n" not in str(caught.value)


def test_contradiction_names_every_place_that_made_it(tmp_path):
    (tmp_path / "mine.toml").write_text("# narrow\n[genome.fov_deg]\nlow = 20\nstart = 20\n")
    with pytest.raises(ConfigError, match="open, but low = 20 is not below high = 20") as caught:
        assemble("detection", file=tmp_path / "mine.toml", assignments=["genome.fov_deg.high=20"])
    assert str(caught.value).endswith("mine.toml, line 3; --set genome.fov_deg.high=20)")
    (tmp_path / "mine.toml").write_text("[genome.n_eyes]\n\nopens_at = 5\n")
    with pytest.raises(
        ConfigError, match=r"must be below search\.generations = 5.*mine\.toml, line 3; preset quick, line"
    ):
        assemble("detection", "quick", file=tmp_path / "mine.toml")


def test_lines_are_found_by_halving(tmp_path, monkeypatch):
    """Otherwise a file of 6,000 comments would be parsed 6,000 times."""
    parsed = []
    whole = tomllib.loads
    monkeypatch.setattr(tomllib, "loads", lambda text: parsed.append(len(text)) or whole(text))
    for place in (1, 3000, 5999):
        lines = ["# remark"] * 6000
        lines[place] = "search.population = 0"
        (tmp_path / "mine.toml").write_text("\n".join(lines))
        parsed.clear()
        with pytest.raises(ConfigError, match=f"line {place + 1}: search.population = 0"):
            assemble("detection", file=tmp_path / "mine.toml")
        assert len(parsed) < 40


@pytest.mark.parametrize("spread", [1, 2, 7, 60])
def test_line_is_the_same_as_by_trying_each(spread):
    """Values that span several lines cannot be cut. Settings stand before, after and within them."""
    value = "[\n" + ",\n".join("1" for _ in range(spread)) + "\n]"
    long = "text\n" * spread
    text = f'a = {value}\n# remark\n[t]\nb = """\n{long}"""\nc = {value}\n[t.u]\nd = 1\n'
    lines = text.splitlines(keepends=True)

    def tried(path):
        for count in range(1, len(lines) + 1):
            try:
                tree = tomllib.loads("".join(lines[:count]))
            except tomllib.TOMLDecodeError:
                continue
            for part in path:
                tree = tree.get(part) if isinstance(tree, dict) else None
            if tree is not None:
                return count
        return None

    for path in (["a"], ["t"], ["t", "b"], ["t", "c"], ["t", "u"], ["t", "u", "d"]):
        assert _line_of(text, path) == tried(path)
    many = "1,\n" * 300
    assert _line_of(f"x = [\n{many}]\ny = 1\nz = 1\n", ["z"]) in (None, 304)


def test_only_genes_are_set_by_their_groups():
    assert list(_spellings("eye.optics")) == [["eye", "optics"]]
    assert list(_spellings("genome")) == [["genome"]]
    assert list(_spellings("eye.doe_00")) == [["eye", "doe_00"]]
    assert ["genome", "optical", "open"] in _spellings("genome.doe_00.open")
