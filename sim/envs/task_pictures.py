"""Pictures of tasks of one's own, for people: the model with all animals' eyes in it, or what eyes report."""

from __future__ import annotations

import mujoco
import numpy as np

from sim.envs.retina_images import one_above_another, side_by_side
from sim.envs.task_animals import TaskAnimals
from sim.envs.task_senses import Senses
from sim.pictures.eye_marks import with_eyes
from sim.pictures.quick_camera import QuickCamera
from sim.scene.cameras import Viewpoint
from sim.scene.poses import Poses
from sim.tasks.encounter import of_world

PICTURE = (360, 480)  # pixels (height, width)
RIMS = 0.15  # of the model's extent: how far the rims of fields of view are drawn


class TaskPictures:
    """As `render_mode` asks: "rgb_array", "eyes" of those who learn, or None."""

    def __init__(self, animals: TaskAnimals, render_mode: str | None) -> None:
        self._animals, self._mode = animals, render_mode
        self._cameras: dict[int, tuple[bytes, QuickCamera]] = {}

    def taken(self) -> list[np.ndarray]:
        """(y, x, 3) uint8: one of every world, or of the eyes of each that learns in every world; none without mode."""
        if self._mode == "eyes":
            learners = self._animals.learners
            return [picture for senses in learners for picture in _of_all_kinds(senses)]
        if self._mode == "rgb_array":
            worlds = self._animals.worlds
            return [self._picture(self._camera_of(world), data) for world, data in enumerate(worlds.datas)]
        return []

    def _camera_of(self, world: int) -> QuickCamera:
        """The one for all; where bodies differ, each world's own, made anew with its episode and no earlier:
        a camera's materials have all eyes' kernels recorded once more."""
        bodies = self._animals.worlds.bodies
        model = bodies.models[world]
        looks = model.geom_size.tobytes() + model.geom_rgba.tobytes() + model.geom_matid.tobytes()
        known, camera = self._cameras.get(world if bodies.varied else 0, (b"", None))
        if camera is None or looks != known:
            camera = QuickCamera(model, self._animals.learners[0].renderer.spectra)
            self._cameras[world if bodies.varied else 0] = looks, camera
        return camera

    def _picture(self, camera: QuickCamera, data: mujoco.MjData) -> np.ndarray:
        worlds = self._animals.worlds
        named = of_world(worlds.animals, "camera") or _overview(worlds.model)
        picture, view = camera.picture(data, named, PICTURE[1], PICTURE[0]), camera.mirror.viewpoint(named)
        reach = RIMS * float(worlds.model.stat.extent)
        poses = Poses.of([data])
        for renderer in (sight.renderer for senses in self._animals.seeing for sight in senses.sights.values()):
            pupils, frames = renderer.eye_frames(poses)
            picture = with_eyes(picture, view, (pupils[0], frames[0]), renderer.eye.fov_deg, reach)
        return picture


def _of_all_kinds(senses: Senses) -> list[np.ndarray]:
    """A picture of each world: a row for each kind of eyes."""
    rows = [
        [side_by_side(frame, sight.renderer.eye) for frame in sight.memory.newest] for sight in senses.sights.values()
    ]
    return [one_above_another(pictures) for pictures in zip(*rows, strict=True)]


def _overview(model: mujoco.MjModel) -> Viewpoint:
    """From the side, above."""
    centre, extent = np.array(model.stat.center), float(model.stat.extent)
    return Viewpoint.looking_at(centre + extent * np.array([-0.9, -1.6, 1.2]), centre, 45.0)
