"""The approximate vector field in a focus: Debye's sum of plane waves, one for each point of a pupil.

Light from the point ξ of the pupil arrives at the image position c after a distance D. Near c it is approximated by a
plane wave:

    E(c + x) = -ik/2π ∫ P(ξ) e^{ik(L + D)} g(ξ) e(ξ) e^{ik s·x} dξ,   s = (c - ξ)/D,   g = z/D².

L is the path through the pupil, and e is the field of rays behind it (`ray_field`). With e = 1, this is the
Rayleigh-Sommerfeld integral about c with one approximation. The term ik(|x|² - (s·x)²)/2D of the exponent is replaced
by its value at the pupil's centre for all points of the pupil. For a round aplanatic pupil, the sum equals the integral
of Richards and Wolf (1959).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from optics.elements.beam import Beam
from optics.elements.ray_field import SCALAR, RayField, Vector, before_pupil, rays_behind, turned
from optics.methods.rayleigh_sommerfeld import cached_nodes, node_count
from optics.numerics.autodiff import number
from optics.numerics.grid import Grid
from optics.numerics.precision import padded_for_packets, precision
from optics.numerics.scattered_sum import ScatteredSum

__all__ = ["VectorSum"]

DIGITS = 8.0  # choice: digits of the quadrature and of the sum


@dataclass(frozen=True)
class VectorSum:
    """Light that passes a pupil and arrives at samples around an image position c, window.centre.

    aplanatic: True if all rays arrive at c in phase, and the sine of a ray's angle to the axis is |ξ|/z. ξ is the point
        of the pupil where the ray starts, relative to the centre, and z is the distance of the window from the pupil.
    """

    beam: Beam
    window: Grid
    aplanatic: bool = False

    def components(self) -> np.ndarray:
        """Return Ex, Ey, Ez for light polarised along x, the same for y, and the scalar field: (7, y, x), complex.

        The polarisation is that of the light in front of the pupil. Fields are divided by the square root of the
        pupil's area and do not contain the carrier e^{ikz}.
        """
        x, y, amplitude = self._pupil()
        (cx, cy), z = self.window.centre, number(self.beam.distance)
        d = z if self.aplanatic else np.sqrt((cx - x) ** 2 + (cy - y) ** 2 + z * z)
        per_sample = self.beam.index / self.beam.wavelength * self.window.dx
        sums = ScatteredSum((cx - x) / d * per_sample, (cy - y) / d * per_sample, self.window.shape, DIGITS)
        rays = self._rays(x, y)
        parts = []
        for axis in (0, 1):
            along, before = before_pupil(self.beam.source, axis)
            ex, ey, ez = turned(before, along, rays)
            # Ez follows from Ex and Ey by Maxwell's equations. Along the ray to c, it equals Ez of the rotated field.
            parts += [ex, ey, ez if self.aplanatic else -(ex * (cx - x) + ey * (cy - y)) / z]
        found = sums.evaluate(np.array([*parts, np.ones(len(x))]) * amplitude) / math.sqrt(self.beam.pupil.area)
        return found if self.aplanatic else found * self._bend()

    def _bend(self) -> np.ndarray:
        """Return the phase factor of the path from the pupil's centre to a sample, relative to a plane wave, (y, x)."""
        (cx, cy), z = self.window.centre, number(self.beam.distance)
        x, y, d = self.window.x[None, :], self.window.y[:, None], math.hypot(cx, cy, z)
        longer = np.sqrt(x * x + y * y + z * z) - d - (cx * (x - cx) + cy * (y - cy)) / d
        bend: np.ndarray = np.exp(2j * np.pi * self.beam.index / self.beam.wavelength * longer)
        return bend

    @property
    def nodes(self) -> int:
        """Number of points of the pupil."""
        return node_count(self.beam.pupil.aperture, self._cycles, DIGITS)

    def _rays(self, x: np.ndarray, y: np.ndarray) -> Vector:
        z = number(self.beam.distance)
        if self.aplanatic:
            return -x / z, -y / z, np.sqrt(1 - (x * x + y * y) / z**2)
        types = precision("float64")
        at_x, at_y = (types.Float64(padded_for_packets(at)) for at in (x, y))
        along_x, along_y, axial = (part.numpy() for part in rays_behind(self.beam, at_x, at_y))
        return along_x, along_y, axial

    @property
    def _cycles(self) -> float:
        """Number of phase cycles along the pupil's radius."""
        beam, pupil, z = self.beam, self.beam.pupil, number(self.beam.distance)
        turning = pupil.slopes(beam.wavelength, beam.source).turning(z, self.window, beam.index)[1]
        if self.aplanatic:
            turning = beam.index * self.window.own_half_diagonal / z
        detail = RayField(beam, 0, SCALAR).bandwidth(1e-6, pupil.radius) * pupil.radius
        # Directions and obliquity add no phase, but they are not polynomials: they have poles at the height z.
        poles = DIGITS * math.log(10) / (2 * math.pi) * pupil.radius / z
        return pupil.radius * turning / beam.wavelength + detail + poles

    def _pupil(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return positions x, y [m] of points of the pupil, and a complex amplitude for each point.

        Near the image position, the light from a point is approximated by a plane wave. The amplitude is that of this
        plane wave at the image position, times the quadrature weight of the point.
        """
        beam, pupil, types = self.beam, self.beam.pupil, precision("float64")
        k, z, radius = 2 * math.pi * beam.index / beam.wavelength, number(beam.distance), pupil.radius
        nodes = cached_nodes(pupil.aperture, self._cycles, DIGITS)
        x, y = nodes.x * radius, nodes.y * radius
        weight = -1j * nodes.weight * radius**2 * k / (2 * math.pi)
        if self.aplanatic:
            return x, y, weight / z * (1 - (x * x + y * y) / z**2) ** -0.25
        at = types.Float64(padded_for_packets(x)), types.Float64(padded_for_packets(y))
        inside = types.Float64(padded_for_packets(nodes.x)), types.Float64(padded_for_packets(nodes.y))
        passed = pupil.amplitude(*inside).numpy() * np.ones(len(x))
        cx, cy = self.window.centre
        across = (cx - x) ** 2 + (cy - y) ** 2
        d2 = across + z * z
        phase = 2 * np.pi * beam.waves(*at).numpy() + k * across / (np.sqrt(d2) + z)
        return x, y, weight * passed * z / d2 * np.exp(1j * phase)
