"""Animals that would be fittest if receptors and eyes had a price, from training runs without prices.

Costs are subtracted from fitness and do not affect a training run, so the runs of an experiment without prices suffice.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from evolve.config.costs import CostsConfig
from evolve.config.run_config import EyeConfig
from experiments.designed import Design

__all__ = ["PRICES", "fittest", "probability_of_finer"]

PRICES = tuple(
    CostsConfig(per_receptor=receptor, per_eye=eye) for eye in (0.0, 2.0, 5.0) for receptor in (0.0, 0.01, 0.03, 0.1)
)
RESAMPLES = 2000
Returns = Mapping[Design, np.ndarray]  # returns of each animal's training runs


def fittest(returns: Returns, prices: CostsConfig) -> Design:
    """Return the animal with the highest mean return minus costs."""
    return max(returns, key=lambda animal: returns[animal].mean() - _cost(animal, prices))


def probability_of_finer(
    fine: Returns, coarse: Returns, prices: CostsConfig, rng: np.random.Generator
) -> tuple[float, float]:
    """Return two bootstrap probabilities that compare the fittest animals of two tasks.

    The animals are compared by the ratio of receptors across each eye to the number of eyes. The first probability is
    that of a higher ratio in the first task, and the second is that of a lower one.

    The training runs of each animal are resampled with replacement.
    """
    first, second = (_ratios_of_fittest(returns, prices, rng) for returns in (fine, coarse))
    return float(np.mean(first > second)), float(np.mean(first < second))


def _ratios_of_fittest(returns: Returns, prices: CostsConfig, rng: np.random.Generator) -> np.ndarray:
    """Return ln(receptors across / eyes) of the fittest animal in each resample, (resample,)."""
    animals: Sequence[Design] = list(returns)
    net = np.stack([_resampled_means(returns[animal], rng) - _cost(animal, prices) for animal in animals])
    ratio = np.array([math.log(animal.width / animal.n_eyes) for animal in animals])
    found: np.ndarray = ratio[net.argmax(axis=0)]
    return found


def _resampled_means(values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    means: np.ndarray = rng.choice(values, (RESAMPLES, values.size)).mean(axis=1)
    return means


def _cost(animal: Design, prices: CostsConfig) -> float:
    return prices.total(animal.animal, EyeConfig())
