"""Batched motion of the built-in agents: all worlds advance by one action, on several threads if there are many worlds.

The agent is a heavy body on two slide joints, which velocity actuators drive. Its heading is set directly, without
simulation. Objects are mocap bodies that collide with nothing, so physics does not need their positions. Agents that
cannot touch anything during the action move in closed form (`sim.physics.free_motion`). MuJoCo simulates all other
agents, if possible each in a small model of the geoms that it could touch (`sim.physics.local_contacts`).
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import mujoco
import numpy as np

from optics.numerics.number_types import all_finite
from sim.physics.free_motion import free_motion_of
from sim.physics.local_contacts import local_contacts_of
from sim.physics.mujoco_batch import BatchedStep
from sim.scene.moved_bodies import as_slice
from sim.worlds.catalog import SUBSTEPS
from sim.worlds.state import WorldState
from sim.worlds.world import MAX_SPEED, World

UNSTABLE_SPEED = 10 * MAX_SPEED  # [m/s], a speed that no actuator can cause
FEW_GEOMS = 200  # largest number of geoms for which a test of each is faster than MuJoCo's tree of bounding volumes


@dataclass(frozen=True)
class Motion:
    """Motion of the agents during one action.

    path: positions at the end of each substep [m], (n, substep, 2)
    velocity: velocity after the last substep [m/s], (n, 2)
    contact: True if the agent touched something in any substep, (n,) bool
    unstable: True if the simulation broke down, (n,) bool; the agent then stays in place with velocity 0 and
        without contact
    """

    path: np.ndarray
    velocity: np.ndarray
    contact: np.ndarray
    unstable: np.ndarray

    def put(self, worlds: np.ndarray, motion: Motion) -> None:
        """Overwrite the motion in the worlds with these indices, in place.

        Call this only on a new object that no other code has received yet: a returned `Motion` should not change.
        """
        for name, array in vars(self).items():
            array[worlds] = getattr(motion, name)


@dataclass(frozen=True)
class Agents:
    """Positions [m], (n, 2), headings [rad], (n,), and velocities [m/s], (n, 2), of agents."""

    position: np.ndarray
    heading: np.ndarray
    velocity: np.ndarray

    def take(self, some: np.ndarray) -> Agents:
        """Return the agents with these indices only."""
        return Agents(self.position[some], self.heading[some], self.velocity[some])


class AgentPhysics:
    """Physics of many agents at once, each in its own copy of the same world.

    world: the world, whose model all agents share
    threads: number of threads for MuJoCo's batched step of 128 or more worlds
    closed_form: if True, agents that cannot reach any obstacle move in closed form (`free_motion`), and agents near
        obstacles are simulated in models of these obstacles alone (`local_contacts`). If `closed_form` is False, MuJoCo
        simulates all agents in the whole world. The attributes `free_motion` and `local_contacts` are None if the model
        does not support these methods, or if `closed_form` is False.

    Raises:
        ValueError: the model lacks the agent's joints, actuators or touch sensor, or an object could collide or is not
            a mocap body.
    """

    def __init__(self, world: World, threads: int, closed_form: bool = True) -> None:
        model = _without_detours(world.model)
        self._model = model
        self._step_batch = BatchedStep(model, threads)
        self._columns = _Columns.from_model(model)
        self._actuators = as_slice([_actuator(model, joint) for joint in ("agent_x", "agent_y")])
        self._touch = _touch_columns(model)
        _check_objects(model, world.objects)
        self._start = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        mujoco.mj_getState(model, mujoco.MjData(model), self._start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        self.seconds = SUBSTEPS * model.opt.timestep
        self._due = self._start[0] + self.seconds  # time after an action
        agent = int(model.jnt_bodyid[_joint(model, "agent_x")])
        self.free_motion = free_motion_of(model, agent, self._untouched, MAX_SPEED) if closed_form else None
        self.local_contacts = local_contacts_of(world, model, self.free_motion, threads)

    def step(self, agents: Agents | WorldState, velocity: np.ndarray) -> Motion:
        """Move all agents by one action of 10 substeps.

        velocity: commanded velocity, which is constant during the action [m/s], (n, 2)
        """
        if self.free_motion is None:
            return self._simulate(agents, velocity)
        path, speed = self.free_motion(agents.velocity, velocity)
        in_reach, n = self.free_motion.obstacles_in_reach(agents.position, path), len(velocity)
        simulated = np.asarray(in_reach.any(axis=1))
        # Comparisons are also false for NaN, so that MuJoCo simulates these agents.
        if not (np.abs(velocity).max() <= self.free_motion.strongest and _slow(agents.velocity).all()):
            simulated |= ~(self.free_motion.obeys(velocity) & _slow(agents.velocity).all(axis=-1))
        (near,) = simulated.nonzero()
        if len(near) == n:
            return self._near(agents, velocity, in_reach)
        motion = Motion(agents.position[:, None] + path, speed, np.zeros(n, bool), np.zeros(n, bool))
        if len(near):
            motion.put(near, self._near(agents.take(near), velocity[near], in_reach[near]))
        return motion

    def _near(self, agents: Agents | WorldState, velocity: np.ndarray, in_reach: np.ndarray) -> Motion:
        """Simulate agents that may touch something, each in a small model of the geoms within its reach.

        An agent is simulated in the complete model of the world instead if the small model has no room for these geoms,
        if a contact deflects the agent to within reach of another geom, or if the simulation breaks down. If
        `local_contacts` is None, there are no small models, and all agents are simulated in the complete model.

        in_reach: obstacles within reach of each agent, (n, obstacle) bool
        """
        if self.local_contacts is None:
            return self._simulate(agents, velocity)
        few = self.local_contacts.few(in_reach)
        motion = self._motion(agents.position, *self.local_contacts.step(few, *self._start_of(agents, velocity)))
        strayed = self.local_contacts.strayed(agents.position, motion.path - agents.position[:, None], few)
        (again,) = (strayed | motion.unstable).nonzero()
        if len(again):
            motion.put(again, self._simulate(agents.take(again), velocity[again]))
        return motion

    def _simulate(self, agents: Agents | WorldState, velocity: np.ndarray) -> Motion:
        """Simulate the agents with MuJoCo in the complete model of the world, with all its geoms."""
        models = [self._model] * len(velocity)
        return self._motion(agents.position, *self._step_batch(models, *self._start_of(agents, velocity)))

    def _start_of(self, agents: Agents | WorldState, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return MuJoCo's initial states (n, ...), and its controls (n, substep, nu).

        The commanded velocity [m/s] (n, 2) is constant.
        """
        initial = self._initial(len(velocity))
        initial[:, self._columns.position] = agents.position - self._columns.origin
        initial[:, self._columns.heading] = agents.heading
        initial[:, self._columns.velocity] = agents.velocity
        return initial, self._control(velocity)

    def _initial(self, n: int) -> np.ndarray:
        initial = np.empty((n, len(self._start)))
        initial[:] = self._start
        return initial

    def _control(self, velocity: np.ndarray) -> np.ndarray:
        control = np.zeros((len(velocity), SUBSTEPS, self._model.nu))
        control[:, :, self._actuators] = velocity[:, None]
        return control

    def _untouched(
        self, speed: np.ndarray, command: np.ndarray, displacement: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return paths [m] and velocities [m/s] of agents, simulated by MuJoCo without contacts, (n, substep, 2) each.

        speed, command: initial and commanded velocities [m/s], (n, 2)
        displacement: displacements of the starting points from the agent's initial position [m], (n, 2)

        See `sim.physics.free_motion.FreeSteps`.
        """
        model = copy.copy(self._model)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        initial = self._initial(len(speed))
        initial[:, self._columns.position] += displacement
        initial[:, self._columns.velocity] = speed
        states, _ = BatchedStep(model, 1)([model] * len(speed), initial, self._control(command))
        path = states[:, :, self._columns.position] - initial[:, None, self._columns.position]
        return path, states[:, :, self._columns.velocity]

    def close(self) -> None:
        """Stop the thread pool."""
        self._step_batch.close()
        if self.local_contacts:
            self.local_contacts.close()

    def _motion(self, position: np.ndarray, states: np.ndarray, sensors: np.ndarray) -> Motion:
        path = states[:, :, self._columns.position] + self._columns.origin
        last = states[:, -1]
        velocity = last[:, self._columns.velocity].copy()
        contact = np.asarray((sensors[:, :, self._touch] > 0).reshape(len(states), -1).any(axis=1))
        # MuJoCo resets a world that broke down, so that its clock shows another time. This also happens after an
        # earlier state that is not finite.
        timely = np.abs(last[:, 0] - self._due) <= self._model.opt.timestep / 2
        if all_finite(last) and timely.all() and _slow(velocity).all():
            return Motion(path, velocity, contact, np.zeros(len(states), bool))
        unstable = ~(np.isfinite(last).all(axis=-1) & timely & _slow(velocity).all(axis=-1))
        path[unstable] = np.nan_to_num(position)[unstable, None]
        velocity = np.where(unstable[:, None], 0.0, velocity)
        return Motion(path, velocity, contact & ~unstable, unstable)


@dataclass(frozen=True)
class _Columns:
    """Columns of MuJoCo's full physics state that contain the agent's position, heading and velocity.

    origin: position of the agent at which its slide joints are zero [m], (2,)
    """

    position: slice | list[int]
    heading: int
    velocity: slice | list[int]
    origin: np.ndarray

    @classmethod
    def from_model(cls, model: mujoco.MjModel) -> _Columns:
        qpos = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_TIME)
        qvel = qpos + mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_QPOS)
        joints = [_joint(model, name) for name in ("agent_x", "agent_y", "agent_heading")]
        body = model.jnt_bodyid[joints[0]]
        return cls(
            position=as_slice([qpos + int(model.jnt_qposadr[j]) for j in joints[:2]]),
            heading=qpos + int(model.jnt_qposadr[joints[2]]),
            velocity=as_slice([qvel + int(model.jnt_dofadr[j]) for j in joints[:2]]),
            origin=model.body_pos[body, :2] - model.qpos0[[int(model.jnt_qposadr[j]) for j in joints[:2]]],
        )


def _slow(velocity: np.ndarray) -> np.ndarray:
    """Return a mask of the velocity components whose magnitude is below 100 m/s (UNSTABLE_SPEED); False for NaN."""
    slow: np.ndarray = np.abs(velocity) < UNSTABLE_SPEED
    return slow


def _without_detours(model: mujoco.MjModel) -> mujoco.MjModel:
    """Return the same model without two of MuJoCo's preparatory steps: islands and the midphase.

    These steps save time only if there are many contacts or, for the midphase, many geoms. Without them, simulating an
    agent at a wall takes a tenth to a fifth less time, and the results are bit-identical. The midphase remains enabled
    in models with more than 200 geoms.
    """
    lean = copy.copy(model)
    lean.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
    if model.ngeom <= FEW_GEOMS:
        lean.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE
    return lean


def _joint(model: mujoco.MjModel, name: str) -> int:
    joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
    if joint < 0:
        raise ValueError(f"the model has no joint {name!r}, which every agent needs")
    return joint


def _actuator(model: mujoco.MjModel, joint_name: str) -> int:
    joint = _joint(model, joint_name)
    driving = np.flatnonzero(
        (model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT) & (model.actuator_trnid[:, 0] == joint)
    )
    if len(driving) != 1:
        raise ValueError(f"joint {joint_name!r} has {len(driving)} actuators, needs one (velocity)")
    return int(driving[0])


def _touch_columns(model: mujoco.MjModel) -> slice | list[int]:
    touch = np.flatnonzero(model.sensor_type == mujoco.mjtSensor.mjSENS_TOUCH)
    if not len(touch):
        raise ValueError("the model has no touch sensor on the agent")
    return as_slice([int(model.sensor_adr[i]) for i in touch])


def _check_objects(model: mujoco.MjModel, names: tuple[str, ...]) -> None:
    for name in names:
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
        if body < 0 or model.body_mocapid[body] < 0:
            raise ValueError(f"object {name!r} is not a mocap body of the model")
        geoms = model.geom_bodyid == body
        if (model.geom_contype[geoms] | model.geom_conaffinity[geoms]).any():
            raise ValueError(f"object {name!r} can collide: must have no contacts, since physics moves only the agent")
