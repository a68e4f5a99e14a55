"""Combinations of settings: contradictions are refused with the reason."""

import pytest

from evolve.config.assemble import assemble
from evolve.config.run_config import ConfigError, RunConfig, SearchConfig, WorldConfig
from evolve.genome.genotype import group_members


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


def test_rays_are_a_number_or_chosen():
    assert assemble("detection").eye.rays_per_receptor == "auto"
    assert assemble("detection", assignments=["eye.rays_per_receptor=auto"]).eye.rays_per_receptor == "auto"
    assert assemble("detection", assignments=["eye.rays_per_receptor=0.5"]).eye.rays_per_receptor == 0.5


def test_contradictions_are_refused():
    with pytest.raises(ConfigError, match=r"opens_at = 50: must be below search\.generations = 50"):
        assemble("detection", assignments=["genome.fov_deg.opens_at=50"])
    with pytest.raises(ConfigError, match="no gene opens before generation 3"):
        assemble("detection", assignments=[f"genome.{c}.opens_at=3" for c in ("morphological", "optical", "neural")])
    with pytest.raises(ConfigError, match="every gene is frozen"):
        assemble("detection", assignments=[f"genome.{c}.open=false" for c in ("morphological", "optical", "neural")])
    with pytest.raises(ConfigError, match=r"eye\.optics = false"):
        assemble("detection", assignments=["eye.optics=false", "genome.doe.open=true"])


def test_only_the_maze_has_mazes_and_only_navigation_a_course():
    assert assemble("maze", assignments=["world.mazes=4", "world.unseen=true"]).world.evaluation == {
        "mazes": 4,
        "seed": 1,
        "course": "short",
        "layouts": None,
        "wall_height": 1.0,
        "medium": "air",
    }
    for change in ("world.mazes=2", "world.unseen=true"):
        with pytest.raises(ConfigError, match="is for the task maze, not for navigation"):
            assemble("navigation", assignments=[change])
    for change in ("world.course=long", "world.evaluation_course=long"):
        with pytest.raises(ConfigError, match="is for the task navigation, not for maze"):
            assemble("maze", assignments=[change])
        assert assemble("navigation", assignments=[change]).world != WorldConfig()
    with pytest.raises(ConfigError, match=r"world\.course = 'lang': must be one of short, long"):
        assemble("navigation", assignments=["world.course=lang"])


def test_photons_are_counted_in_some_light():
    assert assemble("detection", assignments=["eye.illuminance=10", "eye.integration_time=0.1"]).eye.illuminance == 10
    with pytest.raises(
        ConfigError, match=r"eye\.illuminance = 0\.001.*: too few photons; their product must be at least 0\.0002 lx s"
    ):
        assemble("detection", assignments=["eye.illuminance=1e-3"])
    with pytest.raises(ConfigError, match=r"eye\.integration_time = 0\.1: has no effect without shot noise"):
        assemble("detection", assignments=["eye.integration_time=0.1"])


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"seed": -1}, "seed = -1: must be in"),
        ({"seed": 1.5}, "seed = 1.5: must be"),
        ({"workers": -4}, "workers = -4: must be in"),
        ({"search": SearchConfig(population=0)}, "search.population = 0: must be in"),
        ({"search": SearchConfig(sigma=-1.0)}, "search.sigma = -1"),
    ],
)
def test_values_from_python_are_checked_as_those_of_files_are(settings, words):
    with pytest.raises(ConfigError, match=words):
        RunConfig("detection", **settings)
