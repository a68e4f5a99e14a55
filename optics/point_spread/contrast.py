"""Contrast as a function of spatial frequency, and the image quality of an eye as one number.

If the PSF carries derivatives, the results are Dr.Jit arrays that carry derivatives. Otherwise they are NumPy arrays.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from optics.numerics.accuracy import AccuracyError, rounded_up
from optics.numerics.arguments import flag, in_range, positive
from optics.numerics.autodiff import Array, Scalar, number, plain, to_user
from optics.numerics.grid import Grid
from optics.numerics.precision import opaque, precision
from optics.point_spread.arriving import arriving_light
from optics.point_spread.mixture import Mixture, a_mixture, flat, mixed
from optics.point_spread.modulation_transfer import MTF
from optics.point_spread.psf_result import MOST_AGAIN, PSFResult
from optics.point_spread.window_loss import ErrorCauses

__all__ = ["combined_mtf", "image_quality", "mtf"]

GROWTHS = 3  # choice: largest number of enlarged windows
ROOM = 0.5  # choice: an enlarged window exceeds the necessary width by √2 to this power


def mtf(result: PSFResult | Mixture, arriving: Any = None, tolerance: float = 0.02) -> MTF:
    """Return the contrast |F{PSF}| / (all the light that arrives on the sensor's plane), with the Fourier transform F.

    The contrast is 1 at frequency 0. For a `WhitePSF` there is one MTF per receptor type. Source: Goodman, Introduction
    to Fourier Optics, §6.3.2.

    arriving: fraction of the pupil's power that arrives on the plane of the sensor, inside or outside the window, a
        number or (wavelength,), in (0, 1]. None: all transmitted light, except the part that becomes evanescent at the
        pupil's edge and at steep slopes of its relief.
    tolerance: largest error of any contrast. Light outside the window causes errors of contrasts, mainly at frequencies
        near 0. If samples are more than 1/(2 cutoff) apart, frequencies are aliased. If necessary, the PSF is
        recomputed over a wider window or on finer samples.

    Raises:
        ValueError: arriving has the wrong shape, is outside (0, 1], is given for a `WhitePSF`, or is more than 0.01
            below the fraction of the pupil's power that arrives within the window. The tolerance is not positive, or
            `result` is not a PSF.
        AccuracyError: the samples are too coarse or the window is too small for the tolerance, and the PSF cannot be
            recomputed on sufficient samples. The message states a remedy.
    """
    positive("tolerance", tolerance, "contrast")
    if not isinstance(result, PSFResult):
        if arriving is not None:
            raise ValueError("arriving: must be None for a mixture of wavelengths, which have different values")
        mixture: MTF = a_mixture(result).mtf(tolerance)
        return mixture
    light, unsure = arriving_light(result, arriving)
    known = light.numpy()
    seen = _wide(result.with_pitch(0.5 / result.highest_cutoff, "the MTF"), known, unsure, tolerance)
    lost = np.maximum(known - plain(seen.window_sums), 0)
    causes = ErrorCauses((lost + unsure) / known, unsure / known, seen.sum_error / known)
    error = causes.total
    if float(error.max()) > tolerance and tolerance < 1:
        raise AccuracyError(
            f"tolerance = {tolerance:g}: contrasts have errors of up to {float(error.max()):.2g} (PSF "
            f"{float(seen.sum_error.max()):.2g}, light beyond the window {float(lost.max()):.2g}, light that may never "
            f"arrive {float(unsure.max()):.2g}): set arriving= if it is known, widen the tolerance, or compute a more "
            "accurate PSF"
        )
    return _transformed(seen, light, causes)


def combined_mtf(result: PSFResult, weights: np.ndarray, tolerance: float) -> MTF:
    """Return the MTF of weighted sums over the PSF's wavelengths, see `mtf`.

    weights: (sum, wavelength). They may be negative.
    tolerance: largest error of any contrast.

    Raises:
        ValueError: the tolerance is not positive.
        AccuracyError: see `mtf`.
    """
    positive("tolerance", tolerance, "contrast")
    light, unsure = arriving_light(result, None)
    known = light.numpy()
    seen = _wide(result.with_pitch(0.5 / float(result.cutoff.max()), "the MTF"), known, unsure, tolerance)
    lost, size = np.maximum(known - plain(seen.window_sums), 0) + unsure, np.abs(weights)
    causes = ErrorCauses(*(size @ part / (weights @ known) for part in (lost, unsure, seen.sum_error)))
    error = causes.total
    if float(error.max()) > tolerance and tolerance < 1:
        raise AccuracyError(f"tolerance = {tolerance:g}: contrasts have errors of up to {float(error.max()):.2g}")
    shortest = np.array([result.wavelengths[row != 0].min() for row in weights])
    sums = replace(seen, tensor=mixed(seen.tensor, weights), wavelengths=shortest, requests=())
    arriving = mixed(precision("float64").Tensor(light, (len(known), 1)), weights)
    return _transformed(sums, flat(arriving), causes)


def _wide(result: PSFResult, known: np.ndarray, unsure: np.ndarray, tolerance: float) -> PSFResult:
    """Return the PSF over a window that is enlarged until it misses at most the fraction `tolerance` of arriving light.

    The window is enlarged at most three times. The intensity of diffracted light falls like r⁻³ with the distance r, so
    the light that a window misses is inversely proportional to its width. The width of the window and the pitch of its
    samples change in steps, so that a small change of the pupil changes neither.

    known: fraction of the pupil's light that arrives on the plane, (wavelength,).
    unsure: uncertainty of this fraction, (wavelength,).

    Raises:
        AccuracyError: no such window can be computed. If fewer samples would suffice for a larger tolerance
            below 1, the message states this tolerance.
    """
    seen, coarsest = result, 0.5 / result.highest_cutoff
    for _ in range(GROWTHS):
        lost = float((1 - plain(seen.window_sums) / known).max())
        if lost <= tolerance or tolerance >= 1:
            break
        half = max(seen.tensor.shape[1:]) * seen.dx / 2
        half *= 2 ** (math.ceil(2 * math.log2(lost / tolerance) + ROOM) / 2)
        pitch = seen.dx * max(1, math.floor(coarsest / seen.dx * (1 + 1e-9)))
        side = 2 * math.ceil(half / pitch - 1e-6) + 1
        try:
            seen = seen.recompute_on(Grid((side, side), pitch, seen.centre), "the MTF")
        except AccuracyError as refused:
            own = max(seen.tensor.shape[1:]) * seen.dx
            widest = MOST_AGAIN * pitch if seen.can_recompute and side > MOST_AGAIN else own
            part = min(1.0, 2 ** ((1 + ROOM) / 2) * own / widest)
            others = float(((2 * unsure + seen.sum_error) / known).max())
            raise AccuracyError(f"{refused}{_looser(lost * part + others)}") from None
    return seen


def _looser(error: float) -> str:
    """Return advice, for a message, to set the tolerance to `error`, rounded up to one digit.

    The advice is empty if the rounded error is 1 or more.
    """
    enough = rounded_up(error)
    return f"; tolerance={enough:.3g} needs fewer samples" if enough < 1 else ""


def _transformed(seen: PSFResult, light: Array, causes: ErrorCauses) -> MTF:
    """Return the MTF of a PSF whose window is already wide enough.

    light: fraction of the pupil's light that arrives on the plane of the sensor, (wavelength,), with derivatives.
    """
    import drjit as dr

    types = precision("float64")
    waves, (height, width) = seen.tensor.shape[0], seen.tensor.shape[1:]
    values, arrives = types.Float(flat(seen.tensor)), types.Float(light)
    held = dr.block_reduce(dr.ReduceOp.Add, values, height * width) * seen.dx**2
    whole = dr.repeat(dr.maximum(arrives, held), height * width)
    shares = types.Tensor(values * seen.dx**2 / whole, (waves, height, width))
    return MTF.from_shares(shares, seen.window, seen.cutoff, causes)


def image_quality(
    result: PSFResult | Mixture | MTF,
    nyquist: float,
    throughput: Scalar = 1.0,
    noise_sigma: float = 0.0,
    tolerance: float = 0.02,
    with_error: bool = False,
) -> np.ndarray | Array:
    """Return throughput times the MTF's mean height above the noise floor, up to the Nyquist frequency, (wavelength,).

        IQ = T / f_N ∫_0^f_N max(MTF(f) - σ / T, 0) df,   in [0, 1]

    The noise floor σ / T rises as the pupil closes. Source: Tiwary, Young et al. (2025).

    result: a PSF, or its MTF if this is known already.
    nyquist: Nyquist frequency of the retina, f_N = 1 / (2 receptor pitch) [1/m].
    throughput: T in [0, 1], such as a² for a pupil of the relative radius a. T may carry a derivative. If T is 0, the
        result is 0.
    noise_sigma: σ, in units of the signal, 0 to 1e6.
    tolerance: largest error of any contrast of the MTF. It is ignored if `result` is an MTF.
    with_error: True to return (value, predicted error), each (wavelength,).

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
        AccuracyError: see `optics.mtf`.
    """
    import drjit as dr

    positive("nyquist", nyquist, "1/m")
    in_range("throughput", throughput, 0, 1, carried=True)
    in_range("noise_sigma", noise_sigma, 0, 1e6)
    flag("with_error", with_error)
    transfer = result if isinstance(result, MTF) else mtf(result, tolerance=tolerance)
    waves = transfer.tensor.shape[0]
    if number(throughput) == 0:
        return (np.zeros(waves), np.zeros(waves)) if with_error else np.zeros(waves)
    types = precision("float64")
    f = np.linspace(0, nyquist, 257)
    light = opaque(types, throughput)
    profile, errors = transfer.profile(f, with_error=True) if with_error else (transfer.profile(f), None)
    contrast = types.Float(flat(profile))
    above = light * dr.maximum(contrast - noise_sigma / light, 0)
    value = to_user(types.Tensor(_mean_over(above, f.size, 1), (waves,)))
    if errors is None:
        return value
    # The error of a sum with twice the step would be four times as large, or twice as large at a corner of the MTF.
    unsure = np.abs(plain(value) - plain(_mean_over(above, f.size, 2)))
    return value, number(throughput) * errors.mean(axis=1) + unsure


def _mean_over(values: Array, n: int, step: int) -> Array:
    """Return the trapezoidal mean of each group of n consecutive values of a flat array.

    Only every `step`-th value of a group is used.
    """
    import drjit as dr

    weight = np.zeros(n)
    weight[::step] = step / (n - 1)
    weight[[0, -1]] /= 2
    types, sums = precision("float64"), len(values) // n
    return dr.block_reduce(dr.ReduceOp.Add, values * types.Float(np.tile(weight, sums)), n)
