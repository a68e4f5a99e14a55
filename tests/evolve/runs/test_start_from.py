"""Runs that start from an animal of another run."""

import pytest

from evolve.config.assemble import assemble
from evolve.config.numbering import Place
from evolve.config.run_config import ConfigError
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.runs.start_from import starts_from
from evolve.store.candidate import Candidate
from evolve.store.directory import Run, RunError
from evolve.store.evaluation import Evaluation
from tests.evolve.search.test_loop import carry


def test_animals_start_from_one_of_another_run(tmp_path, finished):
    whole = Run.open(finished)
    starts = starts_from(f"{whole.path}:7")
    parent = whole.candidate(7).phenotype
    config = assemble("detection", assignments=["search.population=2"], starts=starts)
    assert develop(Genotype(config.genome).start, config) == parent
    assert config.eye == whole.config.eye
    assert starts_from(str(whole.path)).name == f"--from {whole.path}:{whole.best.id}"
    with pytest.raises(RunError, match="there is no candidate 99; 12 have been evaluated"):
        starts_from(f"{whole.path}:99")
    fov = parent.fov_deg
    narrow = [f"genome.fov_deg.high={fov / 2}"]
    with pytest.raises(ConfigError, match=rf"genome\.fov_deg\.start = .*--from {whole.path}:7"):
        assemble("detection", assignments=narrow, starts=starts)
    wins = assemble("detection", assignments=[f"genome.fov_deg.start={fov / 2}"], starts=starts)
    assert wins.genome["fov_deg"].start == fov / 2


@pytest.mark.parametrize("optics", ["true", "false"])
def test_an_animals_lens_keeps_its_size_in_another_run(tmp_path, optics):
    sizes = ("eye.relief_height=50e-6", "eye.sensor_width=300e-6", f"eye.optics={optics}", "search.population=2")
    settings = (*sizes, "search.generations=1", "genome.optical.open=false", "learning.total_steps=4096")
    parent, _ = carry(tmp_path / "run", assemble("detection", assignments=settings))
    eye = assemble("detection", starts=starts_from(f"{parent.path}:0")).eye
    lengths = (50e-6, 300e-6) if optics == "true" else (100e-6, 200e-6)
    assert (eye.relief_height, eye.sensor_width) == lengths, "a perfect lens has no size"


@pytest.mark.parametrize("settings", [("eye.square=true",), ()])
def test_an_animal_with_square_eyes_starts_a_run_with_either(tmp_path, settings):
    config = assemble("detection", assignments=["eye.square=true", "eye.optics=false", "genome.resolution.start=6"])
    run, genome = Run.create(tmp_path / "run", config), Genotype(config.genome).start
    outcome = Evaluation(1.0, (1.0,), 0.0, 10, 1.0)
    run.append(Candidate.from_evaluation(Place(0, 0, 0), tuple(genome), develop(genome, config), 1, outcome))
    other = assemble("detection", assignments=settings, starts=starts_from(f"{run.path}:0"))
    assert develop(Genotype(other.genome).start, other).resolution == (6, 6)
