"""Motion of the objects in the tracking task: random policies that have full information about objects but none about
the agent."""

from __future__ import annotations

from functools import cache

import numpy as np

from sim.tasks.random_streams import MotionNoise
from sim.worlds.layout import SEPARATION
from sim.worlds.state import WorldState, wrap_angle

SPEED = 0.5  # [m/s], as published
TURN = 0.4  # chosen: standard deviation of the change of heading per action [rad]


def wander(state: WorldState, chance: MotionNoise, bounds: np.ndarray, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Return object positions (n, k, 3) and headings (n, k) one action later.

    Every object walks at SPEED with a randomly drifting heading. An object does not step out of `bounds` (x_min, y_min,
    x_max, y_max), or within SEPARATION of the present or next position of another object. It turns to a random heading
    instead.
    """
    drift, turn = chance.next(state.objects.shape[1])
    heading = wrap_angle(state.object_heading + TURN * drift)
    x, y = state.objects[..., 0], state.objects[..., 1]
    to_x, to_y = x + SPEED * seconds * np.cos(heading), y + SPEED * seconds * np.sin(heading)
    free = (to_x >= bounds[0]) & (to_y >= bounds[1]) & (to_x <= bounds[2]) & (to_y <= bounds[3])
    free &= _nearest(to_x, to_y, x, y) >= SEPARATION**2
    objects = state.objects.copy()
    objects[..., 0], objects[..., 1] = np.where(free, to_x, x), np.where(free, to_y, y)
    return objects, np.where(free, heading, np.pi * turn)


def _nearest(to_x: np.ndarray, to_y: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the squared distance from each object's next position to the nearest present or next position of another
    object [m²], (n, k)."""
    # The worlds are the last axis, since there are many of them and NumPy's inner loop is over this axis.
    place_x, place_y = (np.ascontiguousarray(np.concatenate(at, axis=1).T) for at in ([x, to_x], [y, to_y]))
    k = x.shape[1]
    squared = (place_x[k:, None] - place_x) ** 2
    squared += (place_y[k:, None] - place_y) ** 2
    squared += _but_itself(k)
    nearest: np.ndarray = squared.min(axis=1).T
    return nearest


@cache
def _but_itself(k: int) -> np.ndarray:
    """Return infinity for each of k objects' own two positions and 0 for the others, (k, 2k, 1)."""
    return np.tile(np.diag(np.full(k, np.inf)), 2)[..., None]
