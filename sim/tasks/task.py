"""The tasks: where episodes start, what moves, what counts as progress, what ends an episode.

A task says how many metres of progress an action made, and whether the goal or an adversary was reached. What that is
worth, with a penalty for contact with a wall, is in `sim.tasks.reward`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from sim.tasks.object_motion import wander
from sim.tasks.placement import Places, free_spot
from sim.tasks.random_streams import MotionNoise
from sim.worlds.catalog import TASKS
from sim.worlds.layout import REACH
from sim.worlds.state import WorldState, wrap_angle
from sim.worlds.world import World

HEADING_SPREAD = math.radians(20)  # [rad] either way, of headings along a course; chosen


@dataclass(frozen=True)
class Outcome:
    """What one action led to, per world.

    progress [m], in the task's sense (n,) · goal, adversary: reached (n,) bool · adversary_first: an adversary was
    reached, and before any goal (n,) bool · respawn: objects to put elsewhere (n, k) bool · terminated (n,) bool
    """

    progress: np.ndarray
    goal: np.ndarray
    adversary: np.ndarray
    adversary_first: np.ndarray
    respawn: np.ndarray
    terminated: np.ndarray

    @property
    def event(self) -> np.ndarray:
        """Something was reached, (n,) bool."""
        return self.goal | self.adversary

    def within(self, worlds: np.ndarray) -> Outcome:
        """The same in these worlds, (n,) bool; in the others nothing came of it."""
        return Outcome(
            progress=np.where(worlds, self.progress, 0.0),
            goal=self.goal & worlds,
            adversary=self.adversary & worlds,
            adversary_first=self.adversary_first & worlds,
            respawn=self.respawn & worlds[:, None],
            terminated=self.terminated & worlds,
        )


@dataclass(frozen=True)
class Beginning:
    """Start of an episode in one world: agent (2,) [m], objects (k, 2) [m] and the agent's heading [rad]."""

    agent: np.ndarray
    objects: np.ndarray
    heading: float


class Rules(Protocol):
    """The rules of a game on a World; pure functions of states, all worlds at once."""

    @property
    def world(self) -> World:
        """Where it is played."""

    def begin(self, rng: np.random.Generator, training: bool) -> Beginning:
        """Start of an episode in one world."""

    def move(self, state: WorldState, chance: MotionNoise, seconds: float) -> tuple[np.ndarray, np.ndarray]:
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
    def _goals(self) -> int:
        """How many of the objects, the first ones, are goals.

        Raises:
            ValueError: others are between them.
        """
        are_goals = [name.startswith("goal") for name in self.world.objects]
        if sorted(are_goals, reverse=True) != are_goals:
            raise ValueError(f"objects = {self.world.objects}: goals must come first")
        return sum(are_goals)

    @cached_property
    def _places(self) -> Places:
        return Places(self.world.agent_spawn, self.world.object_spawn)

    @cached_property
    def _bounds(self) -> np.ndarray:
        """Of where objects move: x_min, y_min, x_max, y_max [m]."""
        spots = self.world.object_spawn
        return np.concatenate([spots.min(axis=0), spots.max(axis=0)])

    def begin(self, rng: np.random.Generator, training: bool) -> Beginning:
        agent, objects = self._places.draw(rng, len(self.world.objects))
        return Beginning(agent, objects, rng.uniform(-np.pi, np.pi))

    def move(self, state: WorldState, chance: MotionNoise, seconds: float) -> tuple[np.ndarray, np.ndarray]:
        if not self.moving:
            return state.objects, state.object_heading
        return wander(state, chance, self._bounds, seconds)

    def judge(self, before: WorldState, after: WorldState, path: np.ndarray, ends: bool) -> Outcome:
        goals, never = self._goals, path.shape[1]
        was, is_now = (_distance_to_goal(state, goals) for state in (before, after))
        first = first_reached(path, before.objects, after.objects)
        nothing = np.zeros(len(path), bool)
        if (first == never).all():
            return Outcome(was - is_now, nothing, nothing, nothing, np.zeros(first.shape, bool), nothing)
        goal_at, adversary_at = (of.min(axis=1, initial=never) for of in (first[:, :goals], first[:, goals:]))
        goal, adversary = goal_at < never, adversary_at < never
        adversary_first = adversary & (adversary_at < goal_at)
        if ends:
            goal, adversary = goal & ~adversary_first, adversary_first
        return Outcome(
            progress=was - is_now,
            goal=goal,
            adversary=adversary,
            adversary_first=adversary_first,
            respawn=np.zeros(first.shape, bool) if ends else first < never,
            terminated=goal | adversary if ends else nothing,
        )


@dataclass(frozen=True)
class FindWay:
    """Navigation and maze: get far from the start and into the goal region.

    Progress is the increase of the distance from the start. Reaching the goal region ends the episode, in
    evaluation too: there is no object that could respawn elsewhere.
    """

    world: World

    def begin(self, rng: np.random.Generator, training: bool) -> Beginning:
        starts = (self.world.training_starts if training else None) or self.world.starts
        place = rng.integers(len(starts.position))
        if starts.heading is None:
            return Beginning(starts.position[place], np.empty((0, 2)), rng.uniform(-np.pi, np.pi))
        heading = wrap_angle(starts.heading[place] + rng.uniform(-HEADING_SPREAD, HEADING_SPREAD))
        return Beginning(starts.position[place], np.empty((0, 2)), float(heading))

    def move(self, state: WorldState, chance: MotionNoise, seconds: float) -> tuple[np.ndarray, np.ndarray]:
        return state.objects, state.object_heading

    def judge(self, before: WorldState, after: WorldState, path: np.ndarray, ends: bool) -> Outcome:
        region = self.world.goal_region
        if region is None:
            raise ValueError(f"world {self.world.task!r} has no goal_region")
        was, is_now = (np.linalg.norm(s.position - before.start, axis=-1) for s in (before, after))
        inside = path[..., 0] >= region[0]
        for side in (path[..., 0] <= region[2], path[..., 1] >= region[1], path[..., 1] <= region[3]):
            inside &= side
        goal = inside.any(axis=1)
        return Outcome(
            progress=is_now - was,
            goal=goal,
            adversary=np.zeros(before.n, bool),
            adversary_first=np.zeros(before.n, bool),
            respawn=np.zeros((before.n, 0), bool),
            terminated=goal,
        )


def task_of(world: World) -> Rules:
    """The rules that go with a world.

    Raises:
        ValueError: a world of no known task.
    """
    if world.task not in TASKS:
        raise ValueError(f"task = {world.task!r}: must be one of {', '.join(map(repr, TASKS))}")
    return FindGoal(world, moving=world.task == "tracking") if world.objects else FindWay(world)


def _distance_to_goal(state: WorldState, goals: int) -> np.ndarray:
    """From the agent's centre to the nearest goal's, on the ground [m], (n,); the first objects are goals."""
    x = state.objects[:, :goals, 0] - state.position[:, :1]
    y = state.objects[:, :goals, 1] - state.position[:, 1:]
    nearest: np.ndarray = np.sqrt(np.minimum.reduce(x * x + y * y, axis=1))
    return nearest


def first_reached(path: np.ndarray, objects_before: np.ndarray, objects_after: np.ndarray) -> np.ndarray:
    """First substep at which the agent is within REACH of each object, (n, k); the number of substeps if never.

    path (n, substep, 2): the agent at the *end* of each substep; objects (n, k, 3) move evenly from before to after.
    """
    substeps = path.shape[1]
    # Worlds come last, side by side, as there are many of them: NumPy's inner loop is over that axis.
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
    """Objects (n, k, 3) as (x | y, 1, k, n)."""
    return objects.T[:2].copy()[:, None]


def respawned(task: Rules, state: WorldState, which: np.ndarray, rngs: list[np.random.Generator]) -> WorldState:
    """The state with the objects `which` (n, k) put on free spots of their world.

    Raises:
        ValueError: the world has no free spot left.
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
