"""Copy of the poses of geoms, cameras and lights in mjData at one moment, independent of later simulation."""

from __future__ import annotations

from dataclasses import dataclass, fields

import mujoco
import numpy as np

from optics.numerics.arguments import of_kind


@dataclass(frozen=True)
class PoseSnapshot:
    """Copies of some fields of mjData: positions [m] (n, 3), directions (n, 3) and rotations (n, 9)."""

    geom_xpos: np.ndarray
    geom_xmat: np.ndarray
    cam_xpos: np.ndarray
    cam_xmat: np.ndarray
    light_xpos: np.ndarray
    light_xdir: np.ndarray

    @classmethod
    def from_data(cls, data: mujoco.MjData) -> PoseSnapshot:
        """Return copies of the current poses."""
        return cls(**{field.name: getattr(data, field.name).copy() for field in fields(cls)})


def checked_data(model: mujoco.MjModel, data: mujoco.MjData) -> mujoco.MjData:
    """Return the data if they fit this model and contain finite poses of all geoms; otherwise raise a ValueError."""
    of_kind("mirror: data", data, mujoco.MjData, "mujoco.MjData(model)")
    if data.geom_xpos.shape != (model.ngeom, 3) or data.xpos.shape != (model.nbody, 3):
        raise ValueError(
            f"mirror: data has {len(data.geom_xpos)} geoms and {len(data.xpos)} bodies, but the model has "
            f"{model.ngeom} and {model.nbody}"
        )
    if not data.geom_xmat.any():
        raise ValueError("mirror: data contains no poses yet; call mujoco.mj_forward(model, data) first")
    lost = ~(np.isfinite(data.geom_xpos).all(axis=1) & np.isfinite(data.geom_xmat).all(axis=1))
    if lost.any():
        name = model.geom(int(np.argmax(lost))).name or str(int(np.argmax(lost)))
        raise ValueError(f"mirror: geom {name!r} has no finite position; the simulation is unstable, reset its data")
    return data
