"""Where everything in many worlds of one model is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import mujoco
import numpy as np


@dataclass(frozen=True)
class Poses:
    """Positions [m] (world, thing, 3) and rotations (world, thing, 3, 3) as mjData has them after mj_forward.

    geom_xpos, geom_xmat, site_xpos, site_xmat, cam_xpos, cam_xmat, xpos, xmat (of bodies) · light_xpos, light_xdir
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

    @classmethod
    def of(cls, datas: Sequence[mujoco.MjData]) -> Poses:
        """Of as many worlds as there are data."""
        stacked = {f.name: np.stack([getattr(data, f.name) for data in datas]) for f in fields(cls)}
        return cls(**{name: _square(array) if name.endswith("mat") else array for name, array in stacked.items()})

    @classmethod
    def joined(cls, *parts: Poses) -> Poses:
        """The worlds of all of them, one after the other."""
        return cls(**{f.name: np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)})

    @property
    def n(self) -> int:
        """Number of worlds."""
        return len(self.geom_xpos)

    def frames(self, kind: str, index: int) -> tuple[np.ndarray, np.ndarray]:
        """Origins (world, 3) and rotations (world, 3, 3) of a site, a camera or a body."""
        name = {"site": "site_x", "camera": "cam_x", "body": "x"}[kind]
        return getattr(self, f"{name}pos")[:, index], getattr(self, f"{name}mat")[:, index]


def _square(rows: np.ndarray) -> np.ndarray:
    return rows.reshape(*rows.shape[:2], 3, 3)
