"""Copy of all poses in mjData at one moment, independent of later simulation."""

from __future__ import annotations

from dataclasses import dataclass, fields

import mujoco
import numpy as np


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
