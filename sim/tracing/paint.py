"""Colours that differ between worlds ("paint"), as reflectances of geoms in the eye's bands.

The BSDF of a painted geom contains the geom's texture, or is white without a texture. When the kernel (the program that
traces rays) renders a world, it multiplies the BSDF's reflectance by the geom's colour in this world, as MuJoCo
multiplies a texture by a colour. As in all scenes, Mitsuba converts colours to spectra (Jakob and Hanika 2019). The
emission of a glowing geom, see `sim.scene.lights.emission`, is multiplied by the geom's colour in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import mujoco
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene import surfaces
from sim.scene.color import decode_srgb
from sim.scene.device_arrays import whole_numbers
from sim.scene.poses import Poses
from sim.tracing import lighting
from sim.tracing.world_rows import WorldRows


@dataclass(frozen=True)
class PaintRows(WorldRows):
    """Reflectances of "painted" geoms, whose colour differs between worlds. Each ray reads those of its own world.

    The reflectances are stored in rows of four floats.

    painted: for each entry of `Movers`, the index of its geom among the painted geoms, see `Paint`
    """

    painted: Array


class Paint:
    """Colours of the "painted" geoms, whose colours differ between worlds. The scene's Mitsuba variant must be active.

    geoms: ids of the painted geoms
    movers: geom id of each "mover". A mover is a moving or painted geom with one of the materials that it may have, so
        a geom with two possible materials is two movers
    wavelengths: centres of the bands [m], (band,)
    glow: True if any of the painted geoms glows
    painted: for each mover, the index of its geom in `geoms`, or len(geoms) if this geom is not painted; an array for
        the kernel. A last entry, len(geoms), is for rays that hit no mover
    """

    def __init__(
        self, model: mujoco.MjModel, geoms: list[int], movers: np.ndarray, wavelengths: np.ndarray, glow: bool
    ) -> None:
        self.geoms, self._spectra, self._bands = np.array(geoms, int), lighting.spectra(wavelengths), len(wavelengths)
        self._own = np.array([surfaces.rgba(model, g)[:3] for g in geoms]).reshape(-1, 3)
        self._of_material = model.geom_matid[self.geoms][:, None] >= 0
        place = {geom: k for k, geom in enumerate(geoms)}
        self.painted = whole_numbers([*(place.get(int(g), len(geoms)) for g in movers), len(geoms)])
        textures = [(g, surfaces.texture_id(model, g)) for g in geoms]
        self.glow, self._textured = glow, [t >= 0 and surfaces.is_mirrored(model, g, t) for g, t in textures]
        self._known: dict[tuple[tuple[float, ...], bool], np.ndarray] = {}

    def __len__(self) -> int:
        return len(self.geoms)

    @property
    def n_rows(self) -> int:
        """Number of rows of four floats that contain the colours of one world, at least 1."""
        return max(len(self) * len(self._spectra) * (1 + self.glow), 1)

    def rows(self, poses: Poses) -> np.ndarray:
        """Return the reflectances and, if any painted geom glows, the emissions in each world.

        The result is a float32 array (world, 4 n_rows). Each row of four floats (`n_rows` in each world) contains four
        bands of one geom. The emissions of all geoms follow their reflectances.
        """
        rows = np.zeros((poses.n, self.n_rows * lighting.LANES), np.float32)
        if not len(self):
            return rows
        each = rows.reshape(poses.n, 1 + self.glow, len(self), -1)
        colors = self._colors(poses)
        for world, glow, k in np.ndindex(each.shape[:3]):
            color = tuple(map(float, colors[world % len(colors), k]))
            each[world, glow, k, : self._bands] = self._spectrum(color, bool(glow) and not self._textured[k])
        return rows

    def _colors(self, poses: Poses) -> np.ndarray:
        """Return sRGB colours, (world or 1, geom, 3).

        As in MuJoCo, a geom without a colour has the colour of its material.
        """
        if poses.geom_rgba is None:
            return self._own[None]
        here = poses.geom_rgba[:, self.geoms]
        unset = (here == surfaces.UNSET_RGBA).all(axis=-1, keepdims=True) & self._of_material
        return np.where(unset, self._own, here[..., :3])

    def factors(self, which: Array, there: PaintRows, seen: Array, *, glow: bool = False) -> list[Array]:
        """Return the factors by which reflectance or, if `glow`, emission is multiplied, as spectra of 4 bands each.

        The factors are 1 for geoms that have the same colour in all worlds.

        which: index of the moving geom ("mover") that a ray hits, or the number of movers if it hits none
        there: the colours in the ray's world
        seen: True for rays that hit a surface
        """
        k = dr.gather(mi.UInt32, there.painted, which, seen)
        painted = seen & (k < len(self))
        start = len(self) * len(self._spectra) if glow else 0
        found = []
        for chunk in range(len(self._spectra)):
            row = start + dr.select(painted, k, 0) * len(self._spectra) + chunk
            found.append(dr.select(painted, mi.Spectrum(*there.four(row)), 1))
        return found

    def _spectrum(self, rgb: tuple[float, ...], emitted: bool) -> np.ndarray:
        """Return the reflectance (band,) of a display-referred colour.

        emitted: True to return instead the factor by which an emission is multiplied. This factor is the reflectance of
            the brightest colour with the same hue and saturation, times the largest linear component of the colour
        """
        if (rgb, emitted) not in self._known:
            if len(self._known) > 10_000:
                self._known.clear()
            linear = np.clip(decode_srgb(np.array(rgb)), 0, 1)
            level = float(linear.max()) if emitted else 1.0
            self._known[rgb, emitted] = level * self._reflectance(linear / level if level > 0 else linear)
        return self._known[rgb, emitted]

    def _reflectance(self, linear: np.ndarray) -> np.ndarray:
        texture, si = mi.load_dict({"type": "rgb", "value": linear.tolist()}), dr.zeros(mi.SurfaceInteraction3f)
        found = []
        for spectrum in self._spectra:
            si.wavelengths = spectrum
            found.append(np.array(texture.eval(si)).ravel())
        return np.concatenate(found)[: self._bands]
