"""The power within a circle.

If the PSF carries derivatives, the results are Dr.Jit arrays that carry derivatives. Otherwise they are NumPy arrays.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from optics.apertures.soft_edge import SoftEdge
from optics.numerics.arguments import flag, point_2d, reals, shown
from optics.numerics.autodiff import plain, to_user
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.point_spread.circle_sums import SoftCircles, soft_sums, sums_of_cells
from optics.point_spread.mixture import Mixture, a_mixture, flat
from optics.point_spread.psf_result import PSFResult

__all__ = ["encircled_energy"]

RIPPLE = 1e-5  # choice: ripple of the circle's spectrum
CELLS = 20.0  # choice: error of sums over values that are means over cells, in units of the ripple
SPREAD = 0.1  # choice: lower limit of the error in a circle, as a fraction of the error in the whole window
FINE = 1 / 3  # choice: coarsest pitch for circles in units of 1/cutoff; finer pitches need less area beyond a circle


def encircled_energy(
    result: PSFResult | Mixture,
    radii: np.ndarray | float,
    centre: tuple[float, float] | None = None,
    with_error: bool = False,
) -> Any:
    """Return the fraction of the pupil's power within `radii` [m] of `centre` (x, y) [m], (wavelength, radius).

    The result for a `WhitePSF` is (receptor type, radius). The fraction is computed as a weighted sum over samples. The
    weights are the circle's indicator function (1 inside, 0 outside), convolved with a kernel whose spectrum is 1 at
    all frequencies of the intensity and 0 at frequencies that alias onto them. The sum therefore equals the integral
    over the sharp circle. It includes samples beyond the circle, which are computed if the window does not contain
    them. If samples are means over cells (`PSFResult.holds_cells`), each weight is approximately the fraction of the
    cell that lies inside the circle.

    radii: a number or a row of numbers. At 0 the result is 0.
    centre: None for sample n//2 of the PSF.
    with_error: True to return (value, predicted error).

    Raises:
        ValueError: a radius is negative, NaN or extends beyond the outermost samples, the centre lies outside them, or
            `result` is not a PSF.
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
    fraction = np.maximum(plain(total), SPREAD * plain(seen.window_sums)[:, None]) / plain(seen.window_sums)[:, None]
    bright = np.pi * wanted**2 * seen.psf.max(axis=(1, 2))[:, None]
    return total, seen.sum_error[:, None] * fraction + RIPPLE * (CELLS if kernel is None else np.minimum(bright, 1.0))


def _around(
    result: PSFResult, middle: tuple[float, float], radius: float, edge: float
) -> tuple[PSFResult, SoftEdge | None]:
    """Return a PSF whose samples are sufficient for sums within a circle, and the kernel that smooths the circle.

    The samples are fine enough, and they extend beyond the circle by the width of the kernel. If the samples are means
    over cells, the result is the same PSF and None.

    radius: radius [m] of the circle.
    edge: distance [m] from the circle's centre to the outermost samples.
    """
    if result.holds_cells:
        return result, None
    cutoff = result.highest_cutoff
    if result.dx <= FINE / cutoff:
        kernel = _kernel(result.dx, cutoff, edge - radius)
        if radius + kernel.reach / cutoff <= edge:
            return result.of_all_light, kernel
    pitch = min(result.dx, FINE / cutoff)
    kernel = _kernel(pitch, cutoff, math.inf)
    half = math.ceil((radius + kernel.reach / cutoff) / pitch)
    window = Grid((2 * half + 1, 2 * half + 1), pitch, middle)
    return result.recompute_on(window, "encircled energy"), kernel


def _kernel(dx: float, cutoff: float, room: float) -> SoftEdge:
    """Return a kernel whose spectrum is 1 at all frequencies of the PSF and 0 at their aliases.

    The kernel smooths the edge of a circle over which samples are summed. Its lengths are in units of 1/cutoff. A wider
    kernel has a spectrum that ends at a lower frequency, so that integrals over the spectrum need fewer nodes.

    room: largest distance [m] over which the kernel may extend.
    """
    last = 1 / (dx * cutoff) - 1
    latest = SoftEdge(1.0, last, RIPPLE)
    if room <= 0:
        return latest
    return SoftEdge(1.0, min(last, max(1 / FINE - 1, 1 + latest.reach * (last - 1) / (room * cutoff))), RIPPLE)
