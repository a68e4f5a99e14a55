"""Images by MuJoCo's own renderer: geom ids and depth of a model in several poses.

It runs in a child process, because the system's OpenGL may load its own LLVM, which can conflict with that of Dr.Jit.
Command line: mujoco_pictures.py IN.npz MODEL.mjb OUT.npz
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

# MuJoCo's renderer draws round shapes as polygons; with this number of slices the error of outlines is 5e-4 of the
# radius.
SLICES = 96
FAR = 2e4  # relative to the model's extent: infinite planes reach the horizon


@dataclass(frozen=True)
class Shot:
    """A pose (qpos, mocap_pos, mocap_quat) and its viewpoint.

    The viewpoint is a camera's id, or, if that is -1, lookat (3,), distance, azimuth and elevation [deg] of a free
    camera.
    """

    qpos: np.ndarray
    mocap_pos: np.ndarray
    mocap_quat: np.ndarray
    camera: int
    free: np.ndarray

    def apply(self, data: mujoco.MjData) -> None:
        data.qpos[:] = self.qpos
        data.mocap_pos[:], data.mocap_quat[:] = self.mocap_pos, self.mocap_quat

    def origin_and_target(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the origin and target of the free camera."""
        azimuth, elevation = np.radians(self.free[4:6])
        cos = np.cos(elevation)
        forward = np.array([cos * np.cos(azimuth), cos * np.sin(azimuth), np.sin(elevation)])
        return self.free[:3] - self.free[3] * forward, self.free[:3]


def draw(model: mujoco.MjModel, shots: list[Shot], width: int, height: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the geom ids (shot, y, x), -1 for none, and depths [m]; None without OpenGL."""
    with tempfile.TemporaryDirectory() as folder:
        asked, model_path, drawn = (str(Path(folder) / name) for name in ("in.npz", "model.mjb", "out.npz"))
        mujoco.mj_saveModel(model, model_path)
        fields = {name: np.array([getattr(s, name) for s in shots]) for name in Shot.__dataclass_fields__}
        np.savez(asked, size=[width, height], **fields)
        command = [sys.executable, __file__, asked, model_path, drawn]
        # EGL needs no display; an existing setting takes precedence.
        child = subprocess.run(command, env={"MUJOCO_GL": "egl", **os.environ}, capture_output=True, check=False)
        if child.returncode:
            return None
        with np.load(drawn) as pictures:
            return pictures["ids"], pictures["depth"]


def only_geoms() -> mujoco.MjvOption:
    """Return MuJoCo's default view without objects other than geoms."""
    option = mujoco.MjvOption()
    for groups in (option.sitegroup, option.tendongroup, option.skingroup, option.flexgroup):
        groups[:] = 0
    option.flags[:] = 0
    option.flags[mujoco.mjtVisFlag.mjVIS_STATIC] = 1
    return option


def main(asked: str, model_path: str, drawn: str) -> None:
    model = mujoco.MjModel.from_binary_path(model_path)
    with np.load(asked) as file:
        width, height = (int(n) for n in file["size"])
        fields = {name: file[name] for name in Shot.__dataclass_fields__}
    model.vis.quality.numslices = model.vis.quality.numstacks = SLICES
    model.vis.quality.offsamples = 0
    model.vis.map.zfar = FAR
    model.vis.global_.offwidth, model.vis.global_.offheight = width, height
    data, ids, depth = mujoco.MjData(model), [], []
    with mujoco.Renderer(model, height, width) as renderer:
        for i in range(len(fields["camera"])):
            shot = Shot(**{name: values[i] for name, values in fields.items()})
            shot.apply(data)
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, _camera(shot), only_geoms())
            renderer.enable_segmentation_rendering()
            ids.append(renderer.render()[..., 0])
            renderer.enable_depth_rendering()
            depth.append(renderer.render())
    np.savez(drawn, ids=np.array(ids), depth=np.array(depth))


def _camera(shot: Shot) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    if shot.camera >= 0:
        camera.type, camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, int(shot.camera)
        return camera
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.lookat[:], camera.distance = shot.free[:3], shot.free[3]
    camera.azimuth, camera.elevation = shot.free[4], shot.free[5]
    return camera


if __name__ == "__main__":
    main(*sys.argv[1:])
