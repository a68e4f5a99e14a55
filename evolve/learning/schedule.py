"""How a training slows down: Adam's step size, and the passes over the samples of an update."""

from __future__ import annotations

import math

from evolve.config.run_config import LearningConfig

__all__ = ["first_step_size", "mean_passes", "schedule"]

# Choice: units of a hidden layer up to which the step size is what is asked for
# (docs/decisions/065-steps-of-large-brains.md).
UNITS_AT_FULL_STEP = 64
SMALL_STEP = (
    0.5  # choice: share of the first step size that is small enough to make fewer (docs/validation/fewer_epochs.md)
)


def first_step_size(asked: float, neurons: int) -> float:
    """Adam's, at first. What a step does to a layer's output grows with the units that it sums: large brains take
    smaller ones, as one over the root of their units."""
    return asked * min(1.0, math.sqrt(UNITS_AT_FULL_STEP / neurons))


def schedule(config: LearningConfig, steps: int) -> tuple[int, float]:
    """Of the update after so many steps: passes over its samples, and the step size as a share of the first.

    Weights move by about as much as passes times step size. That falls as one over the steps after `decay_after`: by
    smaller steps until they are half as large, then by fewer passes, which also saves time, and by smaller steps again
    once `least_epochs` are left.
    """
    left = min(1.0, config.decay_after / steps)
    passes = max(min(config.least_epochs, config.n_epochs), math.ceil(config.n_epochs * min(1.0, left / SMALL_STEP)))
    return passes, left * (config.n_epochs / passes)


def mean_passes(config: LearningConfig, begin: int, end: int) -> float:
    """Over the updates between two numbers of steps; those of the next one where there are none."""
    rollout = config.n_envs * config.n_steps
    passes = [schedule(config, steps)[0] for steps in range(begin + rollout, max(end, begin + rollout) + 1, rollout)]
    return sum(passes) / len(passes)
