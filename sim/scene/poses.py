"""Poses of all elements in many worlds of one model, with sizes, colours and materials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any
from zlib import crc32

import mujoco
import numpy as np

from optics.numerics.arguments import is_sized, shown
from optics.numerics.number_types import full_precision, real_array
from optics.numerics.read_only import FULL_PRECISION
from optics.numerics.renamed import renamed

OF_MODELS = (
    "geom_size",
    "geom_rgba",
    "geom_matid",
    "mat_rgba",
    "mat_emission",
    "light_diffuse",
    "light_active",
    "heights",
    "others",
)
OTHERS = (  # other fields of mjModel that appearances depend on
    "geom_group",
    "geom_type",
    "geom_dataid",
    "mat_texid",
    "mat_texrepeat",
    "mat_texuniform",
    "light_type",
    "light_castshadow",
    "light_attenuation",
    "light_cutoff",
    "light_exponent",
)
HEADLIGHT = ("active", "diffuse")


@dataclass(frozen=True)
class Poses:
    """Positions [m] and directions, (world, element, 3), and rotations, (world, element, 3, 3), of elements of a model.

    The values are those of mjData after mj_forward. Only the precision of the arrays is checked.

    geom_xpos, geom_xmat, site_xpos, site_xmat, cam_xpos, cam_xmat: positions and rotations of geoms, sites and cameras
    xpos, xmat: positions and rotations of bodies
    light_xpos, light_xdir: positions and directions of lights

    The other arrays contain values of each world's mjModel. An array that is None is the same as in the renderer's
    model.

    geom_size, geom_rgba, geom_matid: sizes [m], colours and materials of geoms, (world, geom, 3), (world, geom, 4) and
        (world, geom)
    mat_rgba, mat_emission, light_diffuse, light_active: properties of materials and lights; the first axis is the world
    heights: a checksum of the heights of each height field, (world, hfield)
    others: a checksum of each other field of the model on which appearances depend, such as `geom_type` and the
        `diffuse` of the headlight, (world, field). The constants OTHERS and HEADLIGHT list the fields

    Raises:
        ValueError: an array has half precision or less.
    """

    geom_xpos: np.ndarray
    geom_xmat: np.ndarray
    site_xpos: np.ndarray
    site_xmat: np.ndarray
    cam_xpos: np.ndarray
    cam_xmat: np.ndarray
    xpos: np.ndarray
    xmat: np.ndarray
    light_xpos: np.ndarray
    light_xdir: np.ndarray
    geom_size: np.ndarray | None = None
    geom_rgba: np.ndarray | None = None
    geom_matid: np.ndarray | None = None
    mat_rgba: np.ndarray | None = None
    mat_emission: np.ndarray | None = None
    light_diffuse: np.ndarray | None = None
    light_active: np.ndarray | None = None
    heights: np.ndarray | None = None
    others: np.ndarray | None = None

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            # A simulation makes poses in every step, so common types take a short path.
            if type(value) is not np.ndarray or value.dtype.char not in FULL_PRECISION:
                full_precision(name, value)

    of = renamed("from_data")

    @classmethod
    def from_data(cls, datas: Sequence[mujoco.MjData] | mujoco.MjData) -> Poses:
        """Collect the poses of all worlds.

        datas: one mjData per world, after mj_forward or mj_step, or a single mjData for one world

        Raises:
            ValueError: there are no worlds, or `datas` contains anything other than mjData.
        """
        datas = [datas] if isinstance(datas, mujoco.MjData) else datas
        if not (is_sized(datas) and len(datas) and all(isinstance(data, mujoco.MjData) for data in datas)):
            raise ValueError(f"poses = {shown(datas)}: must be one MjData for each world, such as [data], or Poses")
        stacked = {name: np.array([getattr(data, name) for data in datas]) for name in OF_DATA}
        found = {name: _square(array) if name.endswith("mat") else array for name, array in stacked.items()}
        models = [data.model for data in datas]
        return cls(**found, **{name: of_models(models, name) for name in OF_MODELS})

    @classmethod
    def joined(cls, *parts: Poses) -> Poses:
        """Return one object with the worlds of all `parts`, one after the other. All worlds belong to one model."""
        found: dict[str, list[Any]] = {f.name: [getattr(part, f.name) for part in parts] for f in fields(cls)}
        joined: dict[str, Any] = {n: None if each[0] is None else np.concatenate(each) for n, each in found.items()}
        return cls(**joined)

    @property
    def n(self) -> int:
        """Number of worlds."""
        return len(self.geom_xpos)

    def geom_places(self, geoms: Sequence[int] | np.ndarray) -> np.ndarray:
        """Return the centres of these geoms [m], (world, geom, 3). The result may share memory with the poses."""
        return self.geom_xpos[:, geoms]

    def geom_turns(self, geoms: Sequence[int] | np.ndarray) -> np.ndarray:
        """Return the rotations of these geoms, (world, geom, 3, 3).

        The result may share memory with the poses. If no geom turns, the result may have the shape (1, geom, 3, 3), and
        every call may return the same array.
        """
        return self.geom_xmat[:, geoms]

    def take(self, worlds: np.ndarray) -> Poses:
        """Return the poses of the worlds with these indices, in this order; IndexError for an unknown world."""
        arrays: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(self)}
        taken: dict[str, Any] = {name: None if array is None else array[worlds] for name, array in arrays.items()}
        return Poses(**taken)

    def frames(self, kind: str, index: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the origins [m], (world, 3), and rotations, (world, 3, 3), of a site, a camera or a body.

        kind, index: "site", "camera" or "body", and its id

        Raises:
            KeyError: the kind is unknown.
            IndexError: the model has no element with this id.
        """
        name = {"site": "site_x", "camera": "cam_x", "body": "x"}[kind]
        return getattr(self, f"{name}pos")[:, index], getattr(self, f"{name}mat")[:, index]


def world_indices(name: str, worlds: Any, n: int) -> np.ndarray:
    """Return indices of worlds as an array, (k,) int; ValueError unless all are whole numbers from 0 to n - 1."""
    given = real_array(name, worlds)
    found = np.atleast_1d(np.array(math.nan) if given is None else given)
    found = found if found.size else found.astype(int)
    if found.ndim != 1 or found.dtype.kind not in "iu" or ((found < 0) | (found >= n)).any():
        raise ValueError(f"{name} = {shown(worlds)}: must be numbers of worlds, from 0 to {n - 1}")
    return found


OF_DATA = tuple(f.name for f in fields(Poses) if f.name not in OF_MODELS)


def of_models(models: Sequence[mujoco.MjModel], name: str) -> np.ndarray:
    """Return the field `name`, one of OF_MODELS, from the current state of these models, (world, ...)."""
    if all(model is models[0] for model in models):
        field = of_model(models[0], name).copy()  # copied, since the model may be changed later
        # This takes a quarter of the time of np.broadcast_to.
        return np.ndarray((len(models), *field.shape), field.dtype, field, strides=(0, *field.strides))
    return np.stack([of_model(model, name) for model in models])


def of_model(model: mujoco.MjModel, name: str) -> np.ndarray:
    """Return the field `name`, one of OF_MODELS, from the current state of a model."""
    if name == "heights":
        return _heights(model)
    if name == "others":
        return _others(model)
    found: np.ndarray = getattr(model, name)
    return found


def _heights(model: mujoco.MjModel) -> np.ndarray:
    if not model.nhfield:
        return np.zeros(0, np.uint32)
    sizes = zip(model.hfield_adr, model.hfield_nrow * model.hfield_ncol, strict=True)
    return np.array([crc32(model.hfield_data[start : start + size]) for start, size in sizes], np.uint32)


def _others(model: mujoco.MjModel) -> np.ndarray:
    headlight = model.vis.headlight
    lamp = [crc32(np.asarray(getattr(headlight, name), np.float32).tobytes()) for name in HEADLIGHT]
    return np.array([*(crc32(getattr(model, name)) for name in OTHERS), *lamp], np.uint32)


def _square(rows: np.ndarray) -> np.ndarray:
    return rows.reshape(*rows.shape[:2], 3, 3)
