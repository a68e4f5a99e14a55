"""How much light a pupil sends into a mode, for every direction that it may come from.

The amplitude of a mode is the overlap of its field with the light in its plane. That light is a Rayleigh-Sommerfeld
integral over the pupil, and the two integrals may change places:

    c(s) = ∫ ψ(x) U_s(x) dx = ∫ P(ξ) e^{ik n₀ s·ξ} Ψ(ξ) dξ,   Ψ(ξ) = ∫ ψ(x) z/(2πD²) (1/D - ik) e^{ikD} dx,

so that a mode is sent back to the pupil once, and all directions s (sines) are one Fourier sum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from optics.elements.beam import Beam
from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.methods.rayleigh_sommerfeld import cached_nodes
from optics.numerics.arguments import without_derivative
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.numerics.quadrature import gauss_legendre, gauss_legendre_count, harmonics
from optics.ommatidia.waveguide import Mode

__all__ = ["ModesAtPupil", "modes_at_pupil"]

DIGITS = 6.0  # choice: of all sums
FAR = 14.0  # choice: a mode's field ends where e^{-Wr/b} does, at e^-14 of the edge's
FARTHEST = 12.0  # choice: or so many core radii away, for modes near their cut-off
PAIRS = 4_000_000  # choice, by memory: of nodes at once


@dataclass(frozen=True, eq=False)
class ModesAtPupil:
    """Modes as the pupil sends their light: nodes x, y [m], and weights P Ψ dξ, (mode, node).

    wavenumber: k n₀ [1/m], before the pupil. area: [m²], of the open pupil.
    """

    x: np.ndarray
    y: np.ndarray
    weights: np.ndarray
    wavenumber: float
    area: float

    def power(self, sine_x: np.ndarray, sine_y: np.ndarray) -> np.ndarray:
        """Share of the light on the pupil that goes into each mode, (mode, direction), from directions of these
        sines."""
        sx, sy = np.ravel(sine_x), np.ravel(sine_y)
        found = np.empty((len(self.weights), sx.size))
        step = max(1, PAIRS // self.x.size)
        for start in range(0, sx.size, step):
            part = slice(start, start + step)
            waves = np.exp(1j * self.wavenumber * (np.outer(self.x, sx[part]) + np.outer(self.y, sy[part])))
            found[:, part] = np.abs(self.weights @ waves) ** 2 / self.area
        return found


def modes_at_pupil(
    pupil: Pupil, modes: tuple[Mode, ...], wavelength: float, distance: float, steepest: float
) -> ModesAtPupil:
    """Modes of a waveguide on the axis whose end lies at a distance [m] behind the pupil, for directions up to a
    sine."""
    beam = Beam(pupil, PointSource(), wavelength, distance)
    k, types = 2 * math.pi * beam.index / wavelength, precision("float64")
    widest = max(mode.radius * _reach(mode) for mode in modes)
    slopes = pupil.slopes(wavelength, beam.source)
    # Turns per radius of pupil, mode and direction together: what a lens bends, the path unbends.
    residue = slopes.turning(distance, Grid.square(3, widest), beam.index)[1] / wavelength
    cycles = pupil.radius * (residue + pupil.index_before(wavelength) * steepest / wavelength)
    detail = 0.0 if pupil.mask is None else pupil.mask.bandwidth(1e-6, pupil.radius) * pupil.radius
    nodes = cached_nodes(pupil.aperture, cycles + detail, DIGITS)
    x, y = nodes.x * pupil.radius, nodes.y * pupil.radius
    at = types.Float64(x), types.Float64(y)
    waves, passed = beam.waves(*at, types), pupil.amplitude(types.Float64(nodes.x), types.Float64(nodes.y), types)
    for name, value in (("aperture_radius", pupil.aperture_radius), ("lens", waves), ("lens.mask", passed)):
        without_derivative(name, value)
    bent, passed = np.exp(2j * np.pi * waves.numpy()), passed.numpy() * np.ones(len(x))
    weight = nodes.weight * pupil.radius**2 * passed * bent
    sent = _sent_back(modes, x, y, distance, k)
    return ModesAtPupil(x, y, sent * weight, 2 * math.pi * pupil.index_before(wavelength) / wavelength, pupil.area)


def _reach(mode: Mode) -> float:
    """Core radii beyond which the field is nothing."""
    return 1 + min(FAR / mode.w, FARTHEST)


def _sent_back(modes: tuple[Mode, ...], x: np.ndarray, y: np.ndarray, z: float, k: float) -> np.ndarray:
    """Ψ of each mode at the pupil's points, less the carrier e^{ikz}, (mode, point)."""
    outermost = float(np.hypot(x, y).max())
    mx, my, weight = _mode_nodes(modes, k * outermost / math.hypot(z, outermost))
    amplitude = np.stack([weight * mode.field(mx, my) for mode in modes], axis=1)
    found = np.empty((len(modes), x.size), dtype=complex)
    step = max(1, PAIRS // mx.size)
    for start in range(0, x.size, step):
        part = slice(start, start + step)
        d2 = np.subtract.outer(x[part], mx) ** 2 + np.subtract.outer(y[part], my) ** 2
        distance = np.sqrt(d2 + z * z)
        kernel = z / (2 * np.pi * distance**2) * (1 / distance - 1j * k) * np.exp(1j * k * d2 / (distance + z))
        found[:, part] = (kernel @ amplitude).T
    return found


def _mode_nodes(modes: tuple[Mode, ...], k: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, y [m] and weights over the modes' fields, for light of transverse wavenumbers up to k [1/m]."""
    b, parts = modes[0].radius, []
    fastest, farthest, most = max(mode.u for mode in modes), max(map(_reach, modes)), max(mode.l for mode in modes)
    steep = max(mode.w for mode in modes) * (farthest - 1)  # of the fields' decay: a polynomial of about this degree
    for low, high, turns, degree in ((0.0, b, fastest, 0), (b, b * farthest, 0.0, int(steep) + 8)):
        cycles = (k * (high - low) + turns) / (2 * math.pi)
        u, weight = gauss_legendre(gauss_legendre_count(cycles, DIGITS, 2 + degree))
        r = low + (high - low) * u
        around = int(harmonics(np.array(k * high), DIGITS)) + most + 1
        phi = 2 * np.pi * (np.arange(around) + 0.5) / around
        size = (high - low) * weight * r * 2 * np.pi / around
        parts.append((np.outer(r, np.cos(phi)).ravel(), np.outer(r, np.sin(phi)).ravel(), np.repeat(size, around)))
    x, y, weight = (np.concatenate(column) for column in zip(*parts, strict=True))
    return x, y, weight
