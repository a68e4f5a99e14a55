"""MuJoCo's cameras as Mitsuba sensors, and user-defined viewpoints.

A MuJoCo camera looks along its -z with x to the right. A Mitsuba sensor looks along +z with x to the left. The sensor's
`to_world` is therefore the MuJoCo camera's rotation times diag(-1, 1, -1).
"""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Integral

import mitsuba as mi
import mujoco
import numpy as np

from optics.numerics.arguments import positive, reals, shown
from optics.numerics.number_types import is_boolean
from sim.scene.pose_snapshot import PoseSnapshot
from sim.scene.variant import MitsubaObject

WIDEST_DEG = 179.0  # chosen: largest field of view
FARTHEST = 1e15  # [m] chosen: largest coordinate of a point, whose square is within double precision


@dataclass(frozen=True)
class Viewpoint:
    """A pinhole camera.

    position: centre of projection [m], (3,)
    rotation: the camera's axes as columns, (3, 3): x to the right, y up, and z backwards, as in MuJoCo
    fovy_deg: vertical field of view [deg]
    """

    position: np.ndarray
    rotation: np.ndarray
    fovy_deg: float

    @staticmethod
    def looking_at(origin: np.ndarray, target: np.ndarray, fovy_deg: float = 45.0) -> Viewpoint:
        """Return a viewpoint at `origin` that looks at `target` [m], with z up (y up if the direction is vertical).

        origin, target: points (3,), which must differ
        fovy_deg: vertical field of view [degrees], above 0 and at most 179

        Raises:
            ValueError: `origin` or `target` does not consist of three numbers of at most 10¹⁵, the points are equal, or
                the field of view is out of range.
        """
        origin, target = _point("origin", origin), _point("target", target)
        fovy_deg = positive("fovy_deg", fovy_deg, "degrees", most=WIDEST_DEG)
        back = origin - target
        distance = np.linalg.norm(back)
        if distance == 0:
            raise ValueError(f"target = {shown(target.tolist())}: must differ from the origin")
        back /= distance
        right = np.cross([0, 1.0, 0] if abs(back[2]) > 1 - 1e-9 else [0, 0, 1.0], back)
        right /= np.linalg.norm(right)
        rotation = np.column_stack([right, np.cross(back, right), back])
        return Viewpoint(origin, rotation, fovy_deg)

    def rays(self, width: int, height: int) -> np.ndarray:
        """Return the directions of rays through the pixels' centres, in the world's frame, (y, x, 3).

        The component of each direction along the camera's viewing axis is 1.
        """
        half = np.tan(np.radians(self.fovy_deg) / 2)
        y, x = np.indices((height, width))
        across, up = (2 * (x + 0.5) - width) / height * half, (1 - 2 * (y + 0.5) / height) * half
        return np.stack([across, up, -np.ones((height, width))], axis=-1) @ self.rotation.T


def viewpoint(model: mujoco.MjModel, data: mujoco.MjData | PoseSnapshot, camera: str | int | Viewpoint) -> Viewpoint:
    """Return the current viewpoint of a camera of the model; a `Viewpoint` is returned unchanged.

    Raises:
        ValueError: the camera is unknown, or its projection is not a plain perspective.
    """
    if isinstance(camera, Viewpoint):
        return camera
    index = _camera_id(model, camera)
    if model.cam_projection[index] != mujoco.mjtProjection.mjPROJ_PERSPECTIVE or np.any(
        model.cam_sensorsize[index] > 0
    ):
        raise ValueError(f"camera {camera!r}: only perspective cameras given by fovy are mirrored")
    rotation = data.cam_xmat[index].reshape(3, 3).copy()
    return Viewpoint(data.cam_xpos[index].copy(), rotation, float(model.cam_fovy[index]))


def sensor(view: Viewpoint, width: int, height: int, near: float) -> MitsubaObject:
    """Return a Mitsuba perspective sensor (of the active variant) of width x height pixels.

    near: distance of the near clipping plane [m]
    """
    matrix = np.eye(4)
    matrix[:3, :3] = view.rotation @ np.diag([-1.0, 1.0, -1.0])
    matrix[:3, 3] = view.position
    return mi.load_dict(
        {
            "type": "perspective",
            "fov": view.fovy_deg,
            "fov_axis": "y",
            "near_clip": near,
            "far_clip": 1e7 * near,
            "to_world": mi.ScalarTransform4f(matrix.tolist()),
            "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}},
        }
    )


def _point(name: str, value: object) -> np.ndarray:
    """Return a point [m], (3,); ValueError unless it consists of three numbers of at most FARTHEST."""
    point = reals(name, value)
    if point.shape != (3,) or not (np.abs(point) <= FARTHEST).all():
        raise ValueError(f"{name} = {shown(value)}: must be a point, three numbers [m] of at most {FARTHEST:g}")
    return point


def _camera_id(model: mujoco.MjModel, camera: str | int) -> int:
    names = [model.camera(i).name for i in range(model.ncam)]
    if isinstance(camera, str) and camera in names:
        return names.index(camera)
    if isinstance(camera, Integral) and not is_boolean(camera) and 0 <= camera < model.ncam:
        return int(camera)
    raise ValueError(f"no camera {shown(camera)}; the model has {', '.join(map(repr, names)) or 'none'}")
