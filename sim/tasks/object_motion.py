"""Random motion of the objects in the tracking task.

The objects avoid each other, based on their exact positions, but they do not react to the agent.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from sim.tasks.random_streams import MotionNoise
from sim.worlds.layout import SEPARATION
from sim.worlds.state import WorldState, wrap_angle

SPEED = 0.5  # [m/s], as published
TURN = 0.4  # [rad] standard deviation of the change of heading per action


def wander(state: WorldState, chance: MotionNoise, bounds: np.ndarray, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the positions (n, k, 3) [m] and headings (n, k) [rad] of the objects one action later.

    Every object moves at 0.5 m/s, and its heading drifts randomly. A step must not lead out of `bounds` (x_min, y_min,
    x_max, y_max), nor to a point closer than 2 m to the present or next position of another object. If a step
    would break these rules, the object stays at its position and turns to a random heading.

    chance: random numbers for drift and turns
    seconds: duration of an action [s]
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
    """Return the squared distance [m²] from each object's next position to the nearest other object, (n, k).

    Present and next positions of the other objects are considered.

    to_x, to_y: next positions [m], (n, k)
    x, y: present positions [m], (n, k)
    """
    # The worlds are on the last axis because NumPy's inner loop runs over this axis, and there are many worlds.
    place_x, place_y = (np.ascontiguousarray(np.concatenate(at, axis=1).T) for at in ([x, to_x], [y, to_y]))
    k = x.shape[1]
    squared = (place_x[k:, None] - place_x) ** 2
    squared += (place_y[k:, None] - place_y) ** 2
    squared += _but_itself(k)
    nearest: np.ndarray = squared.min(axis=1).T
    return nearest


@cache
def _but_itself(k: int) -> np.ndarray:
    """Return an array (k, 2k, 1) that is added to squared distances from k objects to 2k positions.

    The 2k positions are the present and the next positions of all k objects. The array is infinite where an object is
    compared with its own present or next position, and 0 elsewhere.
    """
    return np.tile(np.diag(np.full(k, np.inf)), 2)[..., None]
