"""The tasks detection, foraging and tracking: the agent reaches the goal and avoids the adversaries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from sim.physics.sliding_agents import SlidingAgents
from sim.tasks.built_in import AgentEvents, AgentTask
from sim.tasks.object_motion import wander
from sim.tasks.outcome import NOWHERE, Outcome
from sim.tasks.placement import SpawnPoints, free_spot
from sim.tasks.reach import distance_to_nearest, first_reached

__all__ = ["FindGoal"]


class FindGoal(AgentTask):
    """Task in which the agent reaches the goal and avoids the adversaries.

    The progress, a term of the reward, is the decrease of the distance to the nearest goal. The agent reaches an object
    if the distance between their centres is below 1 m at the end of any substep. In training, the first object that is
    reached ends the episode, and only this object counts. In evaluation and test, a reached object respawns and the
    episode continues. In the task "tracking", the objects move.
    """

    @cached_property
    def goals(self) -> int:
        """Number of goals. The goals must precede the adversaries in the list of objects.

        Raises:
            ValueError: the goals are not the first objects.
        """
        are_goals = [name.startswith("goal") for name in self.world.objects]
        if sorted(are_goals, reverse=True) != are_goals:
            raise ValueError(f"objects = {self.world.objects}: goals must come first")
        return sum(are_goals)

    @property
    def moving(self) -> bool:
        """True if the objects move."""
        return self.world.task == "tracking"

    @cached_property
    def _places(self) -> SpawnPoints:
        return SpawnPoints(self.world.agent_spawn, self.world.object_spawn)

    @cached_property
    def _bounds(self) -> np.ndarray:
        """Limits of the objects' motion: x_min, y_min, x_max, y_max [m], (4,)."""
        spots = self.world.object_spawn
        return np.concatenate([spots.min(axis=0), spots.max(axis=0)])

    def reset(self, worlds: SlidingAgents, chosen: np.ndarray, rngs: Sequence[np.random.Generator]) -> None:
        k = len(self.world.objects)
        agents, headings = np.empty((len(chosen), 2)), np.empty(len(chosen))
        objects, courses = np.empty((len(chosen), k, 2)), np.empty((len(chosen), k))
        for row, rng in enumerate(rngs):
            agents[row], objects[row] = self._places.draw(rng, k)
            headings[row] = rng.uniform(-np.pi, np.pi)
            courses[row] = rng.uniform(-np.pi, np.pi, k)
        worlds.place(chosen, agents, headings, objects, courses)

    def moved(self, worlds: SlidingAgents) -> tuple[np.ndarray, np.ndarray]:
        if not self.moving:
            return super().moved(worlds)
        return wander(worlds.state, worlds.chance.motion, self._bounds, worlds.seconds)

    def judge(self, worlds: SlidingAgents, failed: Mapping[int, str]) -> Outcome:
        return self.weighted(worlds, self._events(worlds), failed)

    def _events(self, worlds: Any) -> AgentEvents:
        before, after, path = worlds.before, worlds.state, worlds.motion.path
        goals, never, ends = self.goals, path.shape[1], self.mode == "training"
        progress = distance_to_nearest(before, goals) - distance_to_nearest(after, goals)
        first = first_reached(path, before.objects, after.objects)
        nothing = np.zeros(worlds.n, bool)
        if (first == never).all():
            return AgentEvents(progress, nothing, nothing, nothing, np.zeros(first.shape, bool), nothing)
        goal_at, adversary_at = (of.min(axis=1, initial=never) for of in (first[:, :goals], first[:, goals:]))
        goal, adversary = goal_at < never, adversary_at < never
        adversary_first = adversary & (adversary_at < goal_at)
        if ends:
            goal, adversary = goal & ~adversary_first, adversary_first
        terminated = goal | adversary if ends else nothing
        return AgentEvents(progress, goal, adversary, adversary_first, first < never, terminated)

    def put_elsewhere(self, worlds: SlidingAgents, events: AgentEvents) -> np.ndarray:
        if self.mode == "training":
            return NOWHERE
        objects = worlds.state.objects.copy()
        for world, index in zip(*np.nonzero(events.reached), strict=True):
            others = np.delete(objects[world, :, :2], index, axis=0)
            rng, agent = worlds.chance.episodes[world], worlds.state.position[world]
            spot = free_spot(rng, agent, others, self.world.object_spawn)
            if spot is None:
                raise ValueError("object_spawn: no free spot left to respawn an object; it needs more cells")
            objects[world, index, :2] = spot
        worlds.put_objects(objects)
        return np.unique(events.reached.nonzero()[0])
