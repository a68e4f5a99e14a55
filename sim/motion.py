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
    drift = np.stack([rng.standard_normal(k) for rng in rngs])
    escape = np.stack([rng.uniform(-np.pi, np.pi, k) for rng in rngs])
    heading = wrap_angle(state.object_heading + TURN * drift)
    objects = state.objects.copy()
    for i in range(k):
        way = np.stack([np.cos(heading[:, i]), np.sin(heading[:, i])], axis=-1)
        target = objects[:, i, :2] + SPEED * seconds * way
        inside = ((target >= bounds[:2]) & (target <= bounds[2:])).all(axis=-1)
        gaps = np.linalg.norm(np.delete(objects[:, :, :2], i, axis=1) - target[:, None], axis=-1)
        free = inside & (gaps >= SEPARATION).all(axis=-1)
        objects[free, i, :2] = target[free]
        heading[:, i] = np.where(free, heading[:, i], escape[:, i])
    return objects, heading
