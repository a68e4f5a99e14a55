"""Where an episode starts: the agent and the objects drawn at random, never within reach of each other."""

from __future__ import annotations

import numpy as np

REACH = 1.0  # [m] from the agent's centre to an object's: closer counts as reached
SEPARATION = 2 * REACH  # [m] between objects: no place is within reach of two
CLEARANCE = REACH + 0.5  # [m] between the agent's start and an object
TRIES = 100


def place(
    rng: np.random.Generator, agent_spawn: np.ndarray, object_spawn: np.ndarray, n_objects: int
) -> tuple[np.ndarray, np.ndarray]:
    """An agent position (2,) and object positions (k, 2), drawn from the cells' centres.

    Raises ValueError when the cells cannot hold them SEPARATION and CLEARANCE apart.
    """
    for _ in range(TRIES):
        agent = agent_spawn[rng.integers(len(agent_spawn))]
        free, objects = _apart(object_spawn, agent, CLEARANCE), np.empty((n_objects, 2))
        for i in range(n_objects):
            spots = np.flatnonzero(free)
            if not len(spots):
                break
            objects[i] = object_spawn[spots[rng.integers(len(spots))]]
            free &= _apart(object_spawn, objects[i], SEPARATION)
        else:
            return agent, objects
    raise ValueError(
        f"object_spawn: no way found to place {n_objects} objects {SEPARATION} m apart and {CLEARANCE} m from "
        f"the agent on {len(object_spawn)} cells"
    )


def free_spot(
    rng: np.random.Generator, agent: np.ndarray, others: np.ndarray, object_spawn: np.ndarray
) -> np.ndarray | None:
    """A cell's centre (2,) clear of the agent and of the other objects (k, 2); None where there is none."""
    free = _apart(object_spawn, agent, CLEARANCE)
    for other in others:
        free &= _apart(object_spawn, other, SEPARATION)
    spots = np.flatnonzero(free)
    return object_spawn[spots[rng.integers(len(spots))]] if len(spots) else None


def _apart(spots: np.ndarray, place: np.ndarray, distance: float) -> np.ndarray:
    """Which spots (n, 2) are at least `distance` [m] from a place (2,), (n,) bool."""
    x, y = spots[:, 0] - place[0], spots[:, 1] - place[1]
    apart: np.ndarray = x * x + y * y >= distance**2
    return apart
