"""Random starting positions of the agent and the objects, such that the agent starts out of reach of all objects."""

from __future__ import annotations

import numpy as np

from sim.worlds.layout import CLEARANCE, SEPARATION

TRIES = 100  # in the field of the detection task, the first try succeeded in all of 20 000 draws


class SpawnPoints:
    """Possible starting positions: centres of the world's square cells, for agents (a, 2) and objects (m, 2) [m]."""

    def __init__(self, agents: np.ndarray, objects: np.ndarray) -> None:
        self._agents, self._objects = agents, objects
        # These are computed in advance because an episode starts in some world in almost every step of a batch.
        self._clear_of_agent = np.array([_apart(objects, place, CLEARANCE) for place in agents])
        self._apart = np.array([_apart(objects, place, SEPARATION) for place in objects])

    def draw(self, rng: np.random.Generator, n_objects: int) -> tuple[np.ndarray, np.ndarray]:
        """Return an agent's position (2,) and the objects' positions (n_objects, 2) [m].

        Raises:
            ValueError: 100 attempts found no positions that keep the distances of 2 m between objects and
                1.5 m from the agent.
        """
        for _ in range(TRIES):
            agent, chosen = rng.integers(len(self._agents)), []
            free = self._clear_of_agent[agent]
            for _ in range(n_objects):
                spots = np.flatnonzero(free)
                if not len(spots):
                    break
                chosen.append(spots[rng.integers(len(spots))])
                free = free & self._apart[chosen[-1]]
            else:
                return self._agents[agent], self._objects[chosen]
        raise ValueError(
            f"object_spawn: no way found to place {n_objects} objects {SEPARATION} m apart and {CLEARANCE} m from "
            f"the agent on {len(self._objects)} cells"
        )


def free_spot(
    rng: np.random.Generator, agent: np.ndarray, others: np.ndarray, object_spawn: np.ndarray
) -> np.ndarray | None:
    """Return the centre (2,) of a random cell that is far enough from the agent and the other objects.

    Return None if no cell is far enough.

    agent, others: positions of the agent, (2,), and of the other objects, (k, 2) [m]
    object_spawn: centres of all cells in which an object may start, (cell, 2) [m]
    """
    free = _apart(object_spawn, agent, CLEARANCE)
    for other in others:
        free &= _apart(object_spawn, other, SEPARATION)
    spots = np.flatnonzero(free)
    return object_spawn[spots[rng.integers(len(spots))]] if len(spots) else None


def _apart(spots: np.ndarray, place: np.ndarray, distance: float) -> np.ndarray:
    """Return whether each position (n, 2) is at least `distance` [m] away from `place` (2,), (n,) bool."""
    x, y = spots[:, 0] - place[0], spots[:, 1] - place[1]
    apart: np.ndarray = x * x + y * y >= distance**2
    return apart
