"""The peak of a PSF relative to that of an unaberrated pupil.

If the PSF carries derivatives, the results are Dr.Jit arrays that carry derivatives. Otherwise they are NumPy arrays.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from optics.numerics.accuracy import AccuracyError
from optics.numerics.arguments import flag
from optics.numerics.autodiff import Array, number, to_user
from optics.numerics.grid import Grid
from optics.numerics.precision import opaque, padded_for_packets, precision
from optics.point_spread.mixture import Mixture, a_mixture, flat
from optics.point_spread.psf_result import PSFResult
from optics.point_spread.spot_check import exact_psf

__all__ = ["strehl_ratio"]

AT_A_PEAK = 1 / 32  # choice: pitch in units of 1/cutoff at which the fit of a paraboloid has the error PARABOLOID_ERROR
CLOSER = 4.0  # choice: factor by which points of the direct sum around a peak are closer than AT_A_PEAK
LOBES = 0.4  # choice: coarsest pitch in units of 1/cutoff at which samples miss no lobe
BETWEEN = 1 / 16  # choice: pitch in units of 1/cutoff at which the spline is evaluated
MOST_SPLINED = 20_000  # choice, limited by time: number of brightest samples around which the spline is evaluated
NOT_YET = 0.9  # choice: factor on the lower bound for samples next to the maximum, since the PSF itself has errors
CLIMBS = 8  # choice: largest number of windows in the search, each moved to the brightest sample of the previous one
NEIGHBOURHOOD = 9  # choice: samples along a side of such a window
PARABOLOID_ERROR = 3e-5
OF_A_MASK = 1e-6  # choice: neglected level of a mask's spectrum, for the maximum without aberration
DIGITS = 10.0  # choice: digits of the maximum without aberration


def strehl_ratio(result: PSFResult | Mixture, with_error: bool = False) -> Any:
    """Return the Strehl ratio of a PSF, (wavelength,).

    It is the maximum of the PSF, divided by the maximum of the PSF of the same aperture and mask without aberration.
    The result for a `WhitePSF` has one value per receptor type, (type,). The wave without aberration is spherical and
    converges on the point where the axis hits the sensor. With L = √(z² + r²), its field at this point is

        U = ∫ z/(2πL²) (1/L - ik) dξ

    the first Rayleigh-Sommerfeld integral of exp(-ikL(r)) over the points ξ of the pupil at the distance r from the
    axis, with the wave number k and the sensor's distance z. The modulus of a mask's amplitude transmittance is a
    factor of the integrand. For a circle without a mask, the modulus of U is |1 - z/L - ikz ln(L/z)|, with L at the
    rim. The maximum is searched near the brightest samples. If the samples are too coarse, finer samples are computed
    there. The maximum of a mean over wavelengths (`PSFResult.mean`) is divided by the mean of the maxima without
    aberration, with the same weights. If `result.can_recompute` is False, the maximum of the mean is divided by the
    maximum without aberration at the mean wavelength.

    with_error: True to return (value, predicted error), each (wavelength,).

    Raises:
        ValueError: `result` is not a PSF, or with_error is not a bool.
        AccuracyError: the maximum lies outside the window, or rays land at a place outside the window where the PSF
            exceeds its maximum in the window. The same error results if the samples are too coarse and finer ones
            cannot be computed (the message states which samples are sufficient), or if no peak is found.
    """
    import drjit as dr

    flag("with_error", with_error)
    if not isinstance(result, PSFResult):
        return a_mixture(result).strehl_ratio(with_error)
    types = precision("float64")
    each = [result.of_wavelength(index) for index in range(result.tensor.shape[0])]
    found = [_peak(one) for one in each]
    for one, peak in zip(each, found, strict=True):
        _refuse_brighter_outside(one, number(peak.value) * (1 + peak.error))
    peaks, errors = [peak.value for peak in found], [peak.error for peak in found]
    if with_error:
        errors = [_measured_error(*of) for of in zip(each, found, strict=True)]
    peak = types.Float(peaks[0] if len(peaks) == 1 else dr.concat(peaks))
    mixed = result.shares is not None and result.can_recompute
    waves = [request.beam.wavelength for request in result.requests] if mixed else result.wavelengths
    ideal = _unaberrated(result, np.array(waves))
    if mixed:
        ideal = dr.sum(ideal * types.Float(np.asarray(result.shares)))
    ratio = types.Tensor(peak / ideal, (len(peaks),))
    return (to_user(ratio), np.array(errors) * ratio.numpy()) if with_error else to_user(ratio)


def _unaberrated(result: PSFResult, wavelengths: np.ndarray) -> Array:
    """Return the maximum of the PSF of the same aperture and mask without aberration, a Dr.Jit array (wavelength,)."""
    import drjit as dr

    types = precision("float64")
    mask, own = result.pupil.mask, result.pupil.radius
    bends = 0.0 if mask is None else mask.bandwidth(OF_A_MASK, own) * own
    # Obliquity factors add no phase, but they are not polynomials: they have poles at the height z.
    poles = DIGITS * np.log(10) / (2 * np.pi) * own / number(result.sensor_distance)
    nodes = result.pupil.aperture.nodes(0.5 + bends + poles, DIGITS)
    radius, z = opaque(types, result.pupil.aperture_radius), opaque(types, result.sensor_distance)
    weight = types.Float(nodes.weight)
    slant = dr.sqrt(z * z + radius * radius * types.Float(padded_for_packets(nodes.x**2 + nodes.y**2)))
    size = weight * z / (2 * np.pi * slant * slant)
    wavenumber = types.Float(
        np.array([2 * np.pi * result.pupil.index_behind(at) / at for at in map(float, wavelengths)])
    )
    if mask is not None:
        size = size * dr.abs(result.pupil.amplitude(types.Float64(nodes.x), types.Float64(nodes.y)))
    near, far = dr.sum(size / slant), dr.sum(size) * wavenumber
    return (near * near + far * far) * radius * radius / result.pupil.aperture.area


class Peak(NamedTuple):
    """The maximum of a PSF, a bound of its relative error, and its position (x, y) [m]."""

    value: Array
    error: float
    at: tuple[float, float]


def _peak(result: PSFResult) -> Peak:
    """Return the maximum of a PSF near its brightest samples.

    The PSF has one wavelength, or is a mean over wavelengths (`PSFResult.mean`).

    Raises:
        AccuracyError: the maximum lies outside the window or is not found, or the necessary samples cannot be computed.
    """
    fine = AT_A_PEAK / float(result.cutoff[0])
    image, wanted = result.psf[0], "the Strehl ratio"
    if result.holds_cells or (min(image.shape) > 2 and result.dx <= fine and not _at_rim(image)):
        return _vertex(result)
    if not (result.can_recompute or _at_rim(image)) and result.dx * float(result.cutoff[0]) <= LOBES:
        return _vertex(result)
    seen = result.with_pitch(LOBES / result.highest_cutoff, wanted)
    centre, pitch = _brightest(seen), min(seen.dx, fine)
    for _ in range(CLIMBS):
        _check_inside(result, centre)
        seen = result.recompute_on(Grid.square(NEIGHBOURHOOD, pitch).moved(centre), wanted)
        if not _at_rim(seen.psf[0]):
            return _vertex(seen)
        row, column = np.unravel_index(seen.psf[0].argmax(), seen.psf[0].shape)
        centre = float(seen.x[column]), float(seen.y[row])
    raise AccuracyError(f"no peak was found within {CLIMBS} windows of {NEIGHBOURHOOD} samples, {pitch:.3g} m apart")


def _brightest(result: PSFResult) -> tuple[float, float]:
    """Return the point (x, y) at which the spline through the samples is brightest.

    Samples can miss the peak of a lobe, so the brightest sample need not lie in the highest lobe of the PSF. Let p be
    the maximum of a non-negative function without frequencies beyond the cutoff f. At a distance d < 1/(2f) from the
    maximum, the function is at least p cos²(πfd) (M. Riesz 1914). The sample nearest the maximum is at most half the
    diagonal between samples away from it. With this distance as d, the sample has at least the value p cos²(πfd). The
    surroundings of all samples above this value are searched. If there are more than MOST_SPLINED such samples, only
    the brightest MOST_SPLINED ones are used.
    """
    from scipy.ndimage import map_coordinates, spline_filter

    image = result.psf[0].astype(np.float64)
    apart = result.dx * result.highest_cutoff
    least = NOT_YET * math.cos(math.pi * min(apart / math.sqrt(2), 0.5)) ** 2 * image.max()
    bright = np.flatnonzero(image >= least)
    bright = bright[np.argsort(image.ravel()[bright])[-MOST_SPLINED:]]
    parts = max(1, math.ceil(apart / BETWEEN))
    inside = (np.arange(2 * (parts // 2) + 1) - parts // 2) / parts
    offsets = np.stack(np.meshgrid(inside, inside, indexing="ij")).reshape(2, 1, -1)
    places = np.stack(np.unravel_index(bright, image.shape))[:, :, None] + offsets
    places = np.clip(places.reshape(2, -1), 0, np.array(image.shape)[:, None] - 1)
    finer = map_coordinates(
        spline_filter(image, order=5, mode="mirror"), places, order=5, mode="mirror", prefilter=False
    )
    row, column = places[:, finer.argmax()]
    return float(result.x[0] + column * result.dx), float(result.y[0] + row * result.dx)


def _at_rim(image: np.ndarray) -> bool:
    row, column = np.unravel_index(image.argmax(), image.shape)
    return row in (0, image.shape[0] - 1) or column in (0, image.shape[1] - 1)


def _check_inside(result: PSFResult, at: tuple[float, float]) -> None:
    room = result.dx * (0.5 + 1e-6)
    for place, samples in zip(at, (result.x, result.y), strict=True):
        if not samples[0] - room <= place <= samples[-1] + room:
            raise AccuracyError(
                f"the intensity increases towards ({at[0]:.3g}, {at[1]:.3g}) m, outside the window: the Strehl ratio "
                "needs a window that contains the peak; widen it or move its centre"
            )


def _refuse_brighter_outside(result: PSFResult, peak: float) -> None:
    """Raise an AccuracyError if the PSF exceeds `peak` at a place outside the window where rays land."""
    rays = result.requests[0].problem.rays if result.can_recompute and not result.holds_cells else None
    if rays is None or not len(rays):
        return
    pitch = LOBES / result.highest_cutoff
    for at in rays.densest():
        beyond = [max(s[0] - place, place - s[-1]) for place, s in zip(at, (result.x, result.y), strict=True)]
        if max(beyond) <= result.dx:
            continue
        window = Grid.square(NEIGHBOURHOOD, pitch).moved(at)
        there = result.recompute_on(window, "the Strehl ratio")
        if float(there.psf.max()) > peak * (1 + there.plan.predicted_error):
            raise AccuracyError(
                f"rays land around ({at[0]:.3g}, {at[1]:.3g}) m, outside the window, where the PSF is brighter: the "
                "Strehl ratio needs a window that contains the peak; widen it or move its centre"
            )


def _vertex(result: PSFResult, middle: tuple[int, int] | None = None) -> Peak:
    """Return the maximum of the paraboloid through the sample `middle` and its neighbours.

    The result is the sample itself if the samples are means over squares (`PSFResult.holds_cells`), or if the
    paraboloid has no maximum.

    middle: (row, column); None: the brightest sample.
    """
    import drjit as dr

    types, width = precision("float64"), result.tensor.shape[2]
    image = result.psf[0].astype(np.float64)
    row, column = middle or (int(n) for n in np.unravel_index(image.argmax(), image.shape))
    values = types.Float(flat(result.tensor))

    def value(i: int, j: int) -> Array:
        return dr.gather(types.Float, values, types.Index(i * width + j))

    peak, at = value(row, column), (float(result.x[column]), float(result.y[row]))
    if not result.holds_cells:
        left, right, below, above = (value(row + i, column + j) for i, j in ((0, -1), (0, 1), (-1, 0), (1, 0)))
        corners = [value(row + i, column + j) * (i * j / 4) for i in (-1, 1) for j in (-1, 1)]
        # The maximum of p + g·x - xᵀBx/2 lies at x = B⁻¹g and exceeds p by gᵀB⁻¹g/2.
        gx, gy, bxy = (right - left) / 2, (above - below) / 2, -sum(corners[1:], corners[0])
        bxx, byy = 2 * peak - left - right, 2 * peak - below - above
        determinant = bxx * byy - bxy * bxy
        rise = (byy * gx * gx - 2 * bxy * gx * gy + bxx * gy * gy) / (2 * dr.maximum(determinant, 1e-300))
        curved = (determinant > 0) & (bxx > 0)
        peak = peak + dr.select(curved, rise, 0)
        if curved[0]:
            steps = (byy * gx - bxy * gy) / determinant, (bxx * gy - bxy * gx) / determinant
            at = at[0] + number(steps[0]) * result.dx, at[1] + number(steps[1]) * result.dx
    around = float(np.linalg.norm(image)) / float(image[row, column])
    # Error for a cosine at the cutoff frequency whose peak lies halfway between samples.
    coarse = (2 * math.pi * result.dx * float(result.cutoff[0])) ** 4 / 170
    error = result.plan.predicted_error * around + max(PARABOLOID_ERROR, 0.0 if result.holds_cells else coarse)
    return Peak(peak, error, at)


def _measured_error(result: PSFResult, peak: Peak) -> float:
    """Return the relative error of a peak, found by comparison with the direct sum, but at most the bound `peak.error`.

    The result is this bound if the PSF cannot be recomputed, if its samples are means over cells, or if the direct sum
    would take too long.

    The direct sum is evaluated on 3 x 3 points around the peak, and a paraboloid through them gives the maximum. The
    error of this maximum is proportional to the fourth power of the points' pitch, and it is PARABOLOID_ERROR at the
    pitch AT_A_PEAK / cutoff. The pitch used here is smaller by the factor CLOSER, so the error is PARABOLOID_ERROR /
    CLOSER^4.
    """
    if result.holds_cells or not result.can_recompute:
        return peak.error
    pitch = AT_A_PEAK / CLOSER / result.highest_cutoff
    near = Grid.square(3, pitch).moved(peak.at)
    x, y = (part.ravel() for part in np.meshgrid(near.x, near.y))
    shares = np.ones(1) if result.shares is None else result.shares
    sums = [
        exact_psf(each.beam, each.problem, x, y, number(peak.value), each.planned()[1].seconds)
        for each in result.requests
    ]
    known = [one for one in sums if one is not None]
    if len(known) < len(sums):
        return peak.error
    exact = np.sum([share * values for share, (values, _) in zip(shares, known, strict=True)], axis=0)
    errors = sum(share * error for share, (_, error) in zip(shares, known, strict=True))
    there = replace(result, tensor=exact.reshape(1, 3, 3), dx=pitch, centre=peak.at, shares=None, requests=())
    # The points are so close that any of them may be the brightest, but only the middle one has all neighbours.
    truth = number(_vertex(there, (1, 1)).value)
    off = abs(number(peak.value) / truth - 1) + errors + PARABOLOID_ERROR / CLOSER**4
    return min(float(off), peak.error)
