"""How the objects of the tracking task move: privileged random policies, blind to the agent."""

from __future__ import annotations

import numpy as np

from sim.placement import SEPARATION
from sim.state import WorldState, wrap_angle
from sim.streams import Motion

SPEED = 0.5  # [m/s]
TURN = 0.4  # standard deviation of the change of heading per action [rad]


def wander(state: WorldState, chance: Motion, bounds: np.ndarray, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Object positions (n, k, 3) and headings (n, k) one action later.

    Every object walks at SPEED with a heading that drifts at random. A step that would leave `bounds`
    (x_min, y_min, x_max, y_max) or come within SEPARATION of another object is not taken: the object turns to
    a random heading instead.
    """
    k = state.objects.shape[1]
    drift, turn = chance.next(k)
    heading = wrap_angle(state.object_heading + TURN * drift)
    step = SPEED * seconds * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    objects = state.objects.copy()
    for i in range(k):
        there = objects[:, i, :2] + step[:, i]
        apart = ((objects[..., :2] - there[:, None]) ** 2).sum(axis=-1) >= SEPARATION**2
        apart[:, i] = True
        free = apart.all(axis=1) & ((there >= bounds[:2]) & (there <= bounds[2:])).all(axis=1)
        objects[:, i, :2] = np.where(free[:, None], there, objects[:, i, :2])
        heading[:, i] = np.where(free, heading[:, i], np.pi * turn[:, i])
    return objects, heading
