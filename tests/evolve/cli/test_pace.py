"""The pace is measured on the real thing, and an animal that cannot be evaluated is named."""

from dataclasses import replace

import pytest

from evolve.cli.pace import Pace, _slowest, measure_pace
from evolve.config.run_config import ConfigError
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.learning.fitness import evaluate
from optics.numerics import backend
from tests.evolve.small_run import PHENOTYPE, small_config


def test_animal_that_cannot_be_evaluated_is_named():
    """A retina far behind a rough relief of two millimetres: light spreads farther than optics follows it."""
    backend.require()
    config = small_config()
    config = replace(config, eye=replace(config.eye, relief_height=2e-3))
    rough = (0.53, 0.2, 0.7, 0.22, 0.59, 0.31, 0.53, 0.39, 0.25, 0.45, 0.67, 0.59, 0.88, 0.53, 0.24, 0.56)
    blurred = replace(PHENOTYPE, fov_deg=13.8, relative_aperture=0.243, relief=rough, refractive_index=1.85)
    with pytest.raises(ConfigError, match="an animal like the middle one cannot be evaluated here: tolerance"):
        measure_pace(config, {"middle": blurred}, 1)


def test_pace_is_measured_with_the_real_thing(tmp_path, short_episodes):
    backend.require()
    config = small_config()
    animal = develop(Genotype(config.genome).start, config)
    learning = replace(config.learning, total_steps=64 * config.learning.n_envs * config.learning.n_steps)
    stages = replace(config, learning=learning, search=replace(config.search, rungs=4))  # more than four rollouts have
    pace = measure_pace(stages, {"start": animal}, 1)["start"]
    assert evaluate(animal, config, 0, tmp_path / "policy").failure is None
    assert pace.policy_bytes == (tmp_path / "policy").stat().st_size
    assert pace.steps_per_s > 0
    assert pace.start_s > 0


def test_the_slowest_of_many_lives_counts():
    lives = [Pace(start_s=1.0, steps_per_s=90.0, play_s=3.0, policy_bytes=7), Pace(2.0, 50.0, 2.0, 7)]
    assert _slowest(lives) == Pace(start_s=2.0, steps_per_s=50.0, play_s=3.0, policy_bytes=7)
