"""Fraction of the pupil's light that arrives on an unbounded plane.

The rest is absorbed by a mask, or is evanescent.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.apertures.aperture import Nodes
from optics.apertures.circular import Circle
from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.numerics.arguments import reals, shown
from optics.numerics.autodiff import Array, number, plain
from optics.numerics.precision import opaque, padded_for_packets, precision
from optics.point_spread.psf_result import PSFResult
from optics.point_spread.request import Request

__all__ = ["arriving_light"]

# Choice: the light in the window may exceed the light that arrives by this amount, because sums have errors.
HELD_TOO_MUCH = 1e-2
DIGITS = 5.0  # choice: digits of the sum over the spectrum
MOST_PAIRS = 2e8  # choice: largest number of pairs of nodes and frequencies in this sum; they take about a second
WORTH_MOST = 1e-3  # choice: uncertainty of the estimate above which the sum may have MOST_PAIRS; below, fewer
STEEPEST = 0.96  # choice: largest squared sine in the formula of `_at_edge`, which diverges at 1
SURE = 1e-4  # choice: the sum, which has about this error, is computed only if the estimate is less certain


def arriving_light(result: PSFResult, arriving: Any) -> tuple[Array, np.ndarray]:
    """Return the fraction of the pupil's light that arrives on the plane, and its uncertainty, (wavelength,).

    arriving: the fraction, if it is known: a number or (wavelength,); else None.

    Raises:
        ValueError: arriving has the wrong shape or value.
    """
    types = precision("float64")
    if arriving is None:
        return _not_evanescent(result)
    held, known = plain(result.power), reals("arriving", arriving)
    if known.shape not in ((), held.shape):
        raise ValueError(f"arriving has shape {known.shape}: must be a number, or one per wavelength {held.shape}")
    if not ((known > 0) & (known <= 1) & (known > held - HELD_TOO_MUCH)).all():
        raise ValueError(f"arriving = {shown(arriving)}: must be in (0, 1] and at least the window's {shown(held)}")
    return types.Float(np.full(held.shape, known)), np.zeros(held.shape)


def _not_evanescent(result: PSFResult) -> tuple[Array, np.ndarray]:
    """Return the fraction of the pupil's light that is not evanescent, and this fraction's uncertainty, (wavelength,).

    The fraction is relative to all light on the aperture, including the light that the pupil's mask absorbs.

    The squared spectrum of a straight edge, integrated over frequencies above f, is 1/(2π²f) per length of the edge.
    For rays along the axis and an aperture of perimeter P and area A, the fraction λP/(2π²A) is therefore evanescent.
    For other rays, this fraction is multiplied by the factor for oblique rays that `_at_edge` returns. It is also
    multiplied by the mask's transmission along the edge, relative to that of the whole aperture. Light is evanescent,
    too, if the relief bends it so far that the sine of its angle to the axis would exceed 1.

    These formulas estimate the evanescent light. If the estimate is too uncertain, and the pupil is not too wide, the
    fraction that is not evanescent is computed as a sum over the power spectrum of the light behind the pupil
    (`_summed`).
    """
    import drjit as dr

    pupil, outline, types = result.pupil, result.pupil.aperture.outline, precision("float64")
    wavelength = types.Float(np.array([at / pupil.index_behind(at) for at in map(float, result.wavelengths)]))
    ratio = outline.length / (2 * math.pi**2 * pupil.aperture.area)
    light, rim = pupil.transmission, 1.0
    if pupil.mask is not None:
        x, y = (types.Float64(np.ascontiguousarray(at)) for at in outline.points().T)
        rim = dr.mean(dr.square(pupil.amplitude(x, y))) / light
    edge = wavelength * ratio / opaque(types, pupil.aperture_radius) * rim
    tilted, bent = types.Float(1.0), np.zeros((2, len(result.wavelengths)))
    if result.can_recompute:
        tilted = _mean(result, [_at_edge(request) for request in result.requests])
        bent = _mean_number(result, [_bent_beyond_grazing(request) for request in result.requests]).T
    doubt = np.minimum(edge.numpy() * (tilted.numpy() - 1), 0.5)
    edge = dr.minimum(edge * tilted, 0.5)
    found = (1 - edge) * types.Float(1 - bent[0]) * light
    unsure = number(light) * (np.square(edge.numpy()) + doubt + bent[1])
    if not result.can_recompute or float(unsure.max()) <= SURE:
        return found, unsure
    sums = [_summed(request, float(unsure.max())) for request in result.requests]
    if any(one is None for one in sums):
        return found, unsure
    return _mean(result, [one for one in sums if one is not None]), np.minimum(unsure, SURE)


def _mean(result: PSFResult, values: Sequence[Array]) -> Array:
    """Return `values` as one array or, if the PSF is a mean over wavelengths, their mean with the same weights.

    values: one value for each wavelength for which the PSF was computed.
    """
    import drjit as dr

    types = precision("float64")
    found = types.Float(values[0]) if len(values) == 1 else dr.concat([types.Float(one) for one in values])
    return found if result.shares is None else dr.sum(found * types.Float(np.asarray(result.shares)))


def _mean_number(result: PSFResult, values: Sequence[Any]) -> np.ndarray:
    """Return `values` as a NumPy array or, if the PSF is a mean over wavelengths, their mean with the same weights.

    values: a number or a tuple of numbers for each wavelength for which the PSF was computed.
    """
    found = np.array(values)
    return found if result.shares is None else np.atleast_1d(result.shares @ found)


def _at_edge(request: Request) -> Array:
    """Return the factor by which oblique rays increase the evanescent light that the aperture's edge diffracts.

    The factor is 1 for rays parallel to the axis. A point of the edge spreads its light along a line of spatial
    frequencies, s + t n, in units of 1/λ. Here s is the frequency of the ray at this point, and n is the normal of the
    edge. The power of this light is proportional to 1/t². The line leaves the unit circle, beyond which light is
    evanescent, at t = -s·n ± √((s·n)² + 1 - s²). The power outside the circle is √((s·n)² + 1 - s²) / (1 - s²) times
    the power for s = 0. The result is the mean of this factor over the edge.
    """
    import drjit as dr

    beam, types = request.beam, precision("float64")
    places = request.problem.aperture.outline.points()
    step, radius = 1e-4, opaque(types, beam.pupil.aperture_radius)

    def waves(dx: float, dy: float) -> Array:
        x, y = (types.Float64(padded_for_packets(at)) for at in (places + np.array([dx, dy])).T)
        return beam.waves(x * radius, y * radius)

    per_wave = request.problem.wavelength / (2 * step * radius)
    sx, sy = ((waves(dx, dy) - waves(-dx, -dy)) * per_wave for dx, dy in ((step, 0.0), (0.0, step)))
    along = np.roll(places, -1, axis=0) - np.roll(places, 1, axis=0)
    unit = along / np.maximum(np.hypot(*along.T), 1e-300)[:, None]
    along_x, along_y = (types.Float64(padded_for_packets(at)) for at in unit.T)
    square = dr.minimum(sx * sx + sy * sy, STEEPEST)
    normal = dr.minimum(dr.square(sx * along_y - sy * along_x), square)
    return dr.mean(dr.sqrt(normal + 1 - square) / (1 - square))


def _bent_beyond_grazing(request: Request) -> tuple[float, float]:
    """Return the fraction of the pupil's light that does not propagate according to ray optics, and its uncertainty.

    The sine of the angle between a ray and the axis is the slope of the optical path behind the pupil, divided by the
    refractive index. A ray with a sine of 1 or more does not propagate. Diffraction changes the sine by about √(λ/R),
    with the wavelength λ and the pupil's radius R. The uncertainty is the fraction of rays with a sine above
    1 - √(λ/R).
    """
    pupil, problem = request.beam.pupil, request.problem
    slopes = pupil.slopes(request.beam.wavelength, request.beam.source)
    inside = slopes.distance_from_axis <= slopes.radius
    sine = np.hypot(slopes.along_x, slopes.along_y)[inside] / request.beam.index
    steep = sine > 1 - math.sqrt(problem.wavelength / problem.radius)
    return float(np.mean(sine >= 1)), float(np.mean(steep))


def _summed(request: Request, unsure: float = 1.0) -> Array | None:
    """Return the fraction of the pupil's light at frequencies below 1/λ; None if the sum would take too long.

    The fraction is computed as a sum, which replaces the less certain estimate of `_not_evanescent`. It is
    ∫ |F(u)|² df / A over |f| < 1/λ, with the field u behind the pupil and the area A of its aperture. Lengths are in
    units of the radius. |F(u)|² has no structure finer than one cycle per diameter. The result is also None for
    pixelated reliefs and for pupils with more than 100 cycles per radius.

    unsure: uncertainty of the estimate that the sum replaces. The larger it is, the longer the sum may take.
    """
    beam, asked = request.beam, request.problem
    problem = Problem.from_beam(beam, asked.window, asked.tolerance, asked.dtype, derivatives=False)
    highest = problem.radius / problem.wavelength
    phase = highest + problem.radius * problem.phase_band
    if problem.pixelated is not None or max(phase, highest) > 100:
        return None
    aperture = problem.aperture
    counted = aperture.node_count(phase, DIGITS)
    seen = Circle().nodes(2 * highest, DIGITS)
    most = MOST_PAIRS * min(1.0, unsure / WORTH_MOST)
    if (counted or 0) * len(seen.weight) > most:
        return None
    nodes = aperture.nodes(phase, DIGITS)
    if len(nodes.weight) * len(seen.weight) > most:
        return None
    return _Sum(nodes.x, nodes.y, nodes.weight, seen).fraction(beam, problem.wavelength) / aperture.area


@dataclass(frozen=True)
class _Sum:
    """Sum of the power spectrum behind a pupil over frequencies inside a circle.

    x, y, weight: quadrature nodes in the pupil, in units of its radius R
    seen: quadrature nodes in the circle of frequencies, in units of its radius 1/λ
    """

    x: np.ndarray
    y: np.ndarray
    weight: np.ndarray
    seen: Nodes

    def fraction(self, beam: Beam, wavelength: float) -> Array:
        """Return h² Σ w |Σ u exp(2πi (W - h (sx x + sy y)))|², with h = R/λ and the pupil's radius R.

        W is the optical path in waves. The outer sum is over the frequencies (sx, sy) of weight w, the inner sum over
        the pupil's nodes (x, y) with amplitudes u.

        Derivatives come from the adjoint of the sum, which consists of three sums of the same size. The adjoint is
        computed only if h, W or u carries a derivative.
        """
        import drjit as dr

        types = precision("float64")
        x, y, u = (types.Float64(padded_for_packets(at)) for at in (self.x, self.y, self.weight))
        sx, sy, w = (types.Float64(padded_for_packets(at)) for at in (self.seen.x, self.seen.y, self.seen.weight))
        radius = opaque(types, beam.pupil.aperture_radius)
        h, waves = radius / wavelength, beam.waves(x * radius, y * radius)
        if beam.pupil.mask is not None:
            u = u * beam.pupil.amplitude(x, y)
        at, steady = (h, waves, u), [dr.detach(one) for one in (h, waves, u)]
        with dr.suspend_grad():
            h0, waves0, u0 = steady
            re, im = _sums((h0 * sx, h0 * sy), (x, y, *_turned(u0, dr.zeros(types.Float64), waves0)))
            total = dr.sum(w * (re * re + im * im)) * h0 * h0
        if not any(map(dr.grad_enabled, at)):
            return total
        with dr.suspend_grad():
            slopes = self._slopes(steady, (x, y, sx, sy), (w * re, -w * im), total)
        return total + sum((dr.sum(slope * (a - b)) for slope, a, b in zip(slopes, at, steady, strict=True)), 0.0)

    @staticmethod
    def _slopes(at: Sequence[Array], places: Sequence[Array], back: Sequence[Array], total: Array) -> tuple[Array, ...]:
        """Return the derivatives of `fraction`, the power inside a circle of frequencies, with respect to h, W and u.

        h is the radius of the pupil divided by the wavelength. At each node of the pupil, W is the optical path [waves]
        and u the amplitude. The spectrum at a frequency (sx, sy) is the sum of u exp(2πi (W - h (sx x + sy y))) over
        the nodes (x, y). `fraction` is h² times the weighted sum of the spectrum's squared modulus over the
        frequencies.

        at: h, and W and u of all nodes.
        places: coordinates x, y of the nodes, followed by the coordinates sx, sy of the frequencies.
        back: real and imaginary part of the spectrum's complex conjugate, multiplied by the weight of each frequency.
        total: the value of `fraction`.
        """
        import drjit as dr

        (h, waves, u), (x, y, sx, sy) = at, places
        # These sums over frequencies have the same phases as the sum over nodes, including the sign.
        to = h * x, h * y
        re, im = _turned(*_sums(to, (sx, sy, *back)), waves)
        along_x = _turned(*_sums(to, (sx, sy, sx * back[0], sx * back[1])), waves)
        along_y = _turned(*_sums(to, (sx, sy, sy * back[0], sy * back[1])), waves)
        factor = 4 * math.pi * h * h * u
        by_h = dr.sum(factor * (x * along_x[1] + y * along_y[1])) + 2 * total / h
        return by_h, -factor * im, 2 * h * h * re


def _turned(re: Array, im: Array, turns: Array) -> tuple[Array, Array]:
    """Return (re + i im) exp(2πi turns)."""
    import drjit as dr

    sin, cos = dr.sincos(2 * math.pi * (turns - dr.round(turns)))
    return re * cos - im * sin, re * sin + im * cos


def _sums(to: tuple[Array, Array], of: Sequence[Array]) -> tuple[Array, Array]:
    """Return the real and imaginary part of Σ (a + ib) exp(-2πi (fx x + fy y)) at every (fx, fy).

    to: fx, fy (point,)
    of: x, y, a, b (term,)
    """
    import drjit as dr

    types, count = precision("float64"), dr.width(of[0])
    dr.eval(*to, *of)

    def add(j: Array, re: Array, im: Array) -> tuple[Array, Array, Array]:
        x, y, a, b = (dr.gather(types.Float64, part, j) for part in of)
        turns = -x * to[0] - y * to[1]
        sin, cos = dr.sincos(types.Float64(2 * math.pi) * (turns - dr.round(turns)))
        return j + 1, re + a * cos - b * sin, im + a * sin + b * cos

    start, zero = dr.zeros(types.Index, dr.width(to[0])), dr.zeros(types.Float64, dr.width(to[0]))
    last = dr.opaque(types.Index, count)
    _, re, im = dr.while_loop((start, zero, zero), lambda j, re, im: j < last, add, max_iterations=-1)
    return re, im
