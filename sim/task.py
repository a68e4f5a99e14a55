"""The tasks: where episodes start, what moves, what counts as progress, what ends an episode.

Rewards follow DESIGN: progress to the goal (detection, foraging, tracking) or away from the start (navigation), an
event reward for reaching the goal or an adversary, and a penalty per action in contact with a wall.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from sim.motion import wander
from sim.placement import REACH, free_spot, place
from sim.state import WorldState
from sim.streams import Chance
from sim.world import TASKS, World


@dataclass(frozen=True)
class Outcome:
    """What one action led to, per world.

    progress [m], in the task's sense (n,) · goal, adversary: reached (n,) bool · respawn: objects to put
    elsewhere (n, k) bool · terminated (n,) bool
    """

    progress: np.ndarray
    goal: np.ndarray
    adversary: np.ndarray
    respawn: np.ndarray
    terminated: np.ndarray


class Task(Protocol):
    """The rules of a game on a World; pure functions of states, all worlds at once."""

    @property
    def world(self) -> World:
        """Where it is played."""

    def begin(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Start of an episode in one world: agent (2,) and objects (k, 2)."""

    def move(self, state: WorldState, chance: Chance, seconds: float) -> tuple[np.ndarray, np.ndarray]:
        """Objects (n, k, 3) and their headings (n, k) one action later."""

    def judge(self, before: WorldState, after: WorldState, path: np.ndarray, ends: bool) -> Outcome:
        """What the action led to; path (n, substep, 2) is the agent's, `ends`: an event ends the episode."""


@dataclass(frozen=True)
class FindGoal:
    """Detection, foraging and tracking: reach the goal, avoid the adversaries.

    Progress is the decrease of the distance to the goal; an object is reached when the agent comes within REACH
    of its centre at any substep. An event ends the episode in training, and then only the first one counts; in
    evaluation the object respawns and the episode goes on.
    """

    world: World
    moving: bool

    @cached_property
    def _goals(self) -> np.ndarray:
        """Which objects are goals, (k,) bool."""
        return np.array([name.startswith("goal") for name in self.world.objects])

    @cached_property
    def _bounds(self) -> np.ndarray:
        """Of where objects move: x_min, y_min, x_max, y_max [m]."""
        spots = self.world.object_spawn
        return np.concatenate([spots.min(axis=0), spots.max(axis=0)])

    def begin(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        return place(rng, self.world.agent_spawn, self.world.object_spawn, len(self.world.objects))

    def move(self, state: WorldState, chance: Chance, seconds: float) -> tuple[np.ndarray, np.ndarray]:
        if not self.moving:
            return state.objects, state.object_heading
        return wander(state, chance, self._bounds, seconds)

    def judge(self, before: WorldState, after: WorldState, path: np.ndarray, ends: bool) -> Outcome:
        goals = self._goals
        first = first_reached(path, before.objects, after.objects)
        never = path.shape[1]
        goal_at = first[:, goals].min(axis=1)
        adversary_at = first[:, ~goals].min(axis=1)
        goal, adversary = goal_at < never, adversary_at < never
        if ends:
            goal, adversary = goal & (goal_at <= adversary_at), adversary & (adversary_at < goal_at)
        event = goal | adversary
        respawn = np.zeros_like(first, bool) if ends else first < never
        return Outcome(
            progress=_distance(before, goals) - _distance(after, goals),
            goal=goal,
            adversary=adversary,
            respawn=respawn,
            terminated=event if ends else np.zeros_like(event),
        )


@dataclass(frozen=True)
class LeaveMaze:
    """Navigation: get far from the start and into the goal region.

    Progress is the increase of the distance from the start. Reaching the goal region ends the episode, in
    evaluation too: there is no object that could respawn elsewhere.
    """

    world: World

    def begin(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        return self.world.agent_spawn[rng.integers(len(self.world.agent_spawn))], np.empty((0, 2))

    def move(self, state: WorldState, chance: Chance, seconds: float) -> tuple[np.ndarray, np.ndarray]:
        return state.objects, state.object_heading

    def judge(self, before: WorldState, after: WorldState, path: np.ndarray, ends: bool) -> Outcome:
        region = self.world.goal_region
        if region is None:
            raise ValueError(f"world {self.world.task!r} has no goal_region")
        inside = np.logical_and(path >= region[:2], path <= region[2:]).all(axis=-1)
        goal = np.any(inside, axis=1)
        away = [np.linalg.norm(s.position - before.start, axis=-1) for s in (before, after)]
        return Outcome(
            progress=away[1] - away[0],
            goal=goal,
            adversary=np.zeros_like(goal),
            respawn=np.zeros((before.n, 0), bool),
            terminated=goal,
        )


def task_of(world: World) -> Task:
    """The rules that go with a world. Raises ValueError for a world of no known task."""
    if world.task in ("detection", "foraging", "tracking"):
        return FindGoal(world, moving=world.task == "tracking")
    if world.task == "navigation":
        return LeaveMaze(world)
    raise ValueError(f"task = {world.task!r}, must be one of {', '.join(map(repr, TASKS))}")


def first_reached(path: np.ndarray, objects_before: np.ndarray, objects_after: np.ndarray) -> np.ndarray:
    """First substep at which the agent is within REACH of each object, (n, k); the number of substeps if never.

    path (n, substep, 2): the agent at the *end* of each substep; objects move evenly from before to after.
    """
    substeps, end = path.shape[1], path[:, -1, None]
    found = np.full(objects_after.shape[:2], substeps)
    # Most objects are so far away that nobody can have come near.
    moved = np.abs(path - end).reshape(len(path), -1).max(axis=1)[:, None]
    if objects_after is not objects_before:  # they move
        moved = moved + np.abs(objects_after - objects_before).max(axis=-1)
    offset = objects_after[..., :2] - end
    reach = REACH + np.sqrt(2) * moved
    worlds, which = ((offset**2).sum(axis=-1) < reach**2).nonzero()
    if len(worlds):
        t = (np.arange(substeps) + 1.0)[:, None] / substeps
        before, after = (objects[worlds, which, None, :2] for objects in (objects_before, objects_after))
        near = ((path[worlds] - (before + t * (after - before))) ** 2).sum(axis=-1) < REACH**2
        found[worlds, which] = np.where(near.any(axis=1), near.argmax(axis=1), substeps)
    return found


def respawned(task: Task, state: WorldState, which: np.ndarray, rngs: list[np.random.Generator]) -> WorldState:
    """The state with the objects `which` (n, k) put on free spots of their world.

    Raises ValueError where the world has no free spot left.
    """
    if not which.any():
        return state
    objects = state.objects.copy()
    for world, index in zip(*np.nonzero(which), strict=True):
        others = np.delete(objects[world, :, :2], index, axis=0)
        spot = free_spot(rngs[world], state.position[world], others, task.world.object_spawn)
        if spot is None:
            raise ValueError("object_spawn: no free spot left to respawn an object; it needs more cells")
        objects[world, index, :2] = spot
    return replace(state, objects=objects)


def _distance(state: WorldState, goals: np.ndarray) -> np.ndarray:
    """From the agent to the nearest goal [m], (n,)."""
    offset = state.objects[:, goals, :2] - state.position[:, None]
    distance: np.ndarray = np.sqrt((offset**2).sum(axis=-1).min(axis=1))
    return distance
