"""Schedule of a training run: Adam's step size, and the passes over the samples of an update."""

from __future__ import annotations

import math

from evolve.config.run_config import LearningConfig

__all__ = ["first_step_size", "mean_passes", "schedule"]

# Number of units in a hidden layer up to which the configured step size is used
# (docs/concepts/learning.md#learning-rate-of-large-networks).
UNITS_AT_FULL_STEP = 64
SMALL_STEP = 0.5  # share of the initial step size below which the passes decrease (docs/validation/fewer_epochs.md)


def first_step_size(asked: float, neurons: int) -> float:
    """Return Adam's initial step size.

    The effect of a step on a layer's output grows with the number of units that the layer sums. In large brains the
    step size therefore decreases as one over the root of that number.
    """
    return asked * min(1.0, math.sqrt(UNITS_AT_FULL_STEP / neurons))


def schedule(config: LearningConfig, steps: int) -> tuple[int, float]:
    """Return the passes over the samples of the update after `steps`, and the step size as a share of the initial one.

    The change of weights is roughly proportional to passes times step size, which falls as 1/steps after
    `decay_after`. First the step size falls to half. Then the number of passes falls, which also saves time. After the
    passes have reached `least_epochs`, the step size falls again.
    """
    left = min(1.0, config.decay_after / steps)
    passes = max(min(config.least_epochs, config.n_epochs), math.ceil(config.n_epochs * min(1.0, left / SMALL_STEP)))
    return passes, left * (config.n_epochs / passes)


def mean_passes(config: LearningConfig, begin: int, end: int) -> float:
    """Return the mean number of passes over the updates between two numbers of steps.

    Without an update between them, the passes of the next update are returned.
    """
    rollout = config.n_envs * config.n_steps
    passes = [schedule(config, steps)[0] for steps in range(begin + rollout, max(end, begin + rollout) + 1, rollout)]
    return sum(passes) / len(passes)
