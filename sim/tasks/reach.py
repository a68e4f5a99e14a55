"""Times at which an agent comes within reach of objects, and the agent's distance from the nearest goal."""

from __future__ import annotations

import numpy as np

from sim.worlds.layout import REACH
from sim.worlds.state import WorldState

__all__ = ["distance_to_nearest", "first_reached"]


def distance_to_nearest(state: WorldState, goals: int) -> np.ndarray:
    """Return the horizontal distance from the agent's centre to the nearest goal [m], (n,).

    goals: number of goals; they are the first objects
    """
    x = state.objects[:, :goals, 0] - state.position[:, :1]
    y = state.objects[:, :goals, 1] - state.position[:, 1:]
    nearest: np.ndarray = np.sqrt(np.minimum.reduce(x * x + y * y, axis=1))
    return nearest


def first_reached(path: np.ndarray, objects_before: np.ndarray, objects_after: np.ndarray) -> np.ndarray:
    """Return, for each object, the index of the first substep at whose end the agent is within 1 m of it, (n, k).

    For an object that the agent does not reach, the result is the number of substeps.

    path: positions of the agent at the *end* of each substep [m], (n, substep, 2)
    objects_before: positions of the objects before the action [m], (n, k, 3)
    objects_after: positions of the objects after the action [m], (n, k, 3); the motion between them is linear
    """
    substeps = path.shape[1]
    # The worlds are on the last axis because NumPy's inner loop runs over this axis, and there are many worlds.
    agent = path.T.copy()[:, :, None]  # (x | y, substep, 1, n)
    place = _on_the_ground(objects_after)
    if objects_after is not objects_before:
        before = _on_the_ground(objects_before)
        t = (np.arange(substeps) + 1.0)[:, None, None] / substeps
        place = before + t * (place - before)
    apart = agent - place
    apart *= apart
    near = apart[0] + apart[1] < REACH**2
    if not near.any():
        return np.full(objects_after.shape[:2], substeps)
    return np.where(near.any(axis=0), near.argmax(axis=0), substeps).T


def _on_the_ground(objects: np.ndarray) -> np.ndarray:
    """Return the x and y coordinates of objects at positions (world, object, 3).

    Shape: (2, 1, object, world), where the first axis is the coordinate, x or y.
    """
    return objects.T[:2].copy()[:, None]
