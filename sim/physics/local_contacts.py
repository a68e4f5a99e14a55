"""Physics among the few geoms that an agent could touch during one action, instead of among all of a world's.

MuJoCo poses every geom of a model in every substep and asks of each whether the agent is near it. What an agent does
at a wall depends on that wall alone, and so does each number of MuJoCo's that leads to it: bit for bit, but for the
order of several contacts in models of so many geoms that MuJoCo goes through a tree of them.
"""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from sim.physics.free_motion import FreeMotion
from sim.physics.mujoco_batch import BatchedStep
from sim.worlds.world import World

MOST = 1024  # models that are kept, 50 kB each; a maze has two or three hundred places that differ
_NOT_OF_A_SHAPE = ("geom_bodyid", "geom_dataid", "geom_matid", "geom_user")
_SHAPES = [
    getattr(mujoco.mjtGeom, f"mjGEOM_{shape}") for shape in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX")
]


class LocalContacts:
    """Models of the agent among some of a world's geoms, made when first asked for, and their steps.

    whole: the world's model, as it is stepped
    alone: its agent by itself (`sim.worlds.agent_model`)
    free_motion: knows what the agent can touch, and from where
    threads: of the steps, see `sim.physics.mujoco_batch`
    """

    def __init__(self, whole: mujoco.MjModel, alone: mujoco.MjModel, free_motion: FreeMotion, threads: int) -> None:
        self._alone = copy.copy(alone)
        self._alone.opt.disableflags = whole.opt.disableflags | mujoco.mjtDisableBit.mjDSBL_MIDPHASE
        for name in ("body_contype", "body_conaffinity", "body_margin"):  # of all geoms of the world's body together
            getattr(self._alone, name)[0] = getattr(whole, name)[0]
        self._whole, self._free_motion = whole, free_motion
        self._slots = np.flatnonzero(alone.geom_bodyid == 0)
        self._arrays = _arrays_of_geoms(alone)
        self._models: dict[bytes, mujoco.MjModel] = {}
        self._step = BatchedStep(self._alone, threads)

    def few(self, met: np.ndarray) -> np.ndarray:
        """The obstacles met (n, obstacle) bool; none where they are more than there is room for."""
        few: np.ndarray = met & (met.sum(axis=1, keepdims=True) <= len(self._slots))
        return few

    def step(self, few: np.ndarray, initial: np.ndarray, control: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Steps of each agent among these of the obstacles, (n, obstacle) bool: see `BatchedStep`."""
        if len(self._models) > MOST:
            self._models.clear()
        keys = [row.tobytes() for row in np.packbits(few, axis=1)]
        models = [self._models.get(key) or self._make(key, one) for key, one in zip(keys, few, strict=True)]
        return self._step(models, initial, control)

    def strayed(self, position: np.ndarray, path: np.ndarray, few: np.ndarray) -> np.ndarray:
        """Whether agents whose models had these `few` (n, obstacle) bool came within reach of another obstacle on their
        path from `position` (n, 2) [m], (n,) bool: turned aside by one thing, an agent can meet the next."""
        strayed: np.ndarray = (self._free_motion.met(position, path) & ~few).any(axis=1)
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
    """None where models of a part cannot stand for the whole: where agents have no free motion or nothing to touch,
    obstacles are on bodies of their own or of other shapes than MuJoCo's simple ones, more moves than the agent, or
    the world's model is not the one that it was compiled to. `whole`: that model, as it is stepped."""
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
