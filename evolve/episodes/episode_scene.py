"""EpisodeScene: shapes and poses of bodies, and poses of eyes, during an episode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from sim.eyes.mounts import Mount
from sim.scene.poses import Poses
from sim.scene.solids import Solid

__all__ = ["EpisodeScene"]


@dataclass(frozen=True)
class EpisodeScene:
    """Bodies and eyes of an episode, with their poses before each action, in world coordinates [m].

    solids: all visible geoms, in the frames of their bodies, with their appearance at the start of the episode
    bodies: names of the bodies; "body_<id>" for a body without a name
    positions (t, body, 3), rotations (t, body, 3, 3): poses of the bodies
    eye_positions (t, eye, 3): positions of the pupils
    eye_rotations (t, eye, 3, 3): frames of the eyes, with columns (right, up, ahead)
    path (t, 3): position of the animal: the position of the body, site or camera that carries the animal's first eye
    headings (t,): heading of the animal from the world's x axis [rad]
    """

    solids: tuple[Solid, ...]
    bodies: tuple[str, ...]
    positions: np.ndarray
    rotations: np.ndarray
    eye_positions: np.ndarray
    eye_rotations: np.ndarray
    path: np.ndarray
    headings: np.ndarray

    @classmethod
    def from_poses(
        cls, model: mujoco.MjModel, solids: tuple[Solid, ...], poses: Poses, mounts: Sequence[Mount]
    ) -> EpisodeScene:
        """Return the scene of an episode.

        model: MuJoCo model of the world
        solids: visible geoms of the model
        poses: poses before each action; their first axis is time instead of worlds
        mounts: position and direction of each eye
        """
        places, frames = zip(*(_eye(model, mount, poses) for mount in mounts), strict=True)
        kind, index = mounts[0].found_in(model)
        path, turned = poses.frames(kind, index)
        ahead = turned @ replace(mounts[0], azimuth_deg=0.0, elevation_deg=0.0, roll_deg=0.0).local(kind)[1][:, 2]
        return cls(
            solids=solids,
            bodies=tuple(model.body(i).name or f"body_{i}" for i in range(model.nbody)),
            positions=poses.xpos,
            rotations=poses.xmat,
            eye_positions=np.stack(places, axis=1),
            eye_rotations=np.stack(frames, axis=1),
            path=path,
            headings=np.arctan2(ahead[:, 1], ahead[:, 0]),
        )


def _eye(model: mujoco.MjModel, mount: Mount, poses: Poses) -> tuple[np.ndarray, np.ndarray]:
    """Return the position of an eye's pupil (t, 3) [m] and its frame (t, 3, 3) in world coordinates."""
    kind, index = mount.found_in(model)
    origin, turned = poses.frames(kind, index)
    place, frame = mount.local(kind)
    return origin + turned @ place, turned @ frame
