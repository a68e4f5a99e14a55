"""Pictures with smooth edges, from few rays.

First a fifth of the pixels is looked at, through their middles (`Lattice`). What lies between two that look the same
looks like them; between others, all pixels are looked at. Where these differ from their neighbours, four more rays per
pixel smooth the edge.
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from optics.spectra.spectrum import Spectrum
from sim.pictures.camera_rays import CODES, SAMPLES, CameraRays, plane_coordinates
from sim.pictures.lattice import Lattice
from sim.pictures.merged_mirror import MergedMirror
from sim.scene.cameras import Viewpoint
from sim.scene.color import encode_srgb
from sim.scene.rays import check_size

# Of 255. Steps between neighbours up to EDGE are not seen to be jagged; what differs by up to SAME is the same.
EDGE, SAME = 8, 1
LEVELS = 1 << 14  # of linear light in the table of sRGB values: finer than the steps of 8 bits where it is dark
_DISPLAYED = np.rint(255 * encode_srgb(np.arange(LEVELS) / (LEVELS - 1))).astype(np.uint8)


@dataclass(frozen=True)
class Look:
    """picture: sRGB, (y, x, 3) uint8
    nearness: 1 / depth along the camera's axis through pixels' middles [1/m], 0 for none, (y, x)
    """

    picture: np.ndarray
    nearness: np.ndarray


class QuickCamera:
    """Looks at any MuJoCo model as its mirror shows it in direct light (`sim.mirror`), without OpenGL.

    model, spectra: as `sim.mirror` has them
    """

    def __init__(self, model: mujoco.MjModel, spectra: Mapping[str, Spectrum | str] | None = None) -> None:
        self.mirror = MergedMirror(model, spectra)
        self._rays = CameraRays(self.mirror)
        self._lattices: dict[tuple[int, int], Lattice] = {}

    def picture(self, data: mujoco.MjData, camera: str | int | Viewpoint, width: int, height: int) -> np.ndarray:
        """sRGB picture (height, width, 3) uint8 of where data has everything.

        camera: name or id of a camera of the model, or a Viewpoint

        Raises:
            ValueError: an unknown camera, less than one pixel, and what `Mirror.sync` refuses.
        """
        return self.look(data, camera, width, height).picture

    def look(self, data: mujoco.MjData, camera: str | int | Viewpoint, width: int, height: int) -> Look:
        """The same, and how near everything is."""
        check_size(width, height, 1)
        self.mirror.sync(data)
        view, size = self.mirror.viewpoint(camera), (height, width)
        self.mirror.face(view)
        if size not in self._lattices:
            self._lattices[size] = Lattice.of(size)
        lattice = self._lattices[size]
        shown, planes = self._middles(view, lattice)
        self._smooth(view, lattice.size, shown)
        across, above = plane_coordinates(view.fovy_deg, size)
        slope_x, slope_y, nearness = (plane.reshape(size) for plane in planes)
        picture = np.ascontiguousarray(shown.T).reshape(height, width, 3)
        return Look(picture, slope_x * across.astype(np.float32) + slope_y * above.astype(np.float32)[:, None] + nearness)

    def _middles(self, view: Viewpoint, lattice: Lattice) -> tuple[np.ndarray, np.ndarray]:
        """What the middles of all pixels show, (3, pixel) uint8, and the planes seen there (3, pixel)."""
        first = self._rays.trace(view, lattice.size, CODES * lattice.pixels)
        shown, planes = _displayed(first.linear), first.plane
        between = lattice.between(_differ(shown[:, lattice.pairs[0]], shown[:, lattice.pairs[1]], SAME))
        shown, planes = shown.take(lattice.nearest, axis=1), planes.take(lattice.nearest, axis=1)
        if len(between):
            more = self._rays.trace(view, lattice.size, CODES * between)
            shown[:, between], planes[:, between] = _displayed(more.linear), more.plane
        return shown, planes

    def _smooth(self, view: Viewpoint, size: tuple[int, int], shown: np.ndarray) -> None:
        """Take more samples of pixels on edges, in place."""
        edges = np.flatnonzero(_on_edges(shown.reshape(3, *size)))
        if len(edges):
            codes = CODES * edges[:, None] + np.arange(len(SAMPLES))
            samples = self._rays.trace(view, size, codes.ravel()).linear.reshape(3, len(edges), -1)
            shown[:, edges] = _displayed(samples.mean(axis=2))


def _displayed(linear: np.ndarray) -> np.ndarray:
    level = np.clip(linear, 0.0, 1.0)
    level *= LEVELS - 1
    return _DISPLAYED.take((level + 0.5).astype(np.uint16))


def _on_edges(shown: np.ndarray) -> np.ndarray:
    """Pixels unlike a neighbour beside, above or below, (y, x); shown: (3, y, x)."""
    across = _differ(shown[:, :, 1:], shown[:, :, :-1], EDGE)
    along = _differ(shown[:, 1:], shown[:, :-1], EDGE)
    found = np.zeros(shown.shape[1:], bool)
    found[:, 1:] |= across
    found[:, :-1] |= across
    found[1:] |= along
    found[:-1] |= along
    return found


def _differ(a: np.ndarray, b: np.ndarray, tolerance: int) -> np.ndarray:
    return np.asarray((np.maximum(a, b) - np.minimum(a, b)).max(axis=0) > tolerance)
