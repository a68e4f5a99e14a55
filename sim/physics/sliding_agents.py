"""Physics of the built-in worlds: agents that slide over a floor among walls, and objects that the task moves."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from optics.numerics.arguments import of_kind, whole
from sim.physics.agent_motion import AgentPhysics, Agents, Motion
from sim.physics.physics import MOST_THREADS, MOST_WORLDS
from sim.physics.varied_appearances import varied_appearances
from sim.scene.moved_bodies import MovedBodies, ReferencePose
from sim.scene.poses import Poses
from sim.scene.variation import Drawn, Variation
from sim.worlds.catalog import SUBSTEPS
from sim.worlds.state import WorldState, wrap_angle
from sim.worlds.world import MAX_SPEED, World

__all__ = ["MAX_TURN", "UNSTABLE", "SlidingAgents"]

MAX_TURN = np.pi / 4  # [rad] change of heading per action; chosen
UNSTABLE = "unstable physics"


class SlidingAgents:
    """`n` worlds of one layout. Each has an agent on two slide joints, and objects that collide with nothing.

    `sim.Physics` describes the methods that have no description in this class. However, `step(skipped)` of
    this class also moves the skipped worlds. Methods that need the state raise a RuntimeError before the first call of
    `place`, and so does `step` before the first call of `move_objects`.

    world: layout, model and starting positions
    n: number of worlds, 1 to 1,000,000
    threads: number of threads that may step the worlds, 1 to 65,536
    variation: ranges of quantities that differ between episodes; None: there are none
    before: attribute, all worlds before the last action; None before the first action
    state: attribute, current state of all worlds
    motion: attribute, motion of the agents during the last action; None before the first action
    chance: attribute, random streams of the worlds

    Raises:
        ValueError: an argument has the wrong type or is out of range, the model lacks a part of the agent, an object
            could collide, or `variation` names an object that the model lacks or that cannot vary.
    """

    def __init__(self, world: World, n: int, threads: int = 1, variation: Variation | None = None) -> None:
        of_kind("world", world, World, "sim.build_world('detection')")
        n, threads = whole("n", n, 1, MOST_WORLDS), whole("threads", threads, 1, MOST_THREADS)
        if variation is not None:
            of_kind("variation", variation, Variation, "Variation({'light': (0.5, 2)}), or None")
        self.world, self.n, self.model = world, n, world.model
        self.agents = AgentPhysics(world, threads)
        self.seconds, self.substeps, self.frames, self.passed = self.agents.seconds, SUBSTEPS, 1, list[Poses]()
        self._appearances = None if variation is None else varied_appearances(world.model, n, variation)
        self.varied: Mapping[str, tuple[str, ...]] = {} if self._appearances is None else self._appearances.varied
        self._heights = np.array([world.model.body(name).pos[2] for name in world.objects])
        bodies = [int(world.model.body(name).id) for name in ("agent", *world.objects)]
        self._reference = ReferencePose(world.model, bodies, turning=1)
        rest = self._reference.poses
        self._height = float(rest.xpos[0, bodies[0], 2])
        self._turns = np.repeat(rest.xmat[:, bodies[:1]], n, axis=0)
        self._state: WorldState | None = None
        self._command = np.zeros((n, 2))
        self._moved: tuple[np.ndarray, np.ndarray] | None = None
        self.before: WorldState | None = None
        self.motion: Motion | None = None
        self.chance: Any = None

    @property
    def state(self) -> WorldState:
        """Current state of all worlds.

        Raises:
            RuntimeError: `place` has not been called yet.
        """
        if self._state is None:
            raise RuntimeError("the worlds have not begun: call reset first")
        return self._state

    @state.setter
    def state(self, state: WorldState | None) -> None:
        self._state = state

    def start_episode(self, world: int, drawn: Mapping[str, Drawn]) -> None:
        if self._appearances is not None:
            self._appearances.start_episode(world, drawn)

    def place(
        self, worlds: np.ndarray, agents: np.ndarray, headings: np.ndarray, objects: np.ndarray, courses: np.ndarray
    ) -> None:
        """Start episodes in some worlds, with these positions and headings.

        worlds: indices of the worlds, (world,); the other arrays have one row for each of them
        agents: positions (x, y) of the agents [m], (world, 2)
        headings: headings of the agents [rad], (world,)
        objects: positions (x, y) of the objects [m], (world, k, 2)
        courses: headings of the objects [rad], (world, k)
        """
        n, k = len(worlds), len(self.world.objects)
        centres = np.empty((n, k, 3))
        centres[:, :, :2], centres[:, :, 2] = objects, self._heights
        fresh = WorldState(
            position=agents,
            heading=headings,
            velocity=np.zeros((n, 2)),
            objects=centres,
            object_heading=courses,
            start=agents.copy(),
            steps=np.zeros(n, int),
            goals_reached=np.zeros(n, int),
            adversaries_reached=np.zeros(n, int),
        )
        others = fresh.take(np.zeros(self.n, int)) if self._state is None else self._state
        self._state = fresh if n == self.n else others.put(worlds, fresh)

    def steer(self, actions: np.ndarray) -> None:
        """Set the forward speed and the change of heading in the next step, (n, 2), each as a command in [-1, 1].

        Speeds range from 0 to MAX_SPEED (10 m/s). Changes range from -MAX_TURN to MAX_TURN (45°), positive to the left.
        """
        self._command = actions

    def move_objects(self, objects: np.ndarray, courses: np.ndarray) -> None:
        """Set where the objects will be after the next step: positions [m], (n, k, 3), and headings [rad], (n, k).

        Call this method before the first `step`. Later steps without another call leave the objects at these positions.
        """
        self._moved = objects, courses

    def put_objects(self, objects: np.ndarray) -> None:
        """Move the objects to these positions [m], (n, k, 3), after an action."""
        self._state = replace(self.state, objects=objects)

    def count(self, goals: np.ndarray, adversaries: np.ndarray) -> None:
        """Add these numbers, (n,) each, to the counts of goals and adversaries that each agent has reached."""
        state = self.state
        self._state = replace(
            state,
            goals_reached=state.goals_reached + goals,
            adversaries_reached=state.adversaries_reached + adversaries,
        )

    def settle(self, worlds: np.ndarray) -> None:
        """Do nothing, since `poses` computes all poses from the state."""

    def adopt_changed_model(self) -> bool:
        return False

    def watch(self) -> None:
        """Do nothing, since a task cannot change the model."""

    def check(self, whose: str) -> None:
        """Do nothing, since a task cannot change the model."""

    def step(self, skipped: Collection[int]) -> dict[int, str]:
        before = self.state
        if self._moved is None:
            raise RuntimeError("the objects have no positions after the step: call move_objects first")
        self.before, (objects, courses) = before, self._moved
        heading, velocity = _steered(before.heading, self._command)
        self.motion = motion = self.agents.step(Agents(before.position, heading, before.velocity), velocity)
        after = WorldState(
            position=motion.path[:, -1].copy(),
            heading=heading,
            velocity=motion.velocity,
            objects=objects,
            object_heading=courses,
            start=before.start,
            steps=before.steps + 1,
            goals_reached=before.goals_reached,
            adversaries_reached=before.adversaries_reached,
        )
        broken: dict[int, str] = {}
        if motion.unstable.any() or not after.all_finite:
            worlds = np.flatnonzero(motion.unstable | ~after.finite)
            after, broken = after.repaired(), dict.fromkeys(worlds.tolist(), UNSTABLE)
        self._state = after
        shares = [k / self.frames for k in range(1, self.frames)]
        self.passed = [self._between(before, after, share, list(broken)) for share in shares]
        return broken

    def _between(self, before: WorldState, after: WorldState, share: float, broken: list[int]) -> Poses:
        """Return the poses at a moment between the beginning and the end of an action.

        The heading changes when the action begins.

        share: elapsed fraction of the action
        broken: worlds whose physics broke down; their poses are already those after the action
        """
        assert self.motion is not None
        position = self.motion.path[:, round(share * SUBSTEPS) - 1].copy()
        objects = before.objects + share * (after.objects - before.objects)
        position[broken], objects[broken] = after.position[broken], after.objects[broken]
        return self._poses(replace(after, position=position, objects=objects))

    def poses(self) -> Poses:
        return self._poses(self.state)

    def _poses(self, state: WorldState) -> Poses:
        positions = np.empty((state.n, 1 + state.objects.shape[1], 3))
        positions[:, 0, :2], positions[:, 0, 2], positions[:, 1:] = state.position, self._height, state.objects
        rotations, (cos, sin) = self._turns.copy(), (np.cos(state.heading), np.sin(state.heading))
        rotations[:, 0, 0, 0] = rotations[:, 0, 1, 1] = cos
        rotations[:, 0, 1, 0], rotations[:, 0, 0, 1] = sin, -sin
        models = None if self._appearances is None else self._appearances.models
        return MovedBodies(self._reference, positions, rotations, models)

    def get_state(self) -> dict[str, np.ndarray]:
        return {name: array.copy() for name, array in vars(self.state).items()}

    def set_state(self, state: Mapping[str, np.ndarray], worlds: np.ndarray) -> None:
        names = vars(self.state)
        self._state = self.state.put(worlds, WorldState(**{name: np.asarray(state[name])[worlds] for name in names}))

    def close(self) -> None:
        self.agents.close()


def _steered(heading: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return headings [rad] (n,) after turning, and commanded velocities [m/s] (n, 2).

    heading: headings before turning [rad], (n,)
    actions: forward speed and change of heading, each in [-1, 1], (n, 2)
    """
    speed, turn = actions.astype(np.float64).T
    heading = wrap_angle(heading + MAX_TURN * turn)
    speed = MAX_SPEED * (speed + 1.0) / 2.0
    velocity = np.empty((len(heading), 2))
    velocity[:, 0], velocity[:, 1] = np.cos(heading) * speed, np.sin(heading) * speed
    return heading, velocity
