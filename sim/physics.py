"""The batched MuJoCo step: every world one action further, on as many threads as this process owns.

The agent is a heavy body on two slide joints driven by velocity actuators; its heading is set, not simulated.
Objects are mocap bodies that collide with nothing, so that physics need not know where they are. Agents that surely
touch nothing during the action glide (`sim.glide`); the others' worlds are MuJoCo's.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import mujoco
import mujoco.rollout
import numpy as np

from sim.glide import glide_of
from sim.state import WorldState
from sim.world import MAX_SPEED, World

SUBSTEPS = 10  # of the model's timestep per action
UNSTABLE_SPEED = 10 * MAX_SPEED  # [m/s]: no actuator can do that
FEW_GEOMS = 200  # so few are sooner gone through one by one than by MuJoCo's tree of boxes


@dataclass(frozen=True)
class Motion:
    """One action's motion of the agents.

    path      at the end of each substep [m], (n, substep, 2) · velocity at the last [m/s], (n, 2)
    contact   touched anything in any substep, (n,) bool
    unstable  the simulation broke down: path and velocity are the last good ones, (n,) bool
    """

    path: np.ndarray
    velocity: np.ndarray
    contact: np.ndarray
    unstable: np.ndarray


class Physics:
    """Batched physics of one world's model.

    threads  of MuJoCo's batched step
    gliding  whether agents out of reach of everything move in closed form (`.glide`: how, None where they cannot)

    Raises ValueError for a model without the agent's joints, actuators and touch sensor, and for objects that
    could collide.
    """

    def __init__(self, world: World, threads: int, gliding: bool = True) -> None:
        model = _without_detours(world.model)
        self._model = model
        self._data = [mujoco.MjData(model) for _ in range(max(threads, 1))]
        self._rollout = mujoco.rollout.Rollout(nthread=threads if threads > 1 else 0)
        self._columns = _Columns.of(model)
        self._actuators = [_actuator(model, joint) for joint in ("agent_x", "agent_y")]
        self._touch = _touch_columns(model)
        _check_objects(model, world.objects)
        self._start = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        mujoco.mj_getState(model, self._data[0], self._start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        self.seconds = SUBSTEPS * model.opt.timestep
        agent = int(model.jnt_bodyid[_joint(model, "agent_x")])
        self.glide = glide_of(model, agent, self._untouched, MAX_SPEED) if gliding else None

    def step(self, state: WorldState, velocity: np.ndarray) -> Motion:
        """One action: SUBSTEPS with the commanded velocity [m/s] (n, 2) held."""
        if self.glide is None:
            return self._simulate(state, velocity)
        path, speed = self.glide(state.velocity, velocity)
        free = self.glide.touches_nothing(state.position, path, velocity)
        free &= (np.abs(state.velocity) < UNSTABLE_SPEED).all(axis=-1)  # false for NaN: MuJoCo says what comes of it
        motion = Motion(state.position[:, None] + path, speed, np.zeros(state.n, bool), np.zeros(state.n, bool))
        near = np.flatnonzero(~free)
        if len(near):
            simulated = self._simulate(state.take(near), velocity[near])
            for name, array in vars(motion).items():
                array[near] = getattr(simulated, name)
        return motion

    def _simulate(self, state: WorldState, velocity: np.ndarray) -> Motion:
        initial = self._initial(state.n)
        initial[:, self._columns.position] = state.position - self._columns.origin
        initial[:, self._columns.heading] = state.heading
        initial[:, self._columns.velocity] = state.velocity
        return self._motion(state, *self._rollout.rollout(self._model, self._data, initial, self._control(velocity)))

    def _initial(self, n: int) -> np.ndarray:
        return np.repeat(self._start[None], n, axis=0)

    def _control(self, velocity: np.ndarray) -> np.ndarray:
        control = np.zeros((len(velocity), SUBSTEPS, self._model.nu))
        control[:, :, self._actuators] = velocity[:, None]
        return control

    def _untouched(
        self, speed: np.ndarray, command: np.ndarray, displacement: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """What MuJoCo makes of speeds and commands (n, 2) with contacts off: see sim.glide.Run."""
        model = copy.copy(self._model)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        initial = self._initial(len(speed))
        initial[:, self._columns.position] += displacement
        initial[:, self._columns.velocity] = speed
        data = [mujoco.MjData(model)]
        states, _ = mujoco.rollout.Rollout(nthread=0).rollout(model, data, initial, self._control(command))
        path = states[:, :, self._columns.position] - initial[:, None, self._columns.position]
        return path, states[:, :, self._columns.velocity]

    def close(self) -> None:
        """Stop the thread pool."""
        self._rollout.close()

    def _motion(self, state: WorldState, states: np.ndarray, sensors: np.ndarray) -> Motion:
        path = states[:, :, self._columns.position] + self._columns.origin
        velocity = states[:, -1, self._columns.velocity]
        # MuJoCo resets a world that broke down, and its clock with it.
        due = self._start[0] + self.seconds
        unstable = ~np.isfinite(states[:, -1]).all(axis=-1)  # an earlier state that is not sets the clock back
        unstable |= np.abs(states[:, -1, 0] - due) > self._model.opt.timestep / 2
        unstable |= ~(np.abs(velocity) < UNSTABLE_SPEED).all(axis=-1)
        contact = np.asarray((sensors[:, :, self._touch] > 0).any(axis=(1, 2)))
        if unstable.any():
            path[unstable] = np.nan_to_num(state.position)[unstable, None]
            velocity = np.where(unstable[:, None], 0.0, velocity)
            contact = contact & ~unstable
        return Motion(path, velocity, contact, unstable)


@dataclass(frozen=True)
class _Columns:
    """Where the agent is in MuJoCo's full physics state, and where its slide joints are zero [m]."""

    position: list[int]
    heading: int
    velocity: list[int]
    origin: np.ndarray

    @classmethod
    def of(cls, model: mujoco.MjModel) -> _Columns:
        qpos = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_TIME)
        qvel = qpos + mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_QPOS)
        joints = [_joint(model, name) for name in ("agent_x", "agent_y", "agent_heading")]
        body = model.jnt_bodyid[joints[0]]
        return cls(
            position=[qpos + int(model.jnt_qposadr[j]) for j in joints[:2]],
            heading=qpos + int(model.jnt_qposadr[joints[2]]),
            velocity=[qvel + int(model.jnt_dofadr[j]) for j in joints[:2]],
            origin=model.body_pos[body, :2] - model.qpos0[[int(model.jnt_qposadr[j]) for j in joints[:2]]],
        )


def _without_detours(model: mujoco.MjModel) -> mujoco.MjModel:
    """The same model, without two of MuJoCo's preparations that pay only where much is in contact: a tenth to a fifth
    of an agent's time at a wall, and the same motion bit for bit."""
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


def _touch_columns(model: mujoco.MjModel) -> list[int]:
    touch = np.flatnonzero(model.sensor_type == mujoco.mjtSensor.mjSENS_TOUCH)
    if not len(touch):
        raise ValueError("the model has no touch sensor on the agent")
    return [int(model.sensor_adr[i]) for i in touch]


def _check_objects(model: mujoco.MjModel, names: tuple[str, ...]) -> None:
    for name in names:
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
        if body < 0 or model.body_mocapid[body] < 0:
            raise ValueError(f"object {name!r} is not a mocap body of the model")
        geoms = model.geom_bodyid == body
        if (model.geom_contype[geoms] | model.geom_conaffinity[geoms]).any():
            raise ValueError(f"object {name!r} collides; physics moves the agent alone")
