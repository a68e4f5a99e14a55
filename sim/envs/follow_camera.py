"""Images for human viewers: the agent from behind, with the fields of view of its eyes."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from optics.numerics.arguments import shown
from sim.envs.field_of_view_overlay import FieldsOfView, Nearness
from sim.eyes.eyes import Eyes
from sim.pictures.quick_camera import QuickCamera
from sim.scene.cameras import Viewpoint
from sim.scene.color import encode_srgb, preview
from sim.scene.mirror import Mirror, mirror
from sim.worlds.state import WorldState, pose
from sim.worlds.world import World

# Position of the camera relative to the agent, and distance ahead of the agent at which it is aimed [m]. The view is
# steep enough to look over a wall behind the agent.
BEHIND, ABOVE, AHEAD = 4.0, 5.0, 3.0
FOVY_DEG = 50.0
WAVELENGTHS = np.linspace(430e-9, 660e-9, 8)  # [m] wavelengths of slow images, which Mitsuba traces
SIZE = (360, 480)  # pixels (height, width)


RENDER_MODES = ("rgb_array", "eyes")


def check_render_mode(render_mode: str | None) -> None:
    """Refuse an unknown render mode.

    Raises:
        ValueError: the mode is neither "rgb_array", "eyes" nor None.
    """
    if render_mode is not None and not (isinstance(render_mode, str) and render_mode in RENDER_MODES):
        modes = ", ".join(map(repr, RENDER_MODES))
        raise ValueError(f"render_mode = {shown(render_mode)}: must be one of {modes} or None")


class FollowCamera:
    """A camera that follows the agent. It renders its own copy of the world.

    eyes: eyes that are drawn with their fields of view; None: no eyes are drawn
    samples: None: fast images (`sim.pictures.quick_camera`). A number: slow images, for which Mitsuba traces this
        number of rays per pixel at eight wavelengths. They take twenty to fifty times as long.

    Raises:
        ValueError: `samples` is neither None nor a whole number of at least 1.
    """

    def __init__(self, world: World, eyes: Eyes | None = None, samples: int | None = None) -> None:
        if samples is not None and (isinstance(samples, bool) or samples != int(samples) or samples < 1):
            raise ValueError(f"samples = {samples!r}: must be a whole number, at least 1, or None, for fast images")
        self.world, self.eyes, self.samples = world, eyes, samples
        self._data = mujoco.MjData(world.model)
        self._quick = QuickCamera(world.model, world.spectra) if samples is None else None
        self._mirror = mirror(world.model, spectra=world.spectra) if samples is not None else None
        self._fields: dict[tuple[int, int], FieldsOfView] = {}

    def picture(self, state: WorldState, index: int = 0, size: tuple[int, int] = SIZE) -> np.ndarray:
        """Return an sRGB image (height, width, 3) uint8 of one world; `index` is its index in `state`."""
        pose(self._data, self.world, state, index)
        height, width = size
        view = _follow(state, index)
        nearness: Nearness
        if self._mirror is None:
            assert self._quick is not None
            image = self._quick.render(self._data, view, width, height)
            picture, nearness = image.picture, image.inverse_distance
        else:
            picture, nearness = self._slow_image(self._mirror, view, size)
        if self.eyes is None:
            return picture
        if size not in self._fields:
            self._fields[size] = FieldsOfView(self.eyes, _behind(np.zeros(2), 0.0), size)
        return self._fields[size].draw(picture, nearness, self.world.model, self._data)

    def _slow_image(self, scene: Mirror, view: Viewpoint, size: tuple[int, int]) -> tuple[np.ndarray, Nearness]:
        scene.sync(self._data)
        height, width = size
        assert self.samples is not None
        options: dict[str, Any] = {"spp": self.samples, "sampler": _sampler(self.samples)}
        radiance = scene.render(view, width, height, wavelengths=WAVELENGTHS, **options)
        linear = np.clip(preview(radiance, WAVELENGTHS * 1e9), 0.0, 1.0)
        depth = scene.render_depth(view, width, height).ravel()
        return np.rint(255 * encode_srgb(linear)).astype(np.uint8), lambda pixels: 1 / depth[pixels]


def _sampler(spp: int) -> str:
    """Return the name of the sampler that Mitsuba uses.

    Multijitter causes less noise, but it rounds numbers of samples that do not fit its grid.
    """
    return "multijitter" if spp % math.isqrt(spp) == 0 else "independent"


def _follow(state: WorldState, index: int) -> Viewpoint:
    return _behind(state.position[index], float(state.heading[index]))


def _behind(position: np.ndarray, heading: float) -> Viewpoint:
    """Return the viewpoint behind an agent with this position and heading."""
    x, y = position
    cos, sin = np.cos(heading), np.sin(heading)
    origin = np.array([x - BEHIND * cos, y - BEHIND * sin, ABOVE])
    return Viewpoint.looking_at(origin, np.array([x + AHEAD * cos, y + AHEAD * sin, 0.0]), FOVY_DEG)
