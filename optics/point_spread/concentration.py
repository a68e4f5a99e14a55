"""Concentration of the light: the maximum of a PSF relative to a perfect lens, and the power within a circle.

If the PSF carries derivatives, the results are Dr.Jit arrays that carry derivatives. Otherwise they are NumPy arrays.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from optics.apertures.soft_edge import SoftEdge
from optics.numerics.accuracy import AccuracyError
from optics.numerics.arguments import flag, point_2d, reals, shown
from optics.numerics.autodiff import Array, number, plain, to_user
from optics.numerics.grid import Grid
from optics.numerics.precision import opaque, precision
from optics.point_spread.circle_sums import SoftCircles, soft_sums, sums_of_cells
from optics.point_spread.mixture import Mixture, a_mixture, flat
from optics.point_spread.psf_result import PSFResult

__all__ = ["encircled_energy", "strehl_ratio"]

AT_A_PEAK = 1 / 32  # choice: pitch in units of 1/cutoff at which the fit of a paraboloid has the error PARABOLOID_ERROR
LOBES = 0.4  # choice: coarsest pitch in units of 1/cutoff at which samples miss no lobe
BETWEEN = 1 / 16  # choice: pitch in units of 1/cutoff at which the spline is evaluated
MOST_SPLINED = 20_000  # choice, limited by time: number of brightest samples around which the spline is evaluated
NOT_YET = 0.9  # choice: factor on the lower bound for samples next to the maximum, since the PSF itself has errors
CLIMBS = 8  # choice: largest number of windows in the search, each moved to the brightest sample of the previous one
NEIGHBOURHOOD = 9  # choice: samples along a side of such a window
PARABOLOID_ERROR = 3e-5
OF_A_MASK = 1e-6  # choice: neglected level of a mask's spectrum, for the maximum without aberration
RIPPLE = 1e-5  # choice: ripple of the circle's spectrum
CELLS = 20.0  # choice: error of a circle's edge between cells, in units of the ripple
SPREAD = 0.1  # choice: lower limit of the error in a circle, as a fraction of the error in the whole window
DIGITS = 10.0  # choice: digits of the maximum without aberration
FINE = 1 / 3  # choice: coarsest pitch for circles in units of 1/cutoff; finer pitches need less area beyond a circle


def strehl_ratio(result: PSFResult | Mixture, with_error: bool = False) -> Any:
    """Return the maximum of the PSF relative to that of the same aperture without aberration, (wavelength,).

    The result for a `WhitePSF` is (type,). The wave without aberration is spherical and converges on the point where
    the axis hits the sensor. Its field at this point is, with L = √(z² + r²),

        U = ∫ z/(2πL²) (1/L - ik) dξ

    the first Rayleigh-Sommerfeld integral of exp(-ikL(r)). Its modulus for a circle is |1 - z/L - ikz ln(L/z)|. The
    maximum is searched near the brightest sample. If the samples are too coarse, finer samples are computed there. The
    maximum of a mean over wavelengths (`PSFResult.mean`) is divided by the mean of the maxima without aberration.

    with_error: True to return (value, predicted error), each (wavelength,).

    Raises:
        AccuracyError: the maximum lies outside the window; the PSF is brighter at a point outside, where rays land; or
            the samples are too coarse and finer ones cannot be computed. The message states which samples are
            sufficient.
    """
    import drjit as dr

    flag("with_error", with_error)
    if not isinstance(result, PSFResult):
        return a_mixture(result).strehl_ratio(with_error)
    types = precision("float64")
    peaks, errors = zip(*(_peak(result, index) for index in range(result.tensor.shape[0])), strict=True)
    for index, found in enumerate(peaks):
        _refuse_brighter_outside(result, index, number(found) * (1 + errors[index]))
    peak = types.Float(peaks[0] if len(peaks) == 1 else dr.concat(list(peaks)))
    mixed = result.shares is not None and result.can_recompute
    waves = [request.beam.wavelength for request in result.requests] if mixed else result.wavelengths
    ideal = _unaberrated(result, np.array(waves))
    if mixed:
        ideal = dr.sum(ideal * types.Float(np.asarray(result.shares)))
    ratio = types.Tensor(peak / ideal, (len(peaks),))
    return (to_user(ratio), np.array(errors) * ratio.numpy()) if with_error else to_user(ratio)


def _unaberrated(result: PSFResult, wavelengths: np.ndarray) -> Array:
    """Return the maximum of the PSF of the same aperture without aberration, (wavelength,), flat."""
    import drjit as dr

    types = precision("float64")
    mask, own = result.pupil.mask, result.pupil.radius
    bends = 0.0 if mask is None else mask.bandwidth(OF_A_MASK, own) * own
    # Obliquity factors add no phase, but they are not polynomials: they have poles at the height z.
    poles = DIGITS * np.log(10) / (2 * np.pi) * own / number(result.sensor_distance)
    nodes = result.pupil.aperture.nodes(0.5 + bends + poles, DIGITS)
    radius, z = opaque(types, result.pupil.aperture_radius), opaque(types, result.sensor_distance)
    weight = types.Float(nodes.weight)
    slant = dr.sqrt(z * z + radius * radius * types.Float(nodes.x**2 + nodes.y**2))
    size = weight * z / (2 * np.pi * slant * slant)
    wavenumber = types.Float(
        np.array([2 * np.pi * result.pupil.index_behind(at) / at for at in map(float, wavelengths)])
    )
    if mask is not None:
        size = size * dr.abs(result.pupil.amplitude(types.Float64(nodes.x), types.Float64(nodes.y), types))
    near, far = dr.sum(size / slant), dr.sum(size) * wavenumber
    return (near * near + far * far) * radius * radius / result.pupil.aperture.area


def _peak(result: PSFResult, index: int) -> tuple[Array, float]:
    """Return the highest value near the brightest sample at one wavelength, and its relative error."""
    fine = AT_A_PEAK / float(result.cutoff[index])
    image, wanted = result.psf[index], "the Strehl ratio"
    if result.holds_cells or (min(image.shape) > 2 and result.dx <= fine and not _at_rim(image)):
        return _vertex(result, index)
    if not (result.can_recompute or _at_rim(image)) and result.dx * float(result.cutoff[index]) <= LOBES:
        return _vertex(result, index)
    seen = result.with_pitch(LOBES / result.highest_cutoff, wanted)
    centre, pitch = _brightest(seen, index), min(seen.dx, fine)
    for _ in range(CLIMBS):
        _check_inside(result, centre)
        seen = result.recompute_on(Grid.square(NEIGHBOURHOOD, pitch).moved(centre), wanted, slice(index, index + 1))
        if not _at_rim(seen.psf[0]):
            return _vertex(seen, 0)
        row, column = np.unravel_index(seen.psf[0].argmax(), seen.psf[0].shape)
        centre = float(seen.x[column]), float(seen.y[row])
    raise AccuracyError(f"no peak was found within {CLIMBS} windows of {NEIGHBOURHOOD} samples, {pitch:.3g} m apart")


def _brightest(result: PSFResult, index: int) -> tuple[float, float]:
    """Return the point (x, y) at which the spline through the samples is brightest.

    The brightest sample need not belong to the highest lobe. A non-negative function with the maximum p and no
    frequency beyond the cutoff f is at least p cos²(πfd) at a distance d < 1/(2f) from the maximum (M. Riesz 1914). The
    sample nearest the maximum therefore has at least this value, with d the largest possible distance of that sample.
    All samples above it are searched.
    """
    from scipy.ndimage import map_coordinates, spline_filter

    image = result.psf[index].astype(np.float64)
    apart = result.dx * (result.highest_cutoff if result.shares is not None else float(result.cutoff[index]))
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


def _refuse_brighter_outside(result: PSFResult, index: int, peak: float) -> None:
    """Raise an AccuracyError if the PSF is brighter outside the window, at a point that rays hit."""
    rays = result.requests[index].problem.rays if result.can_recompute and not result.holds_cells else None
    if rays is None or not len(rays):
        return
    pitch = LOBES / result.highest_cutoff
    for at in rays.densest():
        beyond = [max(s[0] - place, place - s[-1]) for place, s in zip(at, (result.x, result.y), strict=True)]
        if max(beyond) <= result.dx:
            continue
        window = Grid.square(NEIGHBOURHOOD, pitch).moved(at)
        there = result.recompute_on(window, "the Strehl ratio", slice(index, index + 1))
        if float(there.psf.max()) > peak * (1 + there.plan.predicted_error):
            raise AccuracyError(
                f"rays land around ({at[0]:.3g}, {at[1]:.3g}) m, outside the window, where the PSF is brighter: the "
                "Strehl ratio needs a window that contains the peak; widen it or move its centre"
            )


def _vertex(result: PSFResult, index: int) -> tuple[Array, float]:
    """Return the maximum of the paraboloid through the brightest sample and its neighbours, and its relative error."""
    import drjit as dr

    types, (_, height, width) = precision("float64"), result.tensor.shape
    image = result.psf[index].astype(np.float64)
    row, column = (int(n) for n in np.unravel_index(image.argmax(), image.shape))
    values, start = types.Float(flat(result.tensor)), index * height * width

    def value(i: int, j: int) -> Array:
        return dr.gather(types.Float, values, types.Index(start + i * width + j))

    peak = value(row, column)
    if not result.holds_cells:
        left, right, below, above = (value(row + i, column + j) for i, j in ((0, -1), (0, 1), (-1, 0), (1, 0)))
        corners = [value(row + i, column + j) * (i * j / 4) for i in (-1, 1) for j in (-1, 1)]
        # The maximum of p + g·x - xᵀBx/2 lies at x = B⁻¹g and exceeds p by gᵀB⁻¹g/2.
        gx, gy, bxy = (right - left) / 2, (above - below) / 2, -sum(corners[1:], corners[0])
        bxx, byy = 2 * peak - left - right, 2 * peak - below - above
        determinant = bxx * byy - bxy * bxy
        rise = (byy * gx * gx - 2 * bxy * gx * gy + bxx * gy * gy) / (2 * dr.maximum(determinant, 1e-300))
        peak = peak + dr.select((determinant > 0) & (bxx > 0), rise, 0)
    around = float(np.linalg.norm(image)) / float(image[row, column])
    plan = result.plans[index if len(result.plans) > 1 else 0]
    # Error for a cosine at the cutoff frequency whose peak lies halfway between samples.
    coarse = (2 * math.pi * result.dx * float(result.cutoff[index])) ** 4 / 170
    return peak, plan.predicted_error * around + max(PARABOLOID_ERROR, 0.0 if result.holds_cells else coarse)


def encircled_energy(
    result: PSFResult | Mixture,
    radii: np.ndarray | float,
    centre: tuple[float, float] | None = None,
    with_error: bool = False,
) -> Any:
    """Return the fraction of the pupil's power within `radii` [m] of `centre` (x, y) [m], (wavelength, radius).

    The result for a `WhitePSF` is (type, radius). It is a weighted sum over samples. The weights are the circle,
    convolved with a kernel whose spectrum is 1 at all frequencies of the intensity and 0 at frequencies that alias onto
    them. The sum therefore equals the integral over the sharp circle. It includes samples beyond the circle, which are
    computed if the window does not contain them.

    centre: None for the middle of the PSF's window.
    with_error: True to return (value, predicted error).

    Raises:
        ValueError: a radius is negative or extends beyond the window.
        AccuracyError: the samples are too coarse, or too few around the circle, and other samples cannot be computed.
            The message states which samples are sufficient.
    """
    flag("with_error", with_error)
    if not isinstance(result, PSFResult):
        return a_mixture(result).encircled_energy(radii, centre, with_error)
    wanted = np.atleast_1d(reals("radii", radii))
    if wanted.ndim > 1 or not wanted.size:
        raise ValueError(f"radii has shape {wanted.shape}: must be a number or a row of them [m]")
    middle = result.centre if centre is None else point_2d("centre", centre)
    x, y = result.x - middle[0], result.y - middle[1]
    edge = min(-x[0], x[-1], -y[0], y[-1])
    if edge < 0:
        raise ValueError(f"centre = {shown(centre)}: must lie within the PSF's window, around {shown(result.centre)}")
    if not ((wanted >= 0) & (wanted <= edge * (1 + 1e-9))).all():
        raise ValueError(f"radii = {shown(radii)}: must be in [0, {edge:g}] m, inside the PSF's window")
    seen, kernel = _around(result, middle, float(wanted.max()), edge)
    distance = np.hypot(seen.x[None, :] - middle[0], seen.y[:, None] - middle[1]).ravel()
    types, values = precision("float64"), precision("float64").Float(flat(seen.tensor))
    if kernel is None:
        sums = sums_of_cells(values, distance, wanted, seen.dx)
    else:
        unit = result.highest_cutoff
        sums = soft_sums(SoftCircles.around(distance * unit, wanted * unit, kernel), values)
    total = to_user(types.Tensor(sums * seen.dx**2, (seen.tensor.shape[0], wanted.size)))
    if not with_error:
        return total
    # The PSF's error may be concentrated in the circle, even if the circle is dark.
    share = np.maximum(plain(total), SPREAD * plain(seen.window_sums)[:, None]) / plain(seen.window_sums)[:, None]
    bright = np.pi * wanted**2 * seen.psf.max(axis=(1, 2))[:, None]
    return total, seen.sum_error[:, None] * share + RIPPLE * (CELLS if kernel is None else np.minimum(bright, 1.0))


def _around(
    result: PSFResult, middle: tuple[float, float], radius: float, edge: float
) -> tuple[PSFResult, SoftEdge | None]:
    """Return a PSF whose samples suffice for sums within a circle, and the kernel (None for means over cells).

    Samples are fine enough, and they extend beyond the circle by the reach of the kernel.

    radius: radius [m] of the circle.
    edge: distance [m] from its centre to the outermost samples.
    """
    if result.holds_cells:
        return result, None
    cutoff = result.highest_cutoff
    if result.dx <= FINE / cutoff:
        kernel = _kernel(result.dx, cutoff, edge - radius)
        if radius + kernel.reach / cutoff <= edge:
            return result, kernel
    pitch = min(result.dx, FINE / cutoff)
    kernel = _kernel(pitch, cutoff, math.inf)
    half = math.ceil((radius + kernel.reach / cutoff) / pitch)
    window = Grid((2 * half + 1, 2 * half + 1), pitch, middle)
    return result.recompute_on(window, "encircled energy"), kernel


def _kernel(dx: float, cutoff: float, room: float) -> SoftEdge:
    """Return a kernel in units of 1/cutoff that passes the intensity's frequencies and blocks their aliases.

    Its spectrum ends as early as its reach permits, because sums then need fewer nodes.

    room: largest reach [m].
    """
    last = 1 / (dx * cutoff) - 1
    latest = SoftEdge(1.0, last, RIPPLE)
    if room <= 0:
        return latest
    return SoftEdge(1.0, min(last, max(1 / FINE - 1, 1 + latest.reach * (last - 1) / (room * cutoff))), RIPPLE)
