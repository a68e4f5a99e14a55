"""Configuration: sources, precedence, and one clear line for everything that is wrong."""

import numpy as np
import pytest

from evolve.config.assemble import assemble, from_toml, to_toml
from evolve.config.run_config import TASKS, ConfigError
from evolve.config.sources import preset_names
from evolve.genome.genotype import GENES, group_members


@pytest.mark.parametrize("preset", preset_names())
@pytest.mark.parametrize("task", TASKS)
def test_config_survives_being_written(tmp_path, task, preset):
    config = assemble(task, preset, assignments=["learning.learning_rate=3.3e-4", "genome.n_eyes.high=7"])
    file = tmp_path / "config.toml"
    file.write_text(to_toml(config))
    assert from_toml(file) == config


def test_written_config_needs_no_defaults(tmp_path):
    """A run frozen today must mean the same after a default has changed."""
    written = to_toml(assemble("detection"))
    for name in ("relief_height", "rays_per_receptor", "sigma", "gamma", "patience", "episodes", "workers", "seed"):
        assert f"\n{name} = " in f"\n{written}"
    assert all(f"[genome.{gene}]" in written for gene in GENES)


def test_later_sources_win(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("[search]\npopulation = 5\ngenerations = 9\n")
    assert assemble("detection", "quick").search.population == 4
    both = assemble("detection", "quick", file, ["search.generations=2"])
    assert (both.search.population, both.search.generations) == (5, 2)
    assert both.learning.total_steps == assemble("detection", "quick").learning.total_steps


def test_navigators_have_one_row_of_receptors_unless_asked_otherwise():
    for preset in (None, *preset_names()):
        use = assemble("navigation", preset).genome["resolution_height"]
        assert (use.open, use.start) == (False, 1)
    asked = ["genome.resolution_height.open=true", "genome.resolution_height.high=4"]
    assert assemble("navigation", assignments=asked).genome["resolution_height"].open


def test_groups_of_genes_freeze_together_and_the_narrower_name_wins():
    config = assemble("detection", assignments=["genome.optical.open=false"])
    assert not any(config.genome[name].open for name, gene in GENES.items() if gene.cluster == "optical")
    config = assemble("detection", assignments=["genome.doe_11.open=true", "genome.doe.open=false"])
    assert not config.genome["doe_11"].open  # two assignments: the later one wins
    file = "[genome.doe_11]\nopen = true\n[genome.doe]\nopen = false\nstart = 0.3\n"
    config = _from_text(file)
    assert config.genome["doe_11"].open
    assert config.genome["doe_11"].start == config.genome["doe_12"].start == 0.3
    assert not config.genome["doe_12"].open


def test_without_optics_the_optical_genes_are_frozen():
    config = assemble("detection", assignments=["eye.optics=false"])
    assert not any(config.genome[name].open for name, gene in GENES.items() if gene.cluster == "optical")


def test_spectral_genes_are_for_receptors_that_are_inherited():
    assert assemble("foraging").eye.receptors == "rgb"
    assert not any(assemble("foraging").genome[name].open for name in group_members("spectral"))
    config = assemble("foraging", assignments=["eye.receptors=genes", "genome.lambda_max.open=true"])
    opened = [name for name in group_members("spectral") if config.genome[name].open]
    assert opened == [f"lambda_max_{i}_nm" for i in range(4)]
    with pytest.raises(ConfigError, match=r"eye\.receptors = 'rgb' leaves no spectral gene to evolve"):
        assemble("foraging", assignments=["genome.receptor_types.open=true"])
    with pytest.raises(ConfigError, match=r"eye\.receptors = 'bee': must be one of rgb, lms, .*, genes"):
        assemble("foraging", assignments=["eye.receptors=bee"])
    with pytest.raises(ConfigError, match=r"lambda_max_0_nm\.low = 300: must be in \[330, 700\]"):
        assemble("foraging", assignments=["genome.lambda_max_0_nm.low=300"])


def _from_text(text):
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "c.toml"
        file.write_text(text)
        return assemble("detection", file=file)


def test_rays_are_a_number_or_chosen():
    assert assemble("detection").eye.rays_per_receptor == "auto"
    assert assemble("detection", assignments=["eye.rays_per_receptor=auto"]).eye.rays_per_receptor == "auto"
    assert assemble("detection", assignments=["eye.rays_per_receptor=0.5"]).eye.rays_per_receptor == 0.5


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
    ("genome.n_eyes.high=99", "genome.n_eyes.high = 99", "[1, 16]"),
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


def test_contradictions_are_refused():
    with pytest.raises(ConfigError, match=r"opens_at = 50: must be below search\.generations = 50"):
        assemble("detection", assignments=["genome.fov_deg.opens_at=50"])
    with pytest.raises(ConfigError, match="no gene opens before generation 3"):
        assemble("detection", assignments=[f"genome.{c}.opens_at=3" for c in ("morphological", "optical", "neural")])
    with pytest.raises(ConfigError, match="every gene is frozen"):
        assemble("detection", assignments=[f"genome.{c}.open=false" for c in ("morphological", "optical", "neural")])
    with pytest.raises(ConfigError, match=r"eye\.optics = false"):
        assemble("detection", assignments=["eye.optics=false", "genome.doe.open=true"])


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
    (tmp_path / "mine.toml").write_text("[genome.doe]\n\nopens_at = 4\n")
    with pytest.raises(
        ConfigError, match=r"must be below search\.generations = 3.*mine\.toml, line 3; preset quick, line"
    ):
        assemble("detection", "quick", file=tmp_path / "mine.toml")


def test_relief_may_have_more_points_and_keeps_the_presets_surface():
    import optics
    from evolve.genome.genotype import Genotype
    from evolve.genome.phenotype import develop
    from optics.numerics import backend
    from optics.numerics.precision import precision

    backend.require()

    types = precision("float64")
    x, y = types.Float64([-0.8, 0.1, 0.7]), types.Float64([0.3, -0.9, 0.6])
    heights = {}
    for points in (4, 5, 9):
        config = assemble("detection", "quick", assignments=[f"eye.relief_points={points}"])
        assert sum(name.startswith("doe_") for name in config.genome) == points**2
        pupil = develop(Genotype(config.genome).start, config).pupil(config.eye)
        assert isinstance(pupil, optics.Pupil)
        heights[points] = pupil.height.height(x, y, types).numpy()
    # A spline through a bicubic polynomial is that polynomial, up to rounding.
    for points in (5, 9):
        assert heights[points] == pytest.approx(heights[4], rel=1e-9)


@pytest.mark.parametrize(("points", "count"), [(4, 3), (5, 6), (6, 6), (9, 15)])
def test_symmetric_reliefs_look_the_same_mirrored_and_turned(points, count):
    from evolve.genome.genotype import Genotype
    from evolve.genome.phenotype import develop

    asked = ["eye.relief_symmetric=true", f"eye.relief_points={points}"]
    config = assemble("detection", assignments=asked)
    genes = [gene.name for gene in Genotype(config.genome).open_genes if gene.name.startswith("doe_")]
    assert len(genes) == count
    animal = develop(np.random.default_rng(0).random(Genotype(config.genome).dimension), config)
    relief = np.reshape(animal.relief, (points, points))
    np.testing.assert_array_equal(relief, relief.T)
    np.testing.assert_array_equal(relief, relief[::-1])
    assert len(set(animal.relief)) == count


def test_symmetric_reliefs_have_no_genes_that_would_be_ignored():
    with pytest.raises(ConfigError, match=r"a symmetric relief has other genes \(doe_00, doe_01, doe_11\)"):
        assemble("detection", assignments=["eye.relief_symmetric=true", "genome.doe_02.start=0.3"])


def test_a_symmetric_animal_begins_a_run_of_symmetric_reliefs():
    """All sixteen heights of an animal are named; where they say one thing eightfold, they are three genes' starts."""
    from evolve.config.provenance import Source

    heights = {f"doe_{i}{j}": {"start": 0.2 + 0.1 * min(i, 3 - i) * min(j, 3 - j)} for i in range(4) for j in range(4)}
    eye = {"relief_symmetric": True}
    config = assemble("detection", starts=Source("--from a:1", {"genome": heights, "eye": eye}))
    assert [config.genome[f"doe_{place}"].start for place in ("00", "01", "11")] == pytest.approx([0.2, 0.2, 0.3])
    assert "doe_32" not in config.genome
    heights["doe_32"]["open"] = False
    with pytest.raises(ConfigError, match="doe_32: a symmetric relief has other genes"):
        assemble("detection", starts=Source("--from a:1", {"genome": heights, "eye": eye}))
    heights["doe_32"] = {"start": 0.9}
    with pytest.raises(ConfigError, match="a symmetric relief has other genes"):
        assemble("detection", starts=Source("--from a:1", {"genome": heights, "eye": eye}))


def test_heights_of_more_points_become_no_other_number_of_them():
    from evolve.config.provenance import Source
    from evolve.genome.relief_genes import doe_names

    heights = {name: {"start": 0.3} for name in doe_names(6)}
    with pytest.raises(ConfigError, match="heights of 6 x 6 points cannot become so many; must be 6"):
        assemble(
            "detection",
            assignments=["eye.relief_points=9"],
            starts=Source("--from a:1", {"genome": heights, "eye": {"relief_points": 6}}),
        )


def test_only_navigation_has_mazes():
    assert assemble("navigation", assignments=["world.mazes=4", "world.unseen=true"]).world.evaluation == {
        "mazes": 4,
        "world_seed": 1,
    }
    for change in ("world.mazes=2", "world.unseen=true"):
        with pytest.raises(ConfigError, match="detection has no mazes, only navigation has"):
            assemble("detection", assignments=[change])


def test_photons_are_counted_in_some_light():
    assert assemble("detection", assignments=["eye.illuminance=10", "eye.integration_time=0.1"]).eye.illuminance == 10
    with pytest.raises(
        ConfigError, match=r"eye\.illuminance = 0\.001.*: too few photons; must be at least 0\.0002 lx s"
    ):
        assemble("detection", assignments=["eye.illuminance=1e-3"])
    with pytest.raises(ConfigError, match=r"eye\.integration_time = 0\.1: counts photons, and there are none"):
        assemble("detection", assignments=["eye.integration_time=0.1"])
