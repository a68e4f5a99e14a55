"""Fraction of the pupil's light that arrives on an unbounded plane. The rest is evanescent."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from optics.apertures.circular import Circle
from optics.methods.problem import Problem
from optics.numerics.arguments import reals, shown
from optics.numerics.autodiff import Array, number, plain
from optics.numerics.precision import opaque, precision
from optics.point_spread.psf_result import PSFResult
from optics.point_spread.request import Request

__all__ = ["arriving_light"]

# Choice: the light in the window may exceed the light that arrives by this amount, because sums have errors.
HELD_TOO_MUCH = 1e-2
DIGITS = 5.0  # choice: digits of the sum over the spectrum
MOST_PAIRS = 1e7  # choice: largest number of pairs of nodes and frequencies in this sum; they take about half a second
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
    """Return the fraction of light that is not evanescent, and its uncertainty.

    The squared spectrum of a straight edge, integrated over frequencies above f, is 1/(2π²f) per length of the edge.
    For an aperture of perimeter P and area A, the fraction λP/(2π²A) is therefore evanescent. This fraction is
    multiplied by the mask's transmission along the edge, relative to that of the whole aperture. Light that the relief
    bends beyond grazing is evanescent, too.

    If this estimate is too uncertain, and the pupil is at most some wavelengths wide, the spectrum of the light behind
    the pupil is summed instead. Derivatives are always those of the estimate.
    """
    import drjit as dr

    pupil, outline, types = result.pupil, result.pupil.aperture.outline, precision("float64")
    wavelength = types.Float(np.array([at / pupil.index_behind(at) for at in map(float, result.wavelengths)]))
    ratio = outline.length / (2 * math.pi**2 * pupil.aperture.area)
    light, rim = pupil.transmission, 1.0
    if pupil.mask is not None:
        x, y = (types.Float64(np.ascontiguousarray(at)) for at in outline.points().T)
        rim = dr.mean(dr.square(pupil.amplitude(x, y, types))) / light
    edge = dr.minimum(wavelength * ratio / opaque(types, pupil.aperture_radius) * rim, 0.5)
    bent = np.zeros(len(result.wavelengths))
    if result.can_recompute:
        bent = _mean(result, [_bent_beyond_grazing(request) for request in result.requests])
    found, unsure = (1 - edge) * types.Float(1 - bent) * light, number(light) * (np.square(edge.numpy()) + bent)
    if not result.can_recompute or float(unsure.max()) <= SURE:
        return found, unsure
    sums = [_summed(request) for request in result.requests]
    if any(one is None for one in sums):
        return found, unsure
    exact = _mean(result, sums)
    return found * types.Float(exact / found.numpy()), np.minimum(unsure, SURE)


def _mean(result: PSFResult, values: list[Any]) -> np.ndarray:
    """Return one value per wavelength, from one value per request."""
    found = np.array(values)
    return found if result.shares is None else np.atleast_1d(result.shares @ found)


def _bent_beyond_grazing(request: Request) -> float:
    """Return the fraction of the pupil's light that the relief bends beyond grazing."""
    pupil = request.beam.pupil
    x, _ = pupil.slopes(request.beam.wavelength, request.beam.source).rays(1.0, request.beam.index)
    return float(np.mean(~np.isfinite(x)))


def _summed(request: Request) -> float | None:
    """Return the fraction of the pupil's light at frequencies below 1/λ; None if the sum is too long.

    It is ∫ |F(u)|² df / A over |f| < 1/λ, with the field u behind the pupil and the area A of its aperture. Lengths are
    in units of the radius. |F(u)|² has no structure finer than one cycle per diameter.
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
    if (counted or 0) * len(seen.weight) > MOST_PAIRS:
        return None
    nodes = aperture.nodes(phase, DIGITS)
    if len(nodes.weight) * len(seen.weight) > MOST_PAIRS:
        return None
    types = precision("float64")
    x, y = (types.Float64(np.ascontiguousarray(at)) for at in (nodes.x, nodes.y))
    waves = beam.waves(x * problem.radius, y * problem.radius, types)
    u = nodes.weight * np.exp(2j * np.pi * plain(waves))
    if beam.pupil.mask is not None:
        u = u * plain(beam.pupil.amplitude(x, y, types))
    turns = highest * (np.multiply.outer(seen.x, nodes.x) + np.multiply.outer(seen.y, nodes.y))
    spectrum = np.square(np.abs(np.exp(-2j * np.pi * turns) @ u))
    return float((spectrum @ seen.weight) * highest**2 / aperture.area)
