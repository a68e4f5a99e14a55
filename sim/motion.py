"""How the objects of the tracking task move: privileged random policies, blind to the agent."""

from __future__ import annotations

import numpy as np

from sim.placement import SEPARATION
from sim.state import WorldState, wrap_angle

SPEED = 0.5  # [m/s]
TURN = 0.4  # standard deviation of the change of heading per action [rad]


def wander(
    state: WorldState, rngs: list[np.random.Generator], bounds: np.ndarray, seconds: float
) -> tuple[np.ndarray, np.ndarray]:
    """Object positions (n, k, 3) and headings (n, k) one action later.

    Every object walks at SPEED with a heading that drifts at random. A step that would leave `bounds`
    (x_min, y_min, x_max, y_max) or come within SEPARATION of another object is not taken: the object turns to
    a random heading instead.
    """
    k = state.objects.shape[1]
    drift = np.array([rng.standard_normal(k) for rng in rngs])
    heading = wrap_angle(state.object_heading + TURN * drift)
    objects = state.objects.copy()
    for i in range(k):
        x = objects[:, i, 0] + SPEED * seconds * np.cos(heading[:, i])
        y = objects[:, i, 1] + SPEED * seconds * np.sin(heading[:, i])
        free = (x >= bounds[0]) & (y >= bounds[1]) & (x <= bounds[2]) & (y <= bounds[3])
        for j in range(k):
            if j != i:
                free &= np.hypot(objects[:, j, 0] - x, objects[:, j, 1] - y) >= SEPARATION
        objects[free, i, 0], objects[free, i, 1] = x[free], y[free]
        for world in np.flatnonzero(~free):
            heading[world, i] = rngs[world].uniform(-np.pi, np.pi)
    return objects, heading
