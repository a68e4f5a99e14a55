"""Contrast over spatial frequency, and one number for an eye.

Where the PSF carries derivatives, so do these numbers: they are Dr.Jit arrays then, NumPy arrays otherwise.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from optics.numerics.accuracy import AccuracyError
from optics.numerics.arguments import flag, in_range, positive, reals, shown
from optics.numerics.autodiff import Array, Scalar, number, plain, to_user
from optics.numerics.grid import Grid
from optics.numerics.precision import opaque, precision
from optics.point_spread.mixture import Mixture, a_mixture, flat, mixed
from optics.point_spread.modulation_transfer import MTF
from optics.point_spread.psf_result import PSFResult
from optics.point_spread.request import Request

__all__ = ["combined_mtf", "image_quality", "mtf"]

HELD_TOO_MUCH = 1e-2  # choice: above all that arrives, by which sums may err
GROWTHS = 3  # choice: windows that are tried
ROOM = 0.5  # choice: half steps, each a factor of √2, that a grown window is wider than it must be


def mtf(result: PSFResult | Mixture, arriving: Any = None, tolerance: float = 0.02) -> MTF:
    """|F{PSF}| over all the light that arrives (Goodman, Introduction to Fourier Optics, §6.3.2). Of a `WhitePSF` one
    of each type of receptor.

    arriving: what of the pupil's power arrives on the unbounded plane, a number or (wavelength,), in (0, 1]. None: all
        but what the pupil's edge, and slopes of its relief beyond grazing, make evanescent.
    tolerance: of any contrast. What the window loses of the light may be missing at any frequency, and samples further
        apart than 1/(2 cutoff) fold frequencies onto each other: the same light is then looked at through a wider or
        finer window of its own.

    Raises:
        ValueError: arriving has another shape, or less arrives than is in the window (but for a hundredth).
        AccuracyError: the samples or the window cannot carry contrasts to the tolerance, and others cannot be had; says
            which would do.
    """
    positive("tolerance", tolerance, "contrast")
    if not isinstance(result, PSFResult):
        if arriving is not None:
            raise ValueError("arriving: must be None for a mixture of wavelengths, each of which has its own")
        mixture: MTF = a_mixture(result).mtf(tolerance)
        return mixture
    light, unsure = _arriving(result, arriving)
    known = light.numpy()
    seen = _wide(result.with_pitch(0.5 / result.highest_cutoff, "the MTF"), known, tolerance)
    lost = np.maximum(known - plain(seen.held), 0)
    error = (lost + unsure + seen.sum_error) / known
    if float(error.max()) > tolerance and tolerance < 1:
        raise AccuracyError(
            f"tolerance = {tolerance:g}: contrasts err by up to {float(error.max()):.2g}, of which the picture's own "
            f"error is {float(seen.sum_error.max()):.2g}, light beyond the window {float(lost.max()):.2g}, and light "
            f"that may never arrive {float(unsure.max()):.2g} (arriving= says how much does): widen it, or ask for a "
            "better PSF"
        )
    return _transformed(seen, light, error)


def combined_mtf(result: PSFResult, weights: np.ndarray, tolerance: float) -> MTF:
    """As `mtf`, of sums of the PSF's wavelengths: weights (sum, wavelength), of which some may be below 0."""
    positive("tolerance", tolerance, "contrast")
    light, unsure = _arriving(result, None)
    known = light.numpy()
    seen = _wide(result.with_pitch(0.5 / float(result.cutoff.max()), "the MTF"), known, tolerance)
    missing = np.maximum(known - plain(seen.held), 0) + unsure + seen.sum_error
    error = np.abs(weights) @ missing / (weights @ known)
    if float(error.max()) > tolerance and tolerance < 1:
        raise AccuracyError(f"tolerance = {tolerance:g}: contrasts err by up to {float(error.max()):.2g}: widen it")
    shortest = np.array([result.wavelengths[row != 0].min() for row in weights])
    sums = replace(seen, tensor=mixed(seen.tensor, weights), wavelengths=shortest, requests=())
    arriving = mixed(precision("float64").Tensor(light, (len(known), 1)), weights)
    return _transformed(sums, flat(arriving), error)


def _wide(result: PSFResult, known: np.ndarray, tolerance: float) -> PSFResult:
    """Through a window that loses no more than the tolerance. Diffracted light falls like r⁻³: what a window loses goes
    with the inverse of its width. Widths and pitches come in steps: a small change of the pupil changes none."""
    seen, coarsest = result, 0.5 / result.highest_cutoff
    for _ in range(GROWTHS):
        lost = float((1 - plain(seen.held) / known).max())
        if lost <= tolerance or tolerance >= 1:
            break
        half = max(seen.tensor.shape[1:]) * seen.dx / 2
        half *= 2 ** (math.ceil(2 * math.log2(lost / tolerance) + ROOM) / 2)
        pitch = seen.dx * max(1, math.floor(coarsest / seen.dx * (1 + 1e-9)))
        side = 2 * math.ceil(half / pitch - 1e-6) + 1
        seen = seen.through(Grid((side, side), pitch, seen.centre), "the MTF")
    return seen


def _transformed(seen: PSFResult, light: Array, error: np.ndarray) -> MTF:
    """light: all that arrives, (wavelength,), with derivatives."""
    import drjit as dr

    types = precision("float64")
    waves, (height, width) = seen.tensor.shape[0], seen.tensor.shape[1:]
    values, arrives = types.Float(flat(seen.tensor)), types.Float(light)
    held = dr.block_reduce(dr.ReduceOp.Add, values, height * width) * seen.dx**2
    whole = dr.repeat(dr.maximum(arrives, held), height * width)
    return MTF.of(types.Tensor(values * seen.dx**2 / whole, (waves, height, width)), seen.dx, seen.cutoff, error)


def _arriving(result: PSFResult, arriving: Any) -> tuple[Array, np.ndarray]:
    """Share of the light on the opening that arrives anywhere, and how unsure that is, (wavelength,)."""
    types = precision("float64")
    if arriving is None:
        return _not_evanescent(result)
    held, known = plain(result.power), reals("arriving", arriving)
    if known.shape not in ((), held.shape):
        raise ValueError(f"arriving has shape {known.shape}: must be a number, or one per wavelength {held.shape}")
    if not ((known > 0) & (known <= 1) & (known > held - HELD_TOO_MUCH)).all():
        raise ValueError(f"arriving = {shown(arriving)}: must be in (0, 1], not less than the window's {shown(held)}")
    return types.Float(np.full(held.shape, known)), np.zeros(held.shape)


def _not_evanescent(result: PSFResult) -> tuple[Array, np.ndarray]:
    """All but evanescent light, and how unsure that is.

    A straight edge has 1/(2π²f) of |its spectrum|² per length beyond the frequency f: of an aperture with perimeter P
    and area A the share λP/(2π²A) is evanescent, times what a mask leaves of the light there more than elsewhere. So
    is what the relief bends beyond grazing.
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
    if result.can_be_seen_anew:
        bent = np.array([_bent_beyond_grazing(request) for request in result.requests])
        bent = bent if result.shares is None else np.atleast_1d(result.shares @ bent)
    return (1 - edge) * types.Float(1 - bent) * light, number(light) * (np.square(edge.numpy()) + bent)


def _bent_beyond_grazing(request: Request) -> float:
    """Share of the pupil's light."""
    pupil = request.beam.pupil
    x, _ = pupil.slopes(request.beam.wavelength, request.beam.source).rays(1.0, request.beam.index)
    return float(np.mean(~np.isfinite(x)))


def image_quality(
    result: PSFResult | Mixture,
    nyquist: float,
    throughput: Scalar = 1.0,
    noise_sigma: float = 0.0,
    tolerance: float = 0.02,
    with_error: bool = False,
) -> np.ndarray | Array:
    """Throughput times the area of the MTF above the noise floor, up to the retina's Nyquist frequency, (wavelength,).

        IQ = T / f_N ∫_0^f_N max(MTF(f) - σ / T, 0) df,   in [0, 1]

    The contrast that noise drowns, σ / T, rises as the pupil closes. After Tiwary, Young et al. (2025).

    nyquist: f_N = 1 / (2 receptor pitch) [1/m]. throughput: T = a². noise_sigma: σ in units of the signal.
    tolerance: see `optics.mtf`. with_error: whether to return (value, predicted error), each (wavelength,).

    Raises:
        ValueError: names argument, value and valid range.
        AccuracyError: see `optics.mtf`.
    """
    import drjit as dr

    positive("nyquist", nyquist, "1/m")
    in_range("throughput", throughput, 0, 1, carried=True)
    in_range("noise_sigma", noise_sigma, 0, 1e6)
    flag("with_error", with_error)
    transfer = mtf(result, tolerance=tolerance)
    waves = transfer.tensor.shape[0]
    if number(throughput) == 0:
        return (np.zeros(waves), np.zeros(waves)) if with_error else np.zeros(waves)
    types = precision("float64")
    f = np.linspace(0, nyquist, 257)
    light = opaque(types, throughput)
    contrast = types.Float(flat(transfer.profile(f)))
    above = light * dr.maximum(contrast - noise_sigma / light, 0)
    value = to_user(types.Tensor(_mean_over(above, f.size, 1), (waves,)))
    if not with_error:
        return value
    # Twice the step would be four times as far off, or twice at a corner.
    unsure = np.abs(plain(value) - plain(_mean_over(above, f.size, 2)))
    return value, number(throughput) * transfer.predicted_error + unsure


def _mean_over(values: Array, n: int, step: int) -> Array:
    """Trapezoidal mean of every n values of a flat array, of which each `step`-th is taken."""
    import drjit as dr

    weight = np.zeros(n)
    weight[::step] = step / (n - 1)
    weight[[0, -1]] /= 2
    types, sums = precision("float64"), len(values) // n
    return dr.block_reduce(dr.ReduceOp.Add, values * types.Float(np.tile(weight, sums)), n)
