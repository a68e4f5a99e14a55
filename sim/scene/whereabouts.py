"""Where data had everything at one moment, whatever is simulated with it since."""

from __future__ import annotations

from dataclasses import dataclass, fields

import mujoco
import numpy as np


@dataclass(frozen=True)
class Whereabouts:
    """Copies of what mjData calls so: positions [m] (n, 3), directions (n, 3) and rotations (n, 9)."""

    geom_xpos: np.ndarray
    geom_xmat: np.ndarray
    cam_xpos: np.ndarray
    cam_xmat: np.ndarray
    light_xpos: np.ndarray
    light_xdir: np.ndarray

    @classmethod
    def of(cls, data: mujoco.MjData) -> Whereabouts:
        """As they are now."""
        return cls(**{field.name: getattr(data, field.name).copy() for field in fields(cls)})
