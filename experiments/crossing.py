"""Interaction of eyes and tasks: differences between two kinds of eyes in two tasks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from experiments.designed import Trained
from experiments.eye_shapes import CAMERA, COMPOUND, TASKS, lights
from experiments.means import Interval, difference

__all__ = ["Crossing", "by_light", "crossing"]

FEWEST_LIVES = 2  # minimum number of training runs for an estimate of their spread
RESAMPLES = 10_000
ROUNDING = 1e-9
NORMAL = 1.96  # half width of the central 95 %, in standard deviations
Floats = NDArray[np.float64]
Both: TypeAlias = tuple[Floats, Floats]  # values of compound eyes and of camera eyes


@dataclass(frozen=True)
class Crossing:
    """Comparison of camera eyes with compound eyes in two tasks.

    differences: fitness with camera eyes minus fitness with compound eyes, by task
    interaction: difference in detection minus that in navigation, in standard deviations of training runs with one
        kind of eyes
    p: share of permutations whose interaction is at least as large as the observed one. Permutations assign the eyes at
        random within each task. For p, the unit of the interaction is the standard deviation of all runs of a task,
        which permutations do not change.
    """

    differences: dict[str, Interval]
    interaction: Interval
    p: float


def crossing(rows: Sequence[Trained], chance: np.random.Generator) -> Crossing:
    """Return the comparison of the training runs in one light.

    Raises:
        ValueError: a kind of eyes has fewer than two training runs in a task.
    """
    fitness = {task: (_of(rows, task, COMPOUND), _of(rows, task, CAMERA)) for task in TASKS}
    if min(one.size for both in fitness.values() for one in both) < FEWEST_LIVES:
        raise ValueError(f"a comparison needs at least {FEWEST_LIVES} training runs of each kind of eyes in each task")
    dealt = {task: _permuted(*both, chance) for task, both in fitness.items()}
    differences = {task: difference(camera, compound) for task, (compound, camera) in fitness.items()}
    null = np.abs(_joint(dealt))
    # Some permutations only reorder the runs of each kind. Their interaction differs from the observed one by rounding.
    p = (1 + int((null >= abs(_joint(fitness)) * (1 - ROUNDING)).sum())) / (1 + null.size)
    return Crossing(differences, _interaction(fitness), p)


def _of(rows: Sequence[Trained], task: str, eyes: tuple[int, int]) -> Floats:
    """Return the fitness of animals with these numbers of eyes and of receptors across, without failed animals."""
    mine = [row for row in rows if not row.failed and row.task == task and (row.n_eyes, row.width) == eyes]
    return np.array([row.fitness for row in mine])


def _permuted(compound: Floats, camera: Floats, chance: np.random.Generator) -> Both:
    """Return fitness values with randomly assigned eyes: an array (RESAMPLES, runs) for each kind of eyes."""
    mixed = chance.permuted(np.tile(np.concatenate([compound, camera]), (RESAMPLES, 1)), axis=1)
    return mixed[:, : compound.size], mixed[:, compound.size :]


def _interaction(fitness: Mapping[str, Both]) -> Interval:
    """Return camera eyes' advantage in detection minus their advantage in navigation (Hedges and Olkin 1985, §5.B, E).

    The unit is the standard deviation of training runs with one kind of eyes. With a small number of runs, a bootstrap
    would underestimate this deviation.
    """
    mean, variance = 0.0, 0.0
    for sign, (compound, camera) in ((1, fitness["detection"]), (-1, fitness["navigation"])):
        lives = compound.size + camera.size
        squares = sum(float(((of - of.mean()) ** 2).sum()) for of in (compound, camera))
        within = math.sqrt(squares / (lives - 2))
        effect = (1 - 3 / (4 * lives - 9)) * float(_ahead(compound, camera)) / within
        mean += sign * effect
        variance += 1 / compound.size + 1 / camera.size + effect**2 / (2 * lives)
    return Interval(mean, mean - NORMAL * math.sqrt(variance), mean + NORMAL * math.sqrt(variance))


def _joint(fitness: Mapping[str, Both]) -> Floats:
    """Return the interaction in units of the standard deviation of all runs of a task."""
    apart = {task: _ahead(*both) / np.concatenate(both, axis=-1).std(axis=-1, ddof=1) for task, both in fitness.items()}
    return np.asarray(apart["detection"] - apart["navigation"])


def _ahead(compound: Floats, camera: Floats) -> Floats:
    return np.asarray(camera.mean(axis=-1) - compound.mean(axis=-1))


def by_light(rows: Sequence[Trained]) -> dict[float, Crossing]:
    """Return the comparison for each light, given by the noise σ, that has enough training runs."""
    found = {}
    for sigma in lights(rows):
        with suppress(ValueError):
            found[sigma] = crossing([row for row in rows if row.noise_sigma == sigma], np.random.default_rng(0))
    return found
