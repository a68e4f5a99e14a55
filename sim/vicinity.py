"""Physics among the few geoms that an agent could touch during one action, instead of among all of a world's.

MuJoCo poses every geom of a model in every substep and asks of each whether the agent is near it. What an agent does
at a wall depends on that wall alone, and so does each number of MuJoCo's that leads to it: bit for bit.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence

import mujoco
import numpy as np

from sim.glide import Glide

_NOT_OF_A_SHAPE = ("geom_bodyid", "geom_dataid", "geom_matid")  # ids of what the small model has none of
_SHAPES = [
    getattr(mujoco.mjtGeom, f"mjGEOM_{shape}") for shape in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX")
]


class Vicinity:
    """Models of the agent among some of a world's geoms, made when first asked for.

    whole  the world's model · alone: its agent by itself, as `sim.world.agent_alone` makes it
    glide  knows what the agent can touch, and from where
    room   for so many geoms at once
    """

    def __init__(self, whole: mujoco.MjModel, alone: mujoco.MjModel, glide: Glide) -> None:
        self.alone = copy.copy(alone)
        self.alone.opt.disableflags = whole.opt.disableflags
        for name in ("body_contype", "body_conaffinity", "body_margin"):  # of all geoms of the world's body together
            getattr(self.alone, name)[0] = getattr(whole, name)[0]
        self._whole, self.glide = whole, glide
        self._slots = np.flatnonzero(alone.geom_bodyid == 0)
        self.room = len(self._slots)
        self._arrays = _arrays_of_geoms(alone)
        self._models: dict[bytes, mujoco.MjModel] = {}

    def few(self, met: np.ndarray) -> np.ndarray:
        """As many of the obstacles met (n, obstacle) bool as there is room for."""
        few: np.ndarray = met & (met.cumsum(axis=1) <= self.room)
        return few

    def models(self, few: np.ndarray) -> Sequence[mujoco.MjModel]:
        """For each world the agent among these of the obstacles; (n, obstacle) bool, no more than there is room for."""
        keys = [row.tobytes() for row in np.packbits(few, axis=1)]
        return [self._models.get(key) or self._make(key, one) for key, one in zip(keys, few, strict=True)]

    def strayed(self, position: np.ndarray, path: np.ndarray, few: np.ndarray) -> np.ndarray:
        """Whether agents whose models had these `few` (n, obstacle) bool came within reach of another obstacle on their
        path from `position` (n, 2) [m], (n,) bool: turned aside by one thing, an agent can meet the next."""
        strayed: np.ndarray = (self.glide.met(position, path) & ~few).any(axis=1)
        return strayed

    def _make(self, key: bytes, few: np.ndarray) -> mujoco.MjModel:
        model, geoms = copy.copy(self.alone), self.glide.obstacles[few]
        for name in self._arrays:
            getattr(model, name)[self._slots[: len(geoms)]] = getattr(self._whole, name)[geoms]
        self._models[key] = model
        return model


def vicinity_of(whole: mujoco.MjModel, alone: mujoco.MjModel | None, glide: Glide | None) -> Vicinity | None:
    """None where models of a part cannot stand for the whole: where agents do not glide, obstacles are on bodies of
    their own or of other shapes than MuJoCo's simple ones, or there is more that moves than the agent."""
    if alone is None or glide is None:
        return None
    still = (whole.geom_bodyid[glide.obstacles] == 0).all() and np.isin(whole.geom_type[glide.obstacles], _SHAPES).all()
    sizes = ("nq", "nv", "na", "nu", "nsensordata", "njnt")
    same = all(getattr(whole, size) == getattr(alone, size) for size in sizes)
    return Vicinity(whole, alone, glide) if still and same else None


def _arrays_of_geoms(model: mujoco.MjModel) -> list[str]:
    names = [name for name in dir(model) if name.startswith("geom_") and name not in _NOT_OF_A_SHAPE]
    return [name for name in names if np.shape(getattr(model, name))[:1] == (model.ngeom,)]
