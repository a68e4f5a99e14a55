"""Where bodies and eyes were during an episode in a task of somebody's own."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from sim.eyes.mounts import Mount
from sim.scene.poses import Poses
from sim.scene.solids import Solid

__all__ = ["FilmedScene"]


@dataclass(frozen=True)
class FilmedScene:
    """Lengths [m] and rotations in the world, before each action.

    solids: all geoms that are seen, in the frames of their bodies, as they were at the episode's beginning
    bodies: names, or "body_<id>" of those that have none
    positions (t, body, 3), rotations (t, body, 3, 3)
    eye_positions (t, eye, 3): pupils · eye_rotations (t, eye, 3, 3), columns (right, up, ahead)
    path (t, 3): of what the animal's first eye is on
    """

    solids: tuple[Solid, ...]
    bodies: tuple[str, ...]
    positions: np.ndarray
    rotations: np.ndarray
    eye_positions: np.ndarray
    eye_rotations: np.ndarray
    path: np.ndarray

    @classmethod
    def of(
        cls,
        model: mujoco.MjModel,
        solids: tuple[Solid, ...],
        poses: Poses,
        mount: Mount,
        eyes: tuple[np.ndarray, np.ndarray],
    ) -> FilmedScene:
        """poses: of every time, in the place of worlds · mount: of the first eye · eyes: their positions and
        rotations."""
        return cls(
            solids=solids,
            bodies=tuple(model.body(i).name or f"body_{i}" for i in range(model.nbody)),
            positions=poses.xpos,
            rotations=poses.xmat,
            eye_positions=eyes[0],
            eye_rotations=eyes[1],
            path=poses.frames(*mount.found_in(model))[0],
        )
