"""Assembly of configurations: precedence of sources, and one clear line for every error."""

import pytest

from evolve.config.assemble import assemble, from_toml, to_toml
from evolve.config.run_config import TASKS, ConfigError
from evolve.config.sources import preset_names
from evolve.genome.genes import TILT
from evolve.genome.genotype import GENES

OBLONG = [name for name in preset_names() if name != "bifurcation-detection"]  # presets whose eyes a navigator can have


@pytest.mark.parametrize(
    ("task", "preset"),
    [(task, name) for task in TASKS for name in (OBLONG if task in ("navigation", "maze") else preset_names())],
)
def test_config_survives_being_written(tmp_path, task, preset):
    config = assemble(task, preset, assignments=["learning.learning_rate=3.3e-4", "genome.n_eyes.high=7"])
    file = tmp_path / "config.toml"
    file.write_text(to_toml(config))
    assert from_toml(file) == config


def test_written_config_needs_no_defaults(tmp_path):
    """A stored configuration must keep its meaning after a default has changed."""
    written = to_toml(assemble("detection"))
    for name in ("relief_height", "rays_per_receptor", "sigma", "gamma", "patience", "episodes", "workers", "seed"):
        assert f"\n{name} = " in f"\n{written}"
    assert all(f"[genome.{gene}]" in written for gene in GENES if gene != TILT)


def test_later_sources_win(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("[search]\npopulation = 5\ngenerations = 9\n")
    assert assemble("detection", "quick").search.population == 8
    both = assemble("detection", "quick", file, ["search.generations=2"])
    assert (both.search.population, both.search.generations) == (5, 2)
    assert both.learning.total_steps == assemble("detection", "quick").learning.total_steps


def test_navigators_have_one_row_of_receptors_unless_asked_otherwise():
    for preset in (None, *OBLONG):
        use = assemble("navigation", preset).genome["resolution_height"]
        assert (use.open, use.start) == (False, 1)
    asked = ["genome.resolution_height.open=true", "genome.resolution_height.high=4"]
    assert assemble("navigation", assignments=asked).genome["resolution_height"].open
    with pytest.raises(ConfigError, match=r"only square eyes have this gene.* \(preset bifurcation-detection"):
        assemble("navigation", "bifurcation-detection")


def test_groups_of_genes_freeze_together_and_the_narrower_name_wins():
    config = assemble("detection", assignments=["genome.optical.open=false"])
    assert not any(config.genome[name].open for name, gene in GENES.items() if gene.cluster == "optical")
    config = assemble("detection", assignments=["genome.doe_11.open=true", "genome.doe.open=false"])
    assert not config.genome["doe_11"].open  # of two assignments, the later one applies
    file = "[genome.doe_11]\nopen = true\n[genome.doe]\nopen = false\nstart = 0.3\n"
    config = _from_text(file)
    assert config.genome["doe_11"].open
    assert config.genome["doe_11"].start == config.genome["doe_12"].start == 0.3
    assert not config.genome["doe_12"].open


def test_without_optics_the_optical_genes_are_frozen():
    config = assemble("detection", assignments=["eye.optics=false"])
    assert not any(config.genome[name].open for name, gene in GENES.items() if gene.cluster == "optical")


def _from_text(text):
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "c.toml"
        file.write_text(text)
        return assemble("detection", file=file)


WRONG = [
    ("eye.rays_per_receptor=many", "eye.rays_per_receptor = 'many'", "a number or 'auto'"),
    ("eye.rays_per_receptor=0", "eye.rays_per_receptor = 0", "(0, 4096]"),
    ("serch.population=3", "unknown key 'serch'", "'search'"),
    ("search.poplation=3", "'search.poplation'", "'population'"),
    ("search=3", "search", "section"),
    ("search.population=1", "search.population = 1", "[2, 10000]"),
    ("search.population=2.5", "search.population = 2.5", "an integer"),
    ("search.population=true", "search.population = true", "an integer"),
    ("search.sigma=0", "search.sigma = 0", "(0, 1]"),
    ("search.sigma=nan", "search.sigma = nan", "(0, 1]"),
    ("learning.gamma=high", "learning.gamma = 'high'", "a number"),
    ("learning.gamma=1.5", "learning.gamma = 1.5", "[0, 1]"),
    ("learning.batch_size=100000", "learning.batch_size", "at most n_envs x n_steps = 4096"),
    ("eye.optics=1", "eye.optics = 1", "true or false"),
    ("genome.n_eye.open=false", "unknown gene 'n_eye'", "'n_eyes'"),
    ("genome.n_eyes.opn=false", "'genome.n_eyes.opn'", "'open'"),
    ("genome.n_eyes=3", "genome.n_eyes", ".start"),
    ("genome.n_eyes.high=99", "genome.n_eyes.high = 99", "[1, 32]"),
    ("genome.n_eyes.start=1.5", "genome.n_eyes.start = 1.5", "an integer"),
    ("genome.fov_deg.low=60", "genome.fov_deg.start = 45", "[60, 100]"),
    ("genome.fov_deg.high=1", "genome.fov_deg", "not below"),
    ("seed=-1", "seed = -1", "[0, "),
    ("sed=1", "unknown key 'sed'", "'seed'"),
    ("task=3", "unknown task '3'", "navigation"),
    ("nothing", "'nothing'", "section.key=value"),
    ("search.population=", "search.population=", "section.key=value"),
]


@pytest.mark.parametrize(("assignment", "what", "allowed"), WRONG, ids=[entry[0] for entry in WRONG])
def test_wrong_setting_gets_one_line_naming_it_and_what_is_allowed(assignment, what, allowed):
    with pytest.raises(ConfigError) as caught:
        assemble("detection", assignments=[assignment])
    message = str(caught.value)
    assert what in message
    assert allowed in message
    assert "\n" not in message


def test_wrong_sources_are_named(tmp_path):
    with pytest.raises(ConfigError, match=r"unknown task 'detecton'; did you mean 'detection'\?"):
        assemble("detecton")
    with pytest.raises(ConfigError, match="task: missing"):
        assemble()
    with pytest.raises(ConfigError, match=r"unknown preset 'quik'; did you mean 'quick'\?"):
        assemble("detection", "quik")
    with pytest.raises(ConfigError, match=r"absent\.toml: cannot be read"):
        assemble("detection", file=tmp_path / "absent.toml")
    for content, message in (
        (b"[search\n", r"bad\.toml: is not valid TOML: .*line 1"),
        (b"\xff", r"bad\.toml: is not UTF-8"),
        (b"[search]\npopulation = 0\n", r"bad\.toml, line 2: search\.population = 0: must be in"),
    ):
        (tmp_path / "bad.toml").write_bytes(content)
        with pytest.raises(ConfigError, match=message):
            assemble("detection", file=tmp_path / "bad.toml")
