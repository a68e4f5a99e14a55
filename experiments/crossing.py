"""Whether the better eyes of one task are the worse ones of another: differences and their interaction."""

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

FEWEST_LIVES = 2  # of any eyes: of one there is no spread
RESAMPLES = 10_000
ROUNDING = 1e-9
NORMAL = 1.96  # standard deviations to either side that hold 95 %
Floats = NDArray[np.float64]
Both: TypeAlias = tuple[Floats, Floats]  # of compound eyes and of cameras


@dataclass(frozen=True)
class Crossing:
    """Fitness of cameras less that of compound eyes in each task, and the interaction of eye and task.

    interaction: of the difference, in standard deviations of lives with one kind of eyes; in detection less navigation
    p: of as large an interaction where it does not matter who has which eyes (permutations within each task, in
        standard deviations of all its lives: those are the same whoever has which)
    """

    differences: dict[str, Interval]
    interaction: Interval
    p: float


def crossing(rows: Sequence[Trained], chance: np.random.Generator) -> Crossing:
    """Of the trainings in one light.

    Raises:
        ValueError: fewer than two lives of some eyes in a task.
    """
    fitness = {task: (_of(rows, task, COMPOUND), _of(rows, task, CAMERA)) for task in TASKS}
    if min(one.size for both in fitness.values() for one in both) < FEWEST_LIVES:
        raise ValueError(f"a crossing takes {FEWEST_LIVES} lives of each kind of eyes in each task, or more")
    dealt = {task: _permuted(*both, chance) for task, both in fitness.items()}
    differences = {task: difference(camera, compound) for task, (compound, camera) in fitness.items()}
    null = np.abs(_joint(dealt))
    # Some permutations have the same lives in another order, and sums of theirs round otherwise.
    p = (1 + int((null >= abs(_joint(fitness)) * (1 - ROUNDING)).sum())) / (1 + null.size)
    return Crossing(differences, _interaction(fitness), p)


def _of(rows: Sequence[Trained], task: str, eyes: tuple[int, int]) -> Floats:
    """Fitness of all animals with so many eyes and receptors across that did not fail, wherever the eyes sit."""
    mine = [row for row in rows if not row.failed and row.task == task and (row.n_eyes, row.width) == eyes]
    return np.array([row.fitness for row in mine])


def _permuted(compound: Floats, camera: Floats, chance: np.random.Generator) -> Both:
    """Animals that have been dealt their eyes at random, (RESAMPLES, lives) of each kind."""
    mixed = chance.permuted(np.tile(np.concatenate([compound, camera]), (RESAMPLES, 1)), axis=1)
    return mixed[:, : compound.size], mixed[:, compound.size :]


def _interaction(fitness: Mapping[str, Both]) -> Interval:
    """By how much cameras are ahead in detection, less in navigation, in standard deviations of lives with one kind of
    eyes (Hedges and Olkin 1985, §5.B and E): a bootstrap of so few lives finds them too much alike."""
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
    """The interaction in standard deviations of all lives of a task, which are the same whoever has which eyes."""
    apart = {task: _ahead(*both) / np.concatenate(both, axis=-1).std(axis=-1, ddof=1) for task, both in fitness.items()}
    return np.asarray(apart["detection"] - apart["navigation"])


def _ahead(compound: Floats, camera: Floats) -> Floats:
    return np.asarray(camera.mean(axis=-1) - compound.mean(axis=-1))


def by_light(rows: Sequence[Trained]) -> dict[float, Crossing]:
    """Of those lights in which enough lives have been lived."""
    found = {}
    for sigma in lights(rows):
        with suppress(ValueError):
            found[sigma] = crossing([row for row in rows if row.noise_sigma == sigma], np.random.default_rng(0))
    return found
