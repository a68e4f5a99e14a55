"""The schedule by which learning slows down."""

from dataclasses import replace

import pytest

from evolve.config.run_config import LearningConfig
from evolve.learning.schedule import mean_passes, schedule

PACED = LearningConfig(n_envs=16, n_steps=32, n_epochs=10, least_epochs=6, decay_after=640)


@pytest.mark.parametrize(
    ("n_epochs", "least_epochs", "steps", "passes", "share"),
    [
        (10, 3, 1, 10, 1.0),
        (10, 3, 640, 10, 1.0),
        (10, 3, 1280, 10, 0.5),
        (10, 3, 2560, 5, 0.5),
        (10, 3, 6400, 3, 1 / 3),
        (10, 10, 2560, 10, 0.25),  # a constant number of passes
        (2, 3, 2560, 2, 0.25),  # at most the initial number
        (1, 1, 6400, 1, 0.1),
    ],
)
def test_the_step_size_halves_then_passes_fall_and_then_it_falls_again(n_epochs, least_epochs, steps, passes, share):
    config = replace(PACED, n_epochs=n_epochs, least_epochs=least_epochs)
    assert schedule(config, steps) == (passes, pytest.approx(share))


def test_passes_of_a_stage_are_those_of_its_updates():
    """The updates after every 512 steps have 10, 10, 9, 7 and 6 passes."""
    assert mean_passes(PACED, 0, 512) == 10
    assert mean_passes(PACED, 0, 2560) == 8.4
    assert mean_passes(PACED, 512, 1536) == 9.5
    assert mean_passes(PACED, 1024, 1100) == 9, "less than a rollout counts as one"


def test_a_short_training_is_none_other_than_with_all_passes():
    """The training is identical, bit for bit, until the step size has halved."""
    throughout = replace(PACED, least_epochs=10)
    assert all(schedule(PACED, steps) == schedule(throughout, steps) for steps in range(1, 1281))
    assert schedule(PACED, 1500) != schedule(throughout, 1500)
