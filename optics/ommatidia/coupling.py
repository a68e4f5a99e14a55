"""Coupling of the light on a pupil into the modes of a waveguide, for every direction of incidence.

The amplitude of a mode is the overlap of its field ψ with the light U in the plane of the waveguide's end. U is a
Rayleigh-Sommerfeld integral over the pupil, and the order of the two integrals can be exchanged:

    c(s) = ∫ ψ(x) U_s(x) dx = ∫ P(ξ) e^{ik₀ s·ξ} Ψ(ξ) dξ,   Ψ(ξ) = ∫ ψ(x) z/(2πD²) (1/D - ik) e^{ikD} dx.

P is the amplitude that the pupil transmits, D the distance from x to ξ, and z the distance from the pupil to the end of
the waveguide. The wavenumber is k₀ in front of the pupil, and k behind it. Each mode is propagated back to the pupil
once. The amplitudes for all directions then follow from one Fourier sum. A direction s is given by its sines along x
and y. A waveguide off the pupil's axis points at the pupil's centre. The module `radiation` computes Ψ.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from optics.elements.beam import Beam
from optics.methods.rayleigh_sommerfeld import cached_nodes
from optics.numerics.arguments import without_derivative
from optics.numerics.autodiff import number
from optics.numerics.grid import Grid
from optics.numerics.precision import padded_for_packets, precision
from optics.numerics.scattered_sum import ScatteredSum
from optics.ommatidia.radiation import DIGITS, radiated, reach
from optics.ommatidia.waveguide import Mode

__all__ = ["ModesAtPupil", "modes_at_pupil"]

TOGETHER = 8  # choice, limited by memory: modes that are transformed at once
PAIRS = 4_000_000  # choice, limited by memory: pairs of node and direction that are computed at once


@dataclass(frozen=True, eq=False)
class ModesAtPupil:
    """Modes of a waveguide, propagated back to the quadrature nodes of a pupil.

    x, y: positions of the nodes [m].
    weights: amplitude P of the pupil, times the mode's field Ψ at the node, times the node's area dξ, (mode, node).
    area_of: dξ of each node [m²].
    wavenumber: k₀ [1/m] in front of the pupil.
    area: open area of the pupil [m²].
    """

    x: np.ndarray
    y: np.ndarray
    weights: np.ndarray
    area_of: np.ndarray
    wavenumber: float
    area: float

    def power(self, sine_x: np.ndarray, sine_y: np.ndarray) -> np.ndarray:
        """Return the fraction of the light on the pupil that enters each mode, (mode, direction).

        sine_x, sine_y: sines of the light's directions along x and y, minus those of the direction of the beam's
            source.
        """
        sx, sy = np.ravel(sine_x), np.ravel(sine_y)
        found = np.empty((len(self.weights), sx.size))
        step = max(1, PAIRS // self.x.size)
        for start in range(0, sx.size, step):
            part = slice(start, start + step)
            waves = np.exp(1j * self.wavenumber * (np.outer(self.x, sx[part]) + np.outer(self.y, sy[part])))
            found[:, part] = np.abs(self.weights @ waves) ** 2 / self.area
        return found

    def power_on(self, sines: Grid, taken: np.ndarray, digits: float = DIGITS) -> np.ndarray:
        """Return a weighted sum over modes of the fraction of the pupil's light that enters each mode, (y, x).

        sines: grid of directions: sines of the light's direction along x and y, minus those of the direction of the
            beam's source.
        taken: weight of each mode, for example the fraction of its light that is absorbed.
        digits: number of accurate digits of the Fourier sum.
        """
        per_sample = self.wavenumber / (2 * math.pi) * sines.dx
        sums = ScatteredSum(self.x * per_sample, self.y * per_sample, sines.shape, digits)
        middle = np.exp(1j * self.wavenumber * (self.x * sines.centre[0] + self.y * sines.centre[1]))
        found = np.zeros(sines.shape)
        for start in range(0, len(taken), TOGETHER):
            some = slice(start, start + TOGETHER)
            for amplitude, weight in zip(sums.evaluate(self.weights[some] * middle), taken[some], strict=True):
                found += weight * (amplitude.real**2 + amplitude.imag**2)
        return found / self.area

    def total(self, taken: np.ndarray) -> float:
        """Return the integral of `power_on` over all sines of the light along x and y, also those above 1.

        `power_on` is a weighted sum over modes of the fraction of the pupil's light that enters each mode. By
        Parseval's theorem, the integral for one mode is (λ/n₀)² Σ |P Ψ|² dξ / area. λ/n₀ is the wavelength in front of
        the pupil, P the amplitude that the pupil transmits, and Ψ the mode's field at a node with the area dξ. The sum
        is over all nodes. The attribute `weights` contains P Ψ dξ for each mode and node.

        taken: weight of each mode.
        """
        squares = (np.abs(self.weights) ** 2 / self.area_of).sum(axis=1)
        return float(taken @ squares) * (2 * math.pi / self.wavenumber) ** 2 / self.area


def modes_at_pupil(
    beam: Beam,
    modes: tuple[Mode, ...],
    steepest: float,
    place: tuple[float, float] = (0.0, 0.0),
    digits: float = DIGITS,
) -> ModesAtPupil:
    """Propagate modes of a waveguide back to the pupil. The waveguide's end lies at `beam.distance` behind the pupil.

    steepest: length of the longest vector (x, y) of the sines of a direction of light, minus those of the direction of
        the beam's source.
    place: position (x, y) [m] of the waveguide's end, relative to the pupil's axis.
    digits: number of accurate digits of the sums over the pupil.

    Raises:
        ValueError: the pupil's relief is a `PixelRelief`, or an argument carries a derivative.
    """
    pupil, wavelength, z = beam.pupil, beam.wavelength, number(beam.distance)
    if pupil.pixels:
        raise ValueError("height is a PixelRelief: must be smooth before a waveguide, or None")
    k, types = 2 * math.pi * beam.index / wavelength, precision("float64")
    # The cycles are those of the combined phase of pupil, path and direction, because the curvatures of lens and path
    # cancel.
    window = Grid((3, 3), reach(modes), place)
    residue = pupil.slopes(wavelength, beam.source).turning(z, window, beam.index)[1] / wavelength
    cycles = pupil.radius * (residue + pupil.index_before(wavelength) * steepest / wavelength)
    detail = 0.0 if pupil.mask is None else pupil.mask.bandwidth(1e-6, pupil.radius) * pupil.radius
    nodes = cached_nodes(pupil.aperture, cycles + detail, digits)
    x, y = nodes.x * pupil.radius, nodes.y * pupil.radius
    at = types.Float64(padded_for_packets(x)), types.Float64(padded_for_packets(y))
    inside = types.Float64(padded_for_packets(nodes.x)), types.Float64(padded_for_packets(nodes.y))
    waves, passed = beam.waves(*at), pupil.amplitude(*inside)
    known = (("aperture_radius", pupil.aperture_radius), ("lens", waves), ("lens.mask", passed))
    for name, value in (*known, ("distance", beam.distance)):
        without_derivative(name, value)
    bent, passed = np.exp(2j * np.pi * waves.numpy()), passed.numpy() * np.ones(len(x))
    area_of = nodes.weight * pupil.radius**2
    weights = radiated(modes, x, y, (*place, z), k) * (area_of * passed * bent)
    before = 2 * math.pi * pupil.index_before(wavelength) / wavelength
    return ModesAtPupil(x, y, weights, area_of, before, pupil.area)
