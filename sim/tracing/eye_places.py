"""Positions of a model's eyes: as frames in the world, or relative to one body that stays upright."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from sim.eyes.mounts import Mount
from sim.scene.poses import Poses

ROUNDING = 1e-9  # largest rounding error of rotations and of lengths [m] in a compiled model
_SLIDE, _HINGE = int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)


class NotLevelError(ValueError):
    """The eyes are not all fixed to the same body, or this body may tilt or change its height.

    The message states the reason.
    """


class EyeFrames(NamedTuple):
    """Positions and orientations of all eyes in all worlds.

    origins: pupils [m], (world, eye, 3)
    rotations: columns (right, up, ahead), (world, eye, 3, 3)
    """

    origins: np.ndarray
    rotations: np.ndarray


@dataclass(frozen=True)
class LevelStand:
    """Eyes that are fixed to one body, which moves and turns only in a horizontal plane.

    body: id of the body
    height: height of the body's origin [m]
    origins: pupils in the body's frame [m], (eye, 3)
    rotations: eyes' frames in the body's frame, (eye, 3, 3)
    """

    body: int
    height: float
    origins: np.ndarray
    rotations: np.ndarray

    @property
    def heights(self) -> np.ndarray:
        """Heights of the pupils in the world [m], (eye,)."""
        return self.height + self.origins[:, 2]

    @property
    def radius(self) -> float | None:
        """Common distance of all pupils from the body's vertical axis [m].

        It is None if the distance differs between eyes or is 0, if an eye is not upright, or if an eye does not look
        straight away from the axis.
        """
        level, axes = self.origins[:, :2], self.rotations[:, :, 2]
        radii = np.linalg.norm(level, axis=1)
        if not self.is_upright or radii.min() <= ROUNDING or np.ptp(radii) > ROUNDING:
            return None
        outwards = np.abs(level / radii[:, None] - axes[:, :2]).max() < ROUNDING
        return float(radii[0]) if outwards else None

    @property
    def is_upright(self) -> bool:
        """True if all eyes look along the horizon, with their tops up."""
        return bool(np.abs(self.rotations[:, :, 1] - [0, 0, 1]).max() < ROUNDING)


class EyePlaces:
    """Positions of eyes that are mounted on a model.

    mounts: one for each eye

    Raises:
        ValueError: there is no mount, or the model lacks the part on which an eye is mounted.
    """

    def __init__(self, model: mujoco.MjModel, mounts: Sequence[Mount]) -> None:
        self.mounts = tuple(mounts)
        if not self.mounts:
            raise ValueError("mounts = []: must contain at least one sim.Mount")
        self._model, self._things = model, [mount.found_in(model) for mount in self.mounts]
        self._locals = [mount.local(kind) for mount, (kind, _) in zip(self.mounts, self._things, strict=True)]

    def __len__(self) -> int:
        return len(self.mounts)

    def frames(self, poses: Poses) -> EyeFrames:
        """Return the positions and orientations of the eyes in all worlds."""
        origins, rotations = np.empty((poses.n, len(self), 3)), np.empty((poses.n, len(self), 3, 3))
        for k, ((kind, index), (offset, turn)) in enumerate(zip(self._things, self._locals, strict=True)):
            origin, rotation = poses.frames(kind, index)
            origins[:, k] = origin + rotation @ offset
            rotations[:, k] = rotation @ turn
        return EyeFrames(origins, rotations)

    def stand(self) -> LevelStand:
        """Return the body that the eyes are fixed to, with the eyes' positions on it.

        Raises:
            NotLevelError: the eyes are on several bodies, on a body that may tilt or change its height, or on a camera
                that follows something.
        """
        bodies = {self._body_of(kind, index) for kind, index in self._things}
        if len(bodies) > 1:
            raise NotLevelError("the eyes are on several bodies")
        (body,) = bodies
        data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, data)
        self._require_level(body, data)
        parts = [self._in_body(number, body, data) for number in range(len(self))]
        origins, rotations = (np.stack(part) for part in zip(*parts, strict=True))
        return LevelStand(body, float(data.xpos[body, 2]), origins, rotations)

    def _body_of(self, kind: str, index: int) -> int:
        model = self._model
        if kind == "camera" and int(model.cam_mode[index]) != int(mujoco.mjtCamLight.mjCAMLIGHT_FIXED):
            raise NotLevelError(f"camera {model.camera(index).name!r} follows something")
        return int({"site": model.site_bodyid, "camera": model.cam_bodyid}[kind][index]) if kind != "body" else index

    def _in_body(self, number: int, body: int, data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray]:
        """Return an eye's position (that of its pupil) [m], (3,), and its frame, (3, 3), in the body's frame."""
        (kind, index), (offset, turn) = self._things[number], self._locals[number]
        if kind == "body":
            return offset, turn
        places, turns = (data.site_xpos, data.site_xmat) if kind == "site" else (data.cam_xpos, data.cam_xmat)
        to_body = data.xmat[body].reshape(3, 3).T
        origin = to_body @ (places[index] - data.xpos[body])
        rotation = to_body @ turns[index].reshape(3, 3)
        return origin + rotation @ offset, rotation @ turn

    def _require_level(self, body: int, data: mujoco.MjData) -> None:
        """Refuse a body that may tilt or change its height.

        All joints between the world and the body must move it in a horizontal plane or turn it about z.
        """
        model, name = self._model, self._model.body(body).name
        if abs(data.xmat[body].reshape(3, 3)[2, 2] - 1) > ROUNDING:
            raise NotLevelError(f"the eyes are on body {name!r}, which is tilted")
        while body > 0:
            if model.body_mocapid[body] >= 0:
                raise NotLevelError(f"the eyes are on body {name!r}, which may tilt: it is a mocap body")
            first = model.body_jntadr[body]
            for joint in range(first, first + model.body_jntnum[body]):
                self._require_level_joint(joint, data.xaxis[joint], name)
            body = int(model.body_parentid[body])

    def _require_level_joint(self, joint: int, axis: np.ndarray, name: str) -> None:
        kind, said = int(self._model.jnt_type[joint]), f"by joint {self._model.joint(joint).name or joint!r}"
        if kind == _SLIDE:
            if abs(axis[2]) > ROUNDING:
                raise NotLevelError(f"the eyes are on body {name!r}, which may change its height {said}")
        elif kind != _HINGE or abs(abs(axis[2]) - 1) > ROUNDING:
            raise NotLevelError(f"the eyes are on body {name!r}, which may tilt {said}")
