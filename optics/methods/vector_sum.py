"""The vector focus of any light: Debye's sum of plane waves, one from each point of a pupil.

The ray from ξ to the image's place c, at a distance D, brings a plane wave whose field is turned with it:

    E(c + x) = k/2π ∫ P(ξ) e^{ik(L + D)} g(ξ) e(ξ) e^{ik s·x} dξ,   s = (c - ξ)/D,   g = z/D²,

L the path through the pupil, e the field before it, turned by the shortest way into the ray's direction. With e = 1
this is Rayleigh-Sommerfeld's integral about c; where all is the same around the axis it is Richards and Wolf's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from optics.elements.beam import Beam
from optics.methods.rayleigh_sommerfeld import cached_nodes
from optics.numerics.autodiff import number
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.numerics.scattered_sum import ScatteredSum

__all__ = ["VectorSum", "turned"]

DIGITS = 8.0  # choice


@dataclass(frozen=True)
class VectorSum:
    """Light through a pupil to samples about an image's place, window.centre; aplanatic: of a pupil that is seen from c
    under the sine ξ/z, all rays in phase."""

    beam: Beam
    window: Grid
    aplanatic: bool = False

    def components(self) -> np.ndarray:
        """Ex, Ey, Ez of light that is polarised along x before the pupil, the same of y, and scalar theory's field:
        (7, y, x), complex, over the root of the pupil's area."""
        x, y, amplitude = self._pupil()
        ray = self._rays(x, y)
        per_sample = self.beam.index / self.beam.wavelength * self.window.dx
        sums = ScatteredSum(ray[0] * per_sample, ray[1] * per_sample, self.window.shape, DIGITS)
        before = self._before()
        fields = [turned(turned(np.eye(3)[axis][:, None], AXIS, before), before, ray) for axis in (0, 1)]
        parts = np.concatenate([*fields, np.ones((1, len(x)))]).astype(complex)
        return sums.of(parts * amplitude) / math.sqrt(self.beam.pupil.area)

    def _rays(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Unit vectors (x, y, z), (3, point)."""
        (cx, cy), z = self.window.centre, number(self.beam.distance)
        if self.aplanatic:
            return np.stack([-x / z, -y / z, np.sqrt(1 - (x * x + y * y) / z**2)])
        there = np.stack([cx - x, cy - y, np.full(len(x), z)])
        return np.asarray(there / np.sqrt((there**2).sum(axis=0)))

    def _before(self) -> np.ndarray:
        """The light's direction before the pupil, (3, 1)."""
        along = np.array([*(math.tan(angle) for angle in self.beam.source.angle), 1.0])
        return np.asarray(along / np.linalg.norm(along))[:, None]

    def _pupil(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points x, y [m], and k/2π P g e^{ik(L + D)} dξ."""
        beam, pupil, types = self.beam, self.beam.pupil, precision("float64")
        k, z, radius = 2 * math.pi * beam.index / beam.wavelength, number(beam.distance), pupil.radius
        turning = pupil.slopes(beam.wavelength, beam.source).turning(z, self.window, beam.index)[1]
        if self.aplanatic:
            turning = beam.index * self.window.own_half_diagonal / z
        detail = 0.0 if pupil.mask is None else pupil.mask.bandwidth(1e-6, radius) * radius
        # Directions and obliquity turn nothing, but are no polynomials: their poles lie at height z.
        poles = DIGITS * math.log(10) / (2 * math.pi) * radius / z
        nodes = cached_nodes(pupil.aperture, radius * turning / beam.wavelength + detail + poles, DIGITS)
        x, y = nodes.x * radius, nodes.y * radius
        weight = nodes.weight * radius**2 * k / (2 * math.pi)
        if self.aplanatic:
            return x, y, weight / z * (1 - (x * x + y * y) / z**2) ** -0.25
        at = types.Float64(x), types.Float64(y)
        passed = pupil.amplitude(types.Float64(nodes.x), types.Float64(nodes.y), types).numpy() * np.ones(len(x))
        (cx, cy), end = self.window.centre, math.hypot(*self.window.centre, z)
        d2 = (cx - x) ** 2 + (cy - y) ** 2 + z * z
        excess = (x * x + y * y - 2 * (x * cx + y * cy)) / (np.sqrt(d2) + end)
        phase = 2 * np.pi * beam.waves(*at, types).numpy() + k * excess
        return x, y, weight * passed * z / d2 * np.exp(1j * phase)


AXIS = np.array([0.0, 0.0, 1.0])[:, None]


def turned(field: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Vectors (3, …) turned as the shortest way turns one unit vector into another; they are at right angles to it."""
    between = before + after
    share = (field * after).sum(axis=0) / (1 + (before * after).sum(axis=0))
    return np.asarray(field - share * between)
