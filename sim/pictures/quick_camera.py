"""Images with smooth edges, from few rays.

First, one ray is traced through the middle of every fifth pixel (`Lattice`). The pixels around a traced pixel get its
colour if all neighbouring pixels of the lattice have this colour, too. Otherwise, one ray is traced through each of
these surrounding pixels. If a pixel then differs from an adjacent pixel, four more rays through it smooth the edge.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from optics.spectra.spectrum import Spectrum
from sim.pictures.camera_rays import CODES, SAMPLES, CameraRays, plane_coordinates
from sim.pictures.lattice import Lattice
from sim.pictures.merged_mirror import MergedMirror
from sim.scene import inventory, surfaces
from sim.scene.cameras import Viewpoint
from sim.scene.color import encode_srgb
from sim.scene.mirror import MirrorWarning
from sim.scene.rays import checked_size

# sRGB levels from 0 to 255. Steps of up to EDGE between neighbours do not look jagged. Pixels that differ by up to SAME
# count as equal.
EDGE, SAME = 8, 1
LEVELS = 1 << 14  # number of levels of linear light in the table of sRGB values, enough for 8 bits in dark colours
_DISPLAYED = np.rint(255 * encode_srgb(np.arange(LEVELS) / (LEVELS - 1))).astype(np.uint8)


@dataclass(frozen=True)
class QuickImage:
    """An image, with the tangent planes of the surfaces in it.

    picture: sRGB, (y, x, 3) uint8
    planes: three coefficients of the surface's tangent plane where each ray hits it, see `RayLight`, (3, ray)
    ray: index of a ray for each pixel, (pixel,). The ray passes through the pixel's middle or, if no such ray was
        traced, through the nearest pixel of a lattice, which consists of every fifth pixel (`Lattice`).
    fovy_deg: vertical field of view of the camera
    """

    picture: np.ndarray
    planes: np.ndarray
    ray: np.ndarray
    fovy_deg: float

    def inverse_distance(self, pixels: np.ndarray) -> np.ndarray:
        """Return the inverse distance [1/m] at the middle of each pixel, (pixel,); 0 where the ray hits nothing.

        Distances are measured along the camera's axis.

        pixels: indices of pixels, which are counted row by row
        """
        across, above = plane_coordinates(self.fovy_deg, self.picture.shape[:2])
        y, x = np.divmod(pixels, self.picture.shape[1])
        ray = self.ray.take(pixels)
        slope_x, slope_y, ahead = (plane.take(ray) for plane in self.planes)
        return np.asarray(slope_x * across.take(x) + slope_y * above.take(y) + ahead)


class QuickCamera:
    """A camera that works without OpenGL, for any MuJoCo model. It renders the model's Mitsuba scene in direct light.

    model, spectra: see `sim.mirror`
    mirror: attribute, the Mitsuba scene that is a copy of the model (`sim.mirror`)

    Transparent geoms are rendered dark and opaque, and named in a warning (`sim.MirrorWarning`).

    Raises:
        ValueError: the model has no visible geoms, or `spectra` is invalid.
    """

    def __init__(self, model: mujoco.MjModel, spectra: Mapping[str, Spectrum | str] | None = None) -> None:
        self.mirror = MergedMirror(model, spectra)
        self._rays = CameraRays(self.mirror)
        if glass := [int(g) for g in self.mirror.geoms if surfaces.rgba(model, int(g))[3] < 1]:
            listed = inventory.listed_geoms(model, glass)
            warnings.warn(f"quick images do not show what is behind the transparent {listed}", MirrorWarning, 2)
        self._lattices: dict[tuple[int, int], Lattice] = {}

    def picture(self, data: mujoco.MjData, camera: str | int | Viewpoint, width: int, height: int) -> np.ndarray:
        """Return an sRGB image (height, width, 3) uint8 of the poses in data.

        camera: name or id of a camera of the model, or a Viewpoint

        Raises:
            ValueError: the camera is unknown, or is not a perspective camera defined by `fovy`; the image has less than
                one pixel; or `Mirror.sync` refuses the data.
        """
        return self.render(data, camera, width, height).picture

    def render(self, data: mujoco.MjData, camera: str | int | Viewpoint, width: int, height: int) -> QuickImage:
        """Return the same image as `picture`, as a `QuickImage`, which can also compute inverse distances.

        Errors are as in `picture`.
        """
        width, height = checked_size(width, height)
        self.mirror.sync(data)
        view, size = self.mirror.viewpoint(camera), (height, width)
        self.mirror.face(view)
        if size not in self._lattices:
            self._lattices[size] = Lattice.for_size(size)
        lattice = self._lattices[size]
        image, linear = self._middles(view, lattice)
        edges = np.flatnonzero(_on_edges(image.picture))
        if len(edges):
            codes = CODES * edges[:, None] + np.arange(1, len(SAMPLES))
            more = self._rays.trace(view, size, codes.ravel()).linear.reshape(3, len(edges), -1).sum(axis=2)
            mean = (linear[:, image.ray[edges]] + more) / len(SAMPLES)
            image.picture.reshape(-1, 3)[edges] = _displayed(mean).T
        return image

    def _middles(self, view: Viewpoint, lattice: Lattice) -> tuple[QuickImage, np.ndarray]:
        """Return an image from at most one ray per pixel, and the linear sRGB values along the rays, (3, ray).

        The lattice consists of every fifth pixel. Rays are traced through the middles of these pixels. Then, rays are
        also traced through the middles of other pixels that may lie on an edge. All remaining pixels have the colour of
        the nearest pixel of the lattice.
        """
        found = self._rays.trace(view, lattice.size, CODES * lattice.pixels)
        linear, planes, ray, shown = found.linear, found.plane, lattice.nearest, _displayed(found.linear)
        picture = shown.T.copy().take(ray, axis=0)
        rough = [np.abs(np.subtract(*(row[pair] for pair in lattice.pairs))) > SAME for row in shown.astype(np.int16)]
        between = lattice.between(rough[0] | rough[1] | rough[2])
        if len(between):
            more = self._rays.trace(view, lattice.size, CODES * between)
            picture[between] = _displayed(more.linear).T
            ray = ray.copy()
            ray[between] = planes.shape[1] + np.arange(len(between))
            planes, linear = np.concatenate([planes, more.plane], axis=1), np.concatenate([linear, more.linear], axis=1)
        return QuickImage(picture.reshape(*lattice.size, 3), planes, ray, view.fovy_deg), linear


def _displayed(linear: np.ndarray) -> np.ndarray:
    level = np.clip(linear, 0.0, 1.0)
    level *= LEVELS - 1
    return _DISPLAYED.take((level + 0.5).astype(np.uint16))


def _on_edges(picture: np.ndarray) -> np.ndarray:
    """Return a mask (y, x) of pixels that differ by more than 8 sRGB levels from a horizontal or vertical neighbour."""
    across, along = _step(picture[:, 1:], picture[:, :-1]), _step(picture[1:], picture[:-1])
    found = np.zeros(picture.shape[:2], bool)
    found[:, 1:] |= across
    found[:, :-1] |= across
    found[1:] |= along
    found[:-1] |= along
    return found


def _step(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a mask (y, x) of the pixels in which two images (y, x, 3) uint8 differ by more than 8 sRGB levels."""
    seen = np.maximum(a, b) - np.minimum(a, b) > EDGE
    return np.asarray(seen[..., 0] | seen[..., 1] | seen[..., 2])
