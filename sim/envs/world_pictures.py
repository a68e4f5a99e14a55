"""Images of worlds for human viewers: the world from a camera, with agents' eyes drawn, or the learners' signals."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from sim.envs.animals import Animals
from sim.envs.follow_camera import FollowCamera
from sim.envs.hexagon_images import hexagon_map
from sim.envs.retina_images import one_above_another, side_by_side
from sim.envs.senses import Senses
from sim.eyes.compound_eye import CompoundEye, WorldEye
from sim.eyes.eyes import Eyes
from sim.physics.mujoco_worlds import MujocoWorlds
from sim.pictures.eye_marks import with_eyes
from sim.pictures.quick_camera import QuickCamera
from sim.scene.cameras import Viewpoint
from sim.scene.poses import Poses
from sim.tasks.built_in import AgentTask

PICTURE = (360, 480)  # pixels (height, width)
RIMS = 0.15  # length of the drawn edges of fields of view, in units of the model's extent


class WorldPictures:
    """Images of worlds for human viewers, as `render_mode` selects.

    "rgb_array": the agent of a built-in task from behind, or the model of a user task; "eyes": the signals of the
    learning agents' eyes; None: no images
    """

    def __init__(self, animals: Animals, render_mode: str | None) -> None:
        self._animals, self._mode = animals, render_mode
        self._photographer: Callable[[int], np.ndarray] | None = None

    def taken(self) -> list[np.ndarray]:
        """Return images (y, x, 3) uint8, as selected by the render mode.

        "rgb_array": one image of each world; "eyes": for each learner in turn, one image of each world, which shows the
        signals of the learner's eyes in this world; None: an empty list
        """
        if self._mode == "eyes":
            learners = self._animals.learners
            return [picture for senses in learners for picture in _of_all_kinds(senses)]
        if self._mode == "rgb_array":
            self._photographer = self._photographer or self._made()
            return [self._photographer(world) for world in range(self._animals.simulation.n)]
        return []

    def _made(self) -> Callable[[int], np.ndarray]:
        task = self._animals.simulation.task
        return _Follower(self._animals) if isinstance(task, AgentTask) else _ModelCameras(self._animals)


class _Follower:
    """A camera behind the agent."""

    def __init__(self, animals: Animals) -> None:
        self._simulation = animals.simulation
        task = self._simulation.task
        assert isinstance(task, AgentTask)
        eyes = task.eyes if isinstance(task.eyes, Eyes | None) else next(iter(task.eyes.values()))
        self.camera = FollowCamera(task.world, eyes)

    def __call__(self, world: int) -> np.ndarray:
        return self.camera.picture(self._simulation.state, world)


class _ModelCameras:
    """Images of worlds from the camera that the task names, or from a viewpoint that shows the whole model."""

    def __init__(self, animals: Animals) -> None:
        self._animals, self._simulation = animals, animals.simulation
        self._cameras: dict[int | None, tuple[bytes, QuickCamera]] = {}

    def __call__(self, world: int) -> np.ndarray:
        physics = self._simulation.physics
        assert isinstance(physics, MujocoWorlds)
        return self._picture(self._camera_of(world, physics), physics.datas[world])

    def _camera_of(self, world: int, physics: MujocoWorlds) -> QuickCamera:
        """Return the camera of a world: a common one, or one for each world if bodies differ between worlds.

        A world's camera is rebuilt only when the appearance of its bodies changes, because a new camera creates new
        materials. Dr.Jit must then record the rendering kernels of all eyes again.
        """
        bodies = physics.bodies
        model = bodies.models[world]
        appearance = model.geom_size.tobytes() + model.geom_rgba.tobytes() + model.geom_matid.tobytes()
        place = world if bodies.varied else None
        known, camera = self._cameras.get(place, (b"", None))
        if camera is None or appearance != known:
            camera = QuickCamera(model, self._animals.learners[0].renderer.spectra)
            self._cameras[place] = appearance, camera
        return camera

    def _picture(self, camera: QuickCamera, data: mujoco.MjData) -> np.ndarray:
        model = self._simulation.physics.model
        named = self._simulation.task.camera or _overview(model)
        picture, view = camera.picture(data, named, PICTURE[1], PICTURE[0]), camera.mirror.viewpoint(named)
        reach, poses = RIMS * float(model.stat.extent), Poses.from_data([data])
        for renderer in (sight.renderer for senses in self._animals.seeing for sight in senses.sights.values()):
            pupils, frames = renderer.eye_frames(poses)
            picture = with_eyes(picture, view, (pupils[0], frames[0]), renderer.eye.fov_deg, reach)
        return picture


def _of_all_kinds(senses: Senses) -> list[np.ndarray]:
    """Return an image (y, x, 3) uint8 of each world: pictures of an agent's kinds of eyes, one above another."""
    rows = [[_drawn(frame, sight.renderer.eye) for frame in sight.memory.newest] for sight in senses.sights.values()]
    return [one_above_another(pictures) for pictures in zip(*rows, strict=True)]


def _drawn(frame: np.ndarray, eye: WorldEye) -> np.ndarray:
    """Return an sRGB image (y, x, 3) uint8 of one world's signals.

    For a compound eye, the image contains a map of the sphere of directions for each mount (each position of the eye on
    the agent). For other eyes, it shows the retinas side by side.
    """
    if isinstance(eye, CompoundEye):
        return hexagon_map(frame if eye.rows is None else eye.as_frames(frame), eye)
    return side_by_side(frame[:, : eye.channels], eye)


def _overview(model: mujoco.MjModel) -> Viewpoint:
    """Return a viewpoint from the side and above, which shows the whole model."""
    centre, extent = np.array(model.stat.center), float(model.stat.extent)
    return Viewpoint.looking_at(centre + extent * np.array([-0.9, -1.6, 1.2]), centre, 45.0)
