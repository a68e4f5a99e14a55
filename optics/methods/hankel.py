"""Propagation from a rotationally symmetric pupil by two Hankel transforms, to the angular spectrum and back.

This is usually the fastest exact method. The first transform yields the angular spectrum S from the light P behind the
pupil, and the second yields the field U from S:

    S(f) = 2π ∫ P(r) J₀(2πfr) r dr,   U(x) = 2π ∫ S(f) e^{ikz (cos θ - 1)} J₀(2πfx) f df,   f = sin θ / λ

(Goodman, Introduction to Fourier Optics, §2.1.5 and §3.10). The quadrature in r ends at the edge of the aperture, so no
soft edge is necessary. The quadrature over f uses the variable θ, because the transfer function is a smooth function of
θ up to grazing incidence.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from optics.elements.beam import Beam
from optics.methods.carrier import on_line
from optics.methods.problem import Problem
from optics.methods.spectral_taper import Taper, tapers
from optics.numerics.autodiff import Array
from optics.numerics.bessel import bessel_j0
from optics.numerics.cost import (
    BESSEL_PAIR,
    CALL,
    ITEM_BYTES,
    NODE_BYTES,
    PROFILE_ENTRY,
    PROFILE_SAMPLE,
    SYMMETRIC_BYTES,
)
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.precision import Precision, opaque, padded_for_packets, precision
from optics.numerics.quadrature import gauss_legendre, gauss_legendre_count
from optics.numerics.radial_profile import DistinctRadii, RadialProfile

__all__ = ["HankelSampling", "hankel"]

# Choice: for tolerances of this size or larger, J₀ is computed to fewer digits.
LOOSE = 1e-8


@dataclass(frozen=True)
class HankelSampling:
    """Quadrature nodes for two Hankel transforms, and the radii at which the light in the window is computed.

    The Gauss-Legendre nodes of the first transform are radii r in the pupil. Those of the second transform are angles θ
    between the axis and the plane waves of the angular spectrum.

    radii: numbers of nodes in r, for each open ring of the aperture.
    angles: number of nodes in θ.
    line: radii at which the light in the window is computed.
    """

    taper: Taper
    radii: tuple[int, ...]
    angles: int
    line: RadialProfile | DistinctRadii
    seconds: float
    bytes: float
    method: str = "hankel"
    model_error: float = 0.0
    padding: float = 1.0

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Return the intensity over the window, for unit amplitude at the pupil, as a flat Dr.Jit array."""
        types = precision(problem.dtype)
        profile = _hankel(beam, problem, self, types).intensity
        return self.line.onto(profile, problem.window, types)

    def field(self, beam: Beam, problem: Problem) -> Field:
        """Return the complex amplitude U over the window, without the carrier e^{ikz} of a plane wave."""
        return on_line(_hankel(beam, problem, self, precision(problem.dtype)), self.line, beam, problem)

    def plane(self, problem: Problem) -> float:
        """Return the width [m] of the square over which rounding errors are assumed to be evenly spread.

        `Sampling.plane` explains how the size of rounding errors follows from this width. The width is twice the sum of
        the pupil's radius and of the largest radius at which the light in the window is computed.
        """
        return 2 * (self.line.radius + problem.radius)

    @property
    def samples(self) -> tuple[int, int]:
        return sum(self.radii), self.angles


def hankel(problem: Problem) -> list[HankelSampling]:
    """Return samplings whose quadrature nodes resolve the phases of both Hankel transforms.

    The transforms are integrals over the radius in the pupil, and over the frequencies of the spectrum. There is one
    sampling for each taper, a function that fades the spectrum out before grazing incidence. The list is
    empty unless the problem is rotationally symmetric.
    """
    if not problem.symmetric:
        return []
    return [_sampling(problem, taper) for taper in tapers(problem)]


def _sampling(problem: Problem, taper: Taper) -> HankelSampling:
    digits = 0.5 - math.log10(problem.tolerance)  # choice: about a third of the tolerance for each of the two rules
    cycles = problem.radius * (problem.phase_band_inside + taper.end)
    rings = problem.aperture.rings
    radii = tuple(_round_up(gauss_legendre_count(cycles * (outer - inner), digits)) for inner, outer in rings)
    outermost = max(min(problem.window.half_diagonal, problem.outermost), problem.window.dx)
    steepest = math.hypot(problem.distance, problem.radius + outermost) / problem.wavelength
    angles = gauss_legendre_count(steepest * math.asin(min(1.0, taper.end * problem.wavelength)), digits)
    band = min(2 * taper.end, 2 * problem.radius / (problem.wavelength * problem.distance) + 2 / taper.blur)
    profile = RadialProfile.resolving(outermost, band, problem.distance, problem.ripple)
    line = profile if profile.pays(math.prod(problem.window.shape)) else DistinctRadii(problem.window)
    pairs = sum(radii) * angles + angles * line.points
    seconds = CALL["hankel"] + pairs * BESSEL_PAIR + line.entries * PROFILE_ENTRY
    seconds += math.prod(problem.window.shape) * PROFILE_SAMPLE
    needed = line.entries * ITEM_BYTES[problem.dtype] + (sum(radii) + angles + line.points) * NODE_BYTES
    if line is not profile:
        needed += math.prod(problem.window.shape) * SYMMETRIC_BYTES
    return HankelSampling(taper, radii, _round_up(angles), line, seconds, needed)


def _round_up(n: int) -> int:
    """Return n, rounded up to one of a few numbers, so that cached tables are used."""
    step = max(1, 2 ** (n.bit_length() - 4))
    return -(-n // step) * step


def _hankel(beam: Beam, problem: Problem, how: HankelSampling, types: Precision) -> Field:
    """Return the field in the window's plane at the radii `how.line.positions`, without the factor e^{ikz}.

    This factor is the phase of a plane wave that travels the distance z from the pupil to the window.
    """
    import drjit as dr

    nodes, weights = _on_rings(problem.aperture.rings, how.radii)
    r = types.Float64(padded_for_packets(nodes)) * opaque(types, beam.radius)
    zero = dr.zeros(types.Float64, len(nodes))
    area = types.Float64(padded_for_packets(2 * np.pi * weights * nodes)) * dr.square(opaque(types, beam.radius))
    if beam.pupil.mask is not None:
        area *= beam.pupil.amplitude(types.Float64(padded_for_packets(nodes)), zero)
    pupil = Field.from_waves(area, beam.waves(r, zero), Grid((1, len(nodes)), 1.0), types)
    edge = math.asin(how.taper.end * problem.wavelength)
    nodes, weights = gauss_legendre(how.angles)
    theta, sine, cosine = (
        types.Float64(padded_for_packets(each)) for each in (nodes * edge, np.sin(nodes * edge), np.cos(nodes * edge))
    )
    f = sine / opaque(types, problem.wavelength)
    exactly = problem.tolerance < LOOSE
    spectrum = _transform(pupil, r, f, types, exactly)
    fade = how.taper.fade(f * f, types)
    ring = (
        types.Float64(padded_for_packets(2 * np.pi * edge * weights)) * f * cosine / opaque(types, problem.wavelength)
    )
    waves = -opaque(types, beam.distance) / opaque(types, problem.wavelength) * 2 * dr.square(dr.sin(theta / 2))
    grid = Grid((1, how.angles), 1.0)
    spectrum = spectrum * Field.from_waves(ring * types.Float64(fade), waves, grid, types)
    return _transform(spectrum, f, types.Float64(padded_for_packets(how.line.positions)), types, exactly)


def _on_rings(rings: tuple[tuple[float, float], ...], counts: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return quadrature nodes and weights over the open rings, in units of the pupil's radius."""
    parts = [
        (inner + (outer - inner) * nodes, (outer - inner) * weights)
        for (inner, outer), (nodes, weights) in zip(rings, map(gauss_legendre, counts), strict=True)
    ]
    nodes, weights = (np.concatenate(column) for column in zip(*parts, strict=True))
    return nodes, weights


def _transform(field: Field, at: Array, to: Array, types: Precision, exactly: bool) -> Field:
    """Return Σ_j u_j J₀(2π at_j to_k) for every k, where u is the field.

    exactly: True to compute J₀ in float64 with an error of 1e-15 instead of 1e-12.
    """
    import drjit as dr

    n, m = dr.width(at), dr.width(to)
    dr.eval(field.re, field.im, at, to)
    count = dr.opaque(types.Index, n)

    def add(j: Array, re: Array, im: Array) -> tuple[Array, Array, Array]:
        weight = bessel_j0(dr.gather(types.Float64, at, j) * to, types, exactly)
        re, im = (
            so_far + types.Float64(weight * dr.gather(types.Float, part, j))
            for part, so_far in ((field.re, re), (field.im, im))
        )
        return j + 1, re, im

    zero = dr.zeros(types.Float64, m)
    start = dr.zeros(types.Index, m)
    _, re, im = dr.while_loop((start, zero, zero), lambda j, re, im: j < count, add, max_iterations=-1)
    return Field(types.Float(re), types.Float(im), Grid((1, m), 1.0), types)
