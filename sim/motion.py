"""How the objects of the tracking task move: privileged random policies, blind to the agent."""

from __future__ import annotations

import numpy as np

from sim.placement import SEPARATION
from sim.state import WorldState, wrap_angle
from sim.streams import Chance

SPEED = 0.5  # [m/s]
TURN = 0.4  # standard deviation of the change of heading per action [rad]


def wander(state: WorldState, chance: Chance, bounds: np.ndarray, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Object positions (n, k, 3) and headings (n, k) one action later.

    Every object walks at SPEED with a heading that drifts at random. A step that would leave `bounds`
    (x_min, y_min, x_max, y_max), or come within SEPARATION of where another object is or is about to step, is not
    taken: the object turns to a random heading instead.
    """
    drift, turn = chance.next(state.objects.shape[1])
    heading = wrap_angle(state.object_heading + TURN * drift)
    x, y = state.objects[..., 0], state.objects[..., 1]
    to_x, to_y = x + SPEED * seconds * np.cos(heading), y + SPEED * seconds * np.sin(heading)
    free = (to_x >= bounds[0]) & (to_y >= bounds[1]) & (to_x <= bounds[2]) & (to_y <= bounds[3])
    nearest = np.minimum(_between(to_x, to_y, x, y), _between(to_x, to_y, to_x, to_y)).min(axis=-1)
    free &= nearest >= SEPARATION**2
    objects = state.objects.copy()
    objects[..., 0], objects[..., 1] = np.where(free, to_x, x), np.where(free, to_y, y)
    return objects, np.where(free, heading, np.pi * turn)


def _between(x: np.ndarray, y: np.ndarray, others_x: np.ndarray, others_y: np.ndarray) -> np.ndarray:
    """Squared distances from each object to the others [m²], (n, k, k); infinite to itself."""
    squared: np.ndarray = (x[:, :, None] - others_x[:, None]) ** 2 + (y[:, :, None] - others_y[:, None]) ** 2
    itself = np.arange(x.shape[1])
    squared[:, itself, itself] = np.inf
    return squared
