"""Worlds in motion, unseen: actions in, states and rewards out. What eyes make of it is added by the environments."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from numbers import Real

import numpy as np

from optics.numerics.arguments import shown
from sim.envs.observation import STANDING
from sim.physics.physics import Agents, Motion, Physics
from sim.tasks.random_streams import Streams
from sim.tasks.reward import MODES, TERMS, check_mode, reward_terms
from sim.tasks.task import respawned, task_of
from sim.worlds.catalog import EPISODE_STEPS
from sim.worlds.state import WorldState, wrap_angle
from sim.worlds.world import MAX_SPEED, World

MAX_TURN = np.pi / 4  # [rad] change of heading per action; chosen

UNSTABLE = "unstable physics"
NO_ACTION = "action is not finite"
LEAST_RETURN = "least return"
NOWHERE = np.empty(0, int)


@dataclass(frozen=True)
class Moved:
    """Worlds that have moved by one action.

    actions: as they were taken, (n, 2): within [-1, 1], and STANDING where they were not finite
    state: after it; where the physics broke down, the last good one
    motion: of the agents
    failed: worlds that could not go on, most often none: what the action or the physics was
    """

    actions: np.ndarray
    state: WorldState
    motion: Motion
    failed: dict[int, str]

    @property
    def well(self) -> np.ndarray:
        """Worlds that could go on, (n,) bool."""
        well = np.ones(self.state.n, bool)
        well[list(self.failed)] = False
        return well


@dataclass(frozen=True)
class Step:
    """One action of all worlds, before any world is started anew.

    state: after the action; where `failure` is set, the last good one
    terms: of the reward, in the order of TERMS (term, n)
    terminated, truncated, contact, success: (n,) bool; success: the goal was reached in this episode
    adversary_first: the action reached an adversary, and before any goal, (n,) bool
    respawned: worlds in which an object was put elsewhere
    given_up: truncated because the rewards of the episode add up to too little, (n,) bool
    failure: world that could not go on -> why: "unstable physics" or "action is not finite"
    """

    state: WorldState
    terms: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray
    contact: np.ndarray
    success: np.ndarray
    adversary_first: np.ndarray
    respawned: np.ndarray
    given_up: np.ndarray
    failure: dict[int, str]

    @property
    def reward(self) -> np.ndarray:
        """Sum of the terms, (n,)."""
        return self.terms.sum(axis=0)

    @property
    def reward_terms(self) -> dict[str, np.ndarray]:
        """Each term (n,) by its name."""
        return dict(zip(TERMS, self.terms, strict=True))

    @property
    def done(self) -> np.ndarray:
        return self.terminated | self.truncated


class Simulation:
    """`n` independent worlds of one layout.

    world: geometry and places to start from
    n: number of worlds
    seed: of all random streams; None draws one
    mode: "training": reaching an object ends the episode; "evaluation": the object respawns, and rewards are weighted
        as fitness
    threads: of the physics
    least_return: an episode whose rewards add up to no more is truncated, for training only; None: none is

    Raises:
        ValueError: an unknown mode, less than one world, or a least return that is not below 0 or not for training.
    """

    def __init__(
        self, world: World, n: int, seed: int | None, mode: str, threads: int, least_return: float | None = None
    ) -> None:
        check_mode(mode)
        check_least_return(least_return, mode)
        if n < 1:
            raise ValueError(f"n_envs = {n!r}: must be at least 1")
        self.world, self.n, self.mode, self.least_return = (
            world,
            n,
            mode,
            -math.inf if least_return is None else least_return,
        )
        self._steps = world.episode_steps or EPISODE_STEPS
        self._returns = np.zeros(n)
        self.task = task_of(world)
        self._physics = Physics(world, threads)
        self._heights = np.array([world.model.body(name).pos[2] for name in world.objects])
        self._state: WorldState | None = None
        self.seed(seed)

    @property
    def state(self) -> WorldState:
        """All worlds as they are now.

        Raises:
            RuntimeError: before the first reset.
        """
        if self._state is None:
            raise RuntimeError("the worlds have not begun: call reset first")
        return self._state

    def seed(self, seed: int | None) -> None:
        """Start all random streams anew, from the next reset on."""
        self.streams = Streams(seed, self.n)
        self._state = None

    def reset(self) -> WorldState:
        """Start all episodes anew."""
        self._state = self._begin(np.arange(self.n))
        self._returns[:] = 0.0
        return self._state

    def close(self) -> None:
        """Stop the physics' threads."""
        self._physics.close()

    def restart(self, worlds: np.ndarray) -> WorldState:
        """Start the episodes of these worlds anew."""
        self._state = self.state.put(worlds, self._begin(worlds))
        self._returns[worlds] = 0.0
        return self._state

    def step(self, actions: np.ndarray) -> Step:
        """Advance all worlds by one action; actions (n, 2) in [-1, 1]: forward speed, change of heading."""
        return self.judge(self.move(actions))

    def move(self, actions: np.ndarray) -> Moved:
        """The first half of a step: everything moves."""
        before = self.state
        taken, idle = _taken(actions)
        heading, velocity = _steered(before.heading, taken)
        motion = self._physics.step(Agents(before.position, heading, before.velocity), velocity)
        objects, object_heading = self.task.move(before, self.streams.motion, self._physics.seconds)
        after = replace(
            before,
            position=motion.path[:, -1].copy(),
            heading=heading,
            velocity=motion.velocity,
            objects=objects,
            object_heading=object_heading,
            steps=before.steps + 1,
        )
        failed: dict[int, str] = {}
        if motion.unstable.any() or not after.all_finite:
            broken = motion.unstable | ~after.finite
            after, failed = after.repaired(), dict.fromkeys(np.flatnonzero(broken).tolist(), UNSTABLE)
        return Moved(taken, after, motion, failed | dict.fromkeys(idle, NO_ACTION))

    def judge(self, moved: Moved) -> Step:
        """The second half: what it led to. Objects that were reached may be elsewhere afterwards."""
        before, after, motion = self.state, moved.state, moved.motion
        outcome = self.task.judge(before, after, motion.path, ends=self.mode == "training")
        terminated = outcome.terminated
        if moved.failed:
            outcome = outcome.within(moved.well)
            terminated = outcome.terminated | ~moved.well
        elsewhere = NOWHERE
        if outcome.event.any():
            after = replace(
                after,
                goals_reached=before.goals_reached + outcome.goal,
                adversaries_reached=before.adversaries_reached + outcome.adversary,
            )
            after = respawned(self.task, after, outcome.respawn, self.streams.placement)
            elsewhere = np.unique(outcome.respawn.nonzero()[0])
        self._state = final = after
        terms = reward_terms(MODES[self.mode], outcome.progress, outcome.goal, outcome.adversary, motion.contact)
        self._returns += terms.sum(axis=0)
        given_up = (self._returns <= self.least_return) & ~terminated
        return Step(
            state=final,
            terms=terms,
            terminated=terminated,
            truncated=((final.steps >= self._steps) | given_up) & ~terminated,
            contact=motion.contact,
            success=final.goals_reached > 0,
            adversary_first=outcome.adversary_first,
            respawned=elsewhere,
            given_up=given_up,
            failure=moved.failed,
        )

    def _begin(self, worlds: np.ndarray) -> WorldState:
        n, k = len(worlds), len(self.world.objects)
        position, heading = np.empty((n, 2)), np.empty(n)
        objects, object_heading = np.empty((n, k, 3)), np.empty((n, k))
        objects[:, :, 2] = self._heights
        for row, world in enumerate(worlds):
            rng = self.streams.placement[world]
            beginning = self.task.begin(rng, training=self.mode == "training")
            position[row], objects[row, :, :2], heading[row] = beginning.agent, beginning.objects, beginning.heading
            object_heading[row] = rng.uniform(-np.pi, np.pi, k)
        return WorldState(
            position=position,
            heading=heading,
            velocity=np.zeros((n, 2)),
            objects=objects,
            object_heading=object_heading,
            start=position.copy(),
            steps=np.zeros(n, int),
            goals_reached=np.zeros(n, int),
            adversaries_reached=np.zeros(n, int),
        )


def check_least_return(least_return: float | None, mode: str) -> None:
    """Refuse a least return that would end every episode at once, or episodes that fitness comes from.

    Raises:
        ValueError: it is.
    """
    if least_return is None:
        return
    if isinstance(least_return, bool) or not isinstance(least_return, Real) or not least_return < 0:
        raise ValueError(f"least_return = {shown(least_return)}: must be below 0, or None")
    if mode != "training":
        raise ValueError(f"least_return = {least_return!r}: must be left out in mode {mode!r}, only training ends so")


def _taken(actions: np.ndarray) -> tuple[np.ndarray, list[int]]:
    """Actions as they are taken, and the worlds whose agents stand because theirs were not finite."""
    finite = np.isfinite(actions)
    idle: list[int] = []
    if not finite.all():
        idle = np.flatnonzero(~finite.all(axis=-1)).tolist()
        actions = actions.copy()
        actions[idle] = STANDING
    return np.minimum(np.maximum(actions, -1.0), 1.0), idle


def _steered(heading: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Headings [rad] (n,) after turning, and commanded velocities [m/s] (n, 2)."""
    speed, turn = actions.astype(np.float64).T
    heading = wrap_angle(heading + MAX_TURN * turn)
    speed = MAX_SPEED * (speed + 1.0) / 2.0
    velocity = np.empty((len(heading), 2))
    velocity[:, 0], velocity[:, 1] = np.cos(heading) * speed, np.sin(heading) * speed
    return heading, velocity
