"""Pictures for people: the agent seen from behind, in the mirror of its world, and where its eyes look."""

from __future__ import annotations

import mujoco
import numpy as np

from sim.envs.field_of_view_overlay import draw_fields
from sim.eyes.eyes import Eyes
from sim.scene.cameras import Viewpoint
from sim.scene.color import encode_srgb, preview
from sim.scene.mirror import mirror
from sim.worlds.state import WorldState, pose
from sim.worlds.world import World

# [m] of the camera from the agent, and of its target ahead of it; steep enough to look over a wall behind.
BEHIND, ABOVE, AHEAD = 4.0, 5.0, 3.0
FOVY_DEG = 50.0
WAVELENGTHS = np.linspace(430e-9, 660e-9, 8)  # [m]
SPP = 12
SIZE = (360, 480)  # pixels (height, width)


RENDER_MODES = ("rgb_array", "eyes")


def check_render_mode(render_mode: str | None) -> None:
    """Refuse what nothing can be drawn by.

    Raises:
        ValueError: neither one of RENDER_MODES nor None.
    """
    if render_mode not in (None, *RENDER_MODES):
        modes = ", ".join(map(repr, RENDER_MODES))
        raise ValueError(f"render_mode = {render_mode!r}: must be one of {modes} or None")


class FollowCamera:
    """A camera that follows the agent; it holds its own mirror of the world.

    eyes: whose fields of view are drawn; None: no one's
    """

    def __init__(self, world: World, eyes: Eyes | None = None) -> None:
        self.world, self.eyes = world, eyes
        self._data = mujoco.MjData(world.model)
        self._mirror = mirror(world.model, spectra=world.spectra)

    def picture(self, state: WorldState, index: int = 0, size: tuple[int, int] = SIZE) -> np.ndarray:
        """sRGB picture (height, width, 3) uint8 of one world of a state."""
        pose(self._data, self.world, state, index)
        self._mirror.sync(self._data)
        height, width = size
        view = _follow(state, index)
        radiance = self._mirror.render(view, width, height, spp=SPP, wavelengths=WAVELENGTHS, sampler="multijitter")
        linear = np.clip(preview(radiance, WAVELENGTHS * 1e9), 0.0, 1.0)
        picture = np.rint(255 * encode_srgb(linear)).astype(np.uint8)
        if self.eyes is None:
            return picture
        depth = self._mirror.render_depth(view, width, height)
        return draw_fields(picture, view, depth, self.eyes, self.world.model, self._data)


def _follow(state: WorldState, index: int) -> Viewpoint:
    x, y = state.position[index]
    cos, sin = np.cos(state.heading[index]), np.sin(state.heading[index])
    origin = np.array([x - BEHIND * cos, y - BEHIND * sin, ABOVE])
    return Viewpoint.looking_at(origin, np.array([x + AHEAD * cos, y + AHEAD * sin, 0.0]), FOVY_DEG)
