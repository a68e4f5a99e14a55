"""Schedule of a training run: Adam's step size, and the number of passes over the samples of an update."""

from __future__ import annotations

import math

from evolve.config.run_config import LearningConfig

__all__ = ["first_step_size", "mean_passes", "schedule"]

# Number of units in a hidden layer up to which the configured step size is used
# (docs/concepts/learning.md#learning-rate-of-large-networks).
UNITS_AT_FULL_STEP = 64
# After the step size has fallen to this fraction of its initial value, the number of passes decreases
# (docs/validation/fewer_epochs.md).
SMALL_STEP = 0.5


def first_step_size(configured: float, neurons: int) -> float:
    """Return Adam's initial step size for a brain with `neurons` units in each hidden layer.

    A layer sums over the units of the previous layer, so the effect of a step on its output grows with the number of
    units. Above 64 units, the step size is therefore proportional to 1/√units.

    configured: step size in the settings
    """
    return configured * min(1.0, math.sqrt(UNITS_AT_FULL_STEP / neurons))


def schedule(config: LearningConfig, steps: int) -> tuple[int, float]:
    """Return the number of passes over the samples in an update, and the step size divided by its initial value.

    The change of the weights in an update is roughly proportional to the number of passes times the step size. After
    `decay_after` steps, this product falls as 1/steps. First, the step size falls to half its initial value. Then the
    number of passes falls instead, which also saves time. After this number has reached `least_epochs`, the step size
    falls again.

    steps: number of training steps before the update, above 0
    """
    left = min(1.0, config.decay_after / steps)
    passes = max(min(config.least_epochs, config.n_epochs), math.ceil(config.n_epochs * min(1.0, left / SMALL_STEP)))
    return passes, left * (config.n_epochs / passes)


def mean_passes(config: LearningConfig, begin: int, end: int) -> float:
    """Return the mean number of passes over the samples in an update, for all updates from step `begin` to step `end`.

    Without an update between these steps, the result is the number of passes in the next update.
    """
    rollout = config.n_envs * config.n_steps
    passes = [schedule(config, steps)[0] for steps in range(begin + rollout, max(end, begin + rollout) + 1, rollout)]
    return sum(passes) / len(passes)
