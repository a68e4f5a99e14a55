"""Physics in small models, with only the geoms that an agent could touch during one action.

In every substep, MuJoCo updates the poses of all geoms of a model and tests each of them for contacts. The motion of an
agent at a wall depends only on this wall, so all other geoms can be omitted. MuJoCo then computes the motion from the
same numbers, and the results are bit-identical. The only exception is the order of several contacts in models that are
large enough for MuJoCo to use a tree of bounding volumes.
"""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from sim.physics.free_motion import FreeMotion
from sim.physics.mujoco_batch import BatchedStep
from sim.worlds.world import World

# Largest number of cached models, 50 kB each. A maze has two or three hundred places with different geoms within reach.
MOST = 1024
_NOT_OF_A_SHAPE = ("geom_bodyid", "geom_dataid", "geom_matid", "geom_user")
_SHAPES = [
    getattr(mujoco.mjtGeom, f"mjGEOM_{shape}") for shape in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX")
]


class LocalContacts:
    """Small models that contain the agent and only a few of a world's geoms. They are built on demand and cached.

    whole: the world's complete model
    alone: the model of the agent without the walls and objects of its world (`sim.worlds.agent_model`)
    free_motion: the obstacles, and the largest distance of the agent's centre from an obstacle when the two may touch
    threads: number of threads for MuJoCo's batched step of 128 or more worlds
    """

    def __init__(self, whole: mujoco.MjModel, alone: mujoco.MjModel, free_motion: FreeMotion, threads: int) -> None:
        self._alone = copy.copy(alone)
        self._alone.opt.disableflags = whole.opt.disableflags | mujoco.mjtDisableBit.mjDSBL_MIDPHASE
        # These fields summarise all geoms that belong to MuJoCo's world body.
        for name in ("body_contype", "body_conaffinity", "body_margin"):
            getattr(self._alone, name)[0] = getattr(whole, name)[0]
        self._whole, self._free_motion = whole, free_motion
        self._slots = np.flatnonzero(alone.geom_bodyid == 0)
        self._arrays = _arrays_of_geoms(alone)
        self._models: dict[bytes, mujoco.MjModel] = {}
        self._step = BatchedStep(self._alone, threads)

    def few(self, in_reach: np.ndarray) -> np.ndarray:
        """Return the mask of the obstacles that each agent's small model contains, (agent, obstacle) bool.

        Each agent is simulated in a small model, which contains only the agent and all obstacles within its reach. The
        model has room for only 4 obstacles (`sim.worlds.agent_model.ROOM`). If more are within reach, it contains none.

        in_reach: True for the obstacles within reach of each agent, (agent, obstacle) bool
        """
        few: np.ndarray = in_reach & (in_reach.sum(axis=1, keepdims=True) <= len(self._slots))
        return few

    def step(self, few: np.ndarray, initial: np.ndarray, control: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Step each agent in its own small model; return states and sensor values after each step, (agent, step, ...).

        few: True for the obstacles that an agent's small model contains, (agent, obstacle) bool
        initial, control: state before the first step, and controls in each step, see `BatchedStep`
        """
        if len(self._models) > MOST:
            self._models.clear()
        packed = np.packbits(few, axis=1)
        bits, width = packed.tobytes(), packed.shape[1]
        keys = [bits[start : start + width] for start in range(0, len(bits), width)]
        models = [self._models.get(key) or self._make(key, few[agent]) for agent, key in enumerate(keys)]
        return self._step(models, initial, control)

    def strayed(self, position: np.ndarray, path: np.ndarray, few: np.ndarray) -> np.ndarray:
        """Return whether each agent came within reach of an obstacle that its small model lacks, (n,) bool.

        The agent is simulated in a small model. Of the obstacles, this model contains only those that would be within
        reach on the path that the agent takes if it touches nothing. One of these may deflect the agent towards another
        obstacle.

        position: positions at the beginning (n, 2) [m]
        path: positions after each substep, relative to `position` (n, substep, 2) [m]
        few: True for the obstacles that an agent's small model contains, (n, obstacle) bool
        """
        strayed: np.ndarray = (self._free_motion.obstacles_in_reach(position, path) & ~few).any(axis=1)
        return strayed

    def close(self) -> None:
        """Stop the threads."""
        self._step.close()

    def _make(self, key: bytes, few: np.ndarray) -> mujoco.MjModel:
        model, geoms = copy.copy(self._alone), self._free_motion.obstacles[few]
        for name in self._arrays:
            getattr(model, name)[self._slots[: len(geoms)]] = getattr(self._whole, name)[geoms]
        self._models[key] = model
        return model


def local_contacts_of(
    world: World, whole: mujoco.MjModel, free_motion: FreeMotion | None, threads: int
) -> LocalContacts | None:
    """Return the small models that simulate contacts of a world's agent; None if they cannot replace the whole model.

    A small model contains only the agent and the few obstacles near it. Small models cannot replace the whole model if
    `free_motion` is None or names no obstacles, or if the whole model has joints, actuators or sensors besides those of
    the agent. Every obstacle must be a simple primitive that is fixed to the world, and the world's model must not have
    been changed since it was compiled.

    whole: the world's complete model
    """
    alone = world.alone
    if alone is None or free_motion is None or not len(free_motion.obstacles) or not alone.stands_for(world.model):
        return None
    obstacles = free_motion.obstacles
    still = (whole.geom_bodyid[obstacles] == 0).all() and np.isin(whole.geom_type[obstacles], _SHAPES).all()
    same = all(_state_size(whole, kind) == _state_size(alone.model, kind) for kind in ("FULLPHYSICS", "CTRL"))
    same &= whole.nsensordata == alone.model.nsensordata
    return LocalContacts(whole, alone.model, free_motion, threads) if still and same else None


def _state_size(model: mujoco.MjModel, kind: str) -> int:
    size: int = mujoco.mj_stateSize(model, getattr(mujoco.mjtState, f"mjSTATE_{kind}"))
    return size


def _arrays_of_geoms(model: mujoco.MjModel) -> list[str]:
    names = [name for name in dir(model) if name.startswith("geom_") and name not in _NOT_OF_A_SHAPE]
    return [name for name in names if np.shape(getattr(model, name))[:1] == (model.ngeom,)]
