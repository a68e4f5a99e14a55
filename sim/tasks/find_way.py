"""The tasks navigation and maze: the agent moves away from the start and reaches the goal region."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from sim.physics.sliding_agents import SlidingAgents
from sim.tasks.built_in import AgentEvents, AgentTask
from sim.tasks.outcome import Outcome
from sim.worlds.state import wrap_angle

__all__ = ["HEADING_SPREAD", "FindWay"]

HEADING_SPREAD = math.radians(20)  # [rad] largest deviation of an initial heading from the course


class FindWay(AgentTask):
    """Task in which the agent moves away from the start and reaches the goal region.

    It is the task of the worlds "navigation" and "maze". The progress, a term of the reward, is the increase of the
    distance from the start. Reaching the goal region ends the episode, in training as well as in evaluation and test.
    (In the other tasks, goals are objects. In evaluation and test, a reached object respawns and the episode continues.
    Here, there are no objects.)
    """

    def reset(self, worlds: SlidingAgents, chosen: np.ndarray, rngs: Sequence[np.random.Generator]) -> None:
        n = len(chosen)
        starts = (self.world.training_starts if self.mode == "training" else None) or self.world.starts
        agents, headings = np.empty((n, 2)), np.empty(n)
        for row, rng in enumerate(rngs):
            place = rng.integers(len(starts.position))
            agents[row] = starts.position[place]
            if starts.heading is None:
                headings[row] = rng.uniform(-np.pi, np.pi)
            else:
                headings[row] = wrap_angle(starts.heading[place] + rng.uniform(-HEADING_SPREAD, HEADING_SPREAD))
        worlds.place(chosen, agents, headings, np.empty((n, 0, 2)), np.empty((n, 0)))

    def judge(self, worlds: SlidingAgents, failed: Mapping[int, str]) -> Outcome:
        assert worlds.before is not None
        assert worlds.motion is not None
        region, path = self.world.goal_region, worlds.motion.path
        if region is None:
            raise ValueError(f"world {self.world.task!r} has no goal_region")
        start = worlds.before.start
        progress = _distance(worlds.state.position, start) - _distance(worlds.before.position, start)
        inside = path[..., 0] >= region[0]
        if inside.any():  # most agents are far from the goal
            for side in (path[..., 0] <= region[2], path[..., 1] >= region[1], path[..., 1] <= region[3]):
                inside &= side
        goal, nothing = inside.any(axis=1), np.zeros(worlds.n, bool)
        nowhere = np.zeros((worlds.n, 0), bool)
        return self.weighted(worlds, AgentEvents(progress, goal, nothing, nothing, nowhere, goal), failed)


def _distance(places: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return the distances of positions (n, 2) from starting positions (n, 2) [m], (n,)."""
    apart = places - start
    distance: np.ndarray = np.sqrt(np.add.reduce(apart * apart, axis=-1))
    return distance
