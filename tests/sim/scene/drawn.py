"""MuJoCo's own renderer in a child process, because the machine's OpenGL may load an LLVM that conflicts with Dr.Jit's.

Usage as a program: drawn.py OUT WIDTH HEIGHT MATERIALS MODEL.mjb ... renders colours and geom ids of camera 0 for each
model. If MATERIALS is above 1, each model is rendered once for each of its first materials, on all of its geoms.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np


def draw(models, width, height, materials=1):
    """Return colours (n, y, x, 3) uint8 and geom ids (n, y, x), -1 for none; None without OpenGL.

    A renderer takes much longer to create than an image. If `materials` is above 1, each model is therefore rendered in
    one material after the other, so that n = models x materials.
    """
    with tempfile.TemporaryDirectory() as folder:
        names = [str(Path(folder) / f"{i}.mjb") for i in range(len(models))]
        for model, name in zip(models, names, strict=True):
            mujoco.mj_saveModel(model, name)
        out = str(Path(folder) / "out.npz")
        command = [sys.executable, __file__, out, *map(str, (width, height, materials)), *names]
        # EGL needs no display. An existing setting takes precedence.
        child = subprocess.run(command, env={"MUJOCO_GL": "egl", **os.environ}, capture_output=True, check=False)
        if child.returncode:
            return None
        with np.load(out) as pictures:
            return pictures["colors"], pictures["ids"]


def main(out, width, height, materials, *names):
    colors, ids = [], []
    for name in names:
        model = mujoco.MjModel.from_binary_path(name)
        if model.nlight == 0:
            # a scene without lights has no shadows, and the shadow buffer is slow to create
            model.vis.quality.shadowsize = 0
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        with mujoco.Renderer(model, int(height), int(width)) as renderer:
            for material in range(int(materials)):
                if int(materials) > 1:
                    model.geom_matid[:] = material
                renderer.disable_segmentation_rendering()
                renderer.update_scene(data, 0)
                colors.append(renderer.render())
                renderer.enable_segmentation_rendering()
                ids.append(renderer.render()[..., 0])
    np.savez(out, colors=np.array(colors), ids=np.array(ids))


if __name__ == "__main__":
    main(*sys.argv[1:])
