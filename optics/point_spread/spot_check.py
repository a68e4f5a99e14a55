"""Comparison of a PSF with the direct sum at a few points. It finds errors that predictions miss."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.methods.rayleigh_sommerfeld import MOST_DIGITS, direct_sum, node_count, turns
from optics.numerics.accuracy import FLOAT_NOISE
from optics.numerics.cost import PAIRS_PER_SECOND
from optics.numerics.grid import Grid
from optics.numerics.precision import padded_for_packets, precision
from optics.numerics.quadrature import stepped_up

__all__ = ["CAUTION", "EFFORT", "exact_psf", "path_rounding", "spot_check"]

# Choice: safety factor on the estimate. From 40 points, the root mean square of the error is known only to within a
# factor of about two. tests/optics/point_spread/test_robustness.py checks that the stated error bounds the true error.
CAUTION = 3.5


# Choice: relative rounding error of a path, times 2π for the phase and 2 for the intensity, reduced by averaging over
# the pupil. test_spot_check.py checks the value against sums in extended precision.
WAVE_ROUNDING = 1.1e-16
FINER_DETAIL = 1e-2  # choice: size of the detail that the check neglects, relative to the size that the PSF neglects
DIGITS_STEP = 0.25  # choice: digits of a rule are rounded to multiples of this, so that cached rules are used


@dataclass(frozen=True)
class Effort:
    """Limits on the effort of a spot check, which compares a PSF with the direct sum over the pupil at a few points.

    points: largest number of points at which a PSF is checked.
    points_along_radius: the largest number of points for a rotationally symmetric PSF in a window around the axis.
    fewest: number of points below which the error of the PSF cannot be estimated.
    spare_digits: numbers of digits by which the direct sum is more accurate than the tolerance. The first number with
        which all points can be checked in time is used. If there is none, the last number is used.
    share: time limit of the check, relative to the time of the PSF.
    share_of_few: time limit for windows with fewer than `few` samples, for which `share` would be too short. Without a
        check, the error of the PSF may be as large as its predicted upper bound.
    seconds: time [s] that a check may take even if the shares permit less.
    """

    points: int = 40
    points_along_radius: int = 20
    fewest: int = 8
    few: int = 54
    spare_digits: tuple[float, ...] = (7.0, 4.0)
    share: float = 0.3
    share_of_few: float = 1.0
    seconds: float = 3e-3


EFFORT = Effort()


@dataclass(frozen=True)
class _DirectSum:
    """The direct sum with which a PSF is compared, at `points` points of the window.

    Its quadrature resolves `cycles` cycles per pupil radius and is accurate to `digits` digits.
    """

    points: int
    cycles: float
    digits: float


def spot_check(beam: Beam, problem: Problem, image: np.ndarray, seconds: float) -> float | None:
    """Return the relative L2 error of a PSF over its window, from a comparison with the direct sum over the pupil.

    The points to compare are drawn with the probabilities from `_chances`. The result is None if the PSF may be wrong
    beyond some distance from the axis (`Problem.reach`), if the window is dark, or if the check would take too long.
    With n points of probability p_k, the sum of squared errors Σ (δI)² is estimated by Σ (δI_k)² / (n p_k).

    image: the PSF |U|² / (pupil area), a flat array.
    seconds: time of its computation.
    """
    if problem.reach is not None:
        return None  # a PSF that may be wrong beyond `reach` cannot be checked
    if problem.knots is not None:  # the direct sum needs samples for the PSF only, and not for its derivatives
        problem = Problem.from_beam(beam, problem.window, problem.tolerance, problem.dtype, derivatives=False)
    total = float(np.sum(np.square(image, dtype=np.float64)))
    if total == 0:
        return None
    darkness = _darkness(beam, problem, math.sqrt(total / image.size))
    reference = _affordable(beam, problem, darkness, seconds)
    if reference.points < min(EFFORT.fewest, image.size):
        return None
    drawn, chance = _drawn(problem, image, reference.points)
    exact = _exact(beam, problem, reference, drawn)
    squared = float(np.mean(np.square(image[drawn] - exact) / chance))
    # Choice: with an error above a tenth, the PSF may be much brighter than the exact PSF. Errors are then relative to
    # the exact PSF.
    if squared > 0.01 * total:
        total = min(total, float(np.mean(np.square(exact) / chance)))
    rounding = max(FLOAT_NOISE["float64"], float(np.finfo(precision(problem.dtype).dtype).eps))
    return CAUTION * math.sqrt(squared / total) + rounding + _own_error(problem, reference, darkness)


def _own_error(problem: Problem, reference: _DirectSum, darkness: float) -> float:
    """Return the relative error of an intensity computed by the direct sum, due to quadrature and rounding of paths.

    Quadrature changes the amplitude by 10^-digits times the amplitude that all light in phase would have, and the
    intensity by twice the relative change of the amplitude.
    """
    return 2 * 10.0 ** (darkness - reference.digits) + path_rounding(problem, darkness)


def path_rounding(problem: Problem, darkness: float) -> float:
    """Return the relative error of the intensity due to the rounding of optical paths in float64.

    A phase error of δ [rad] changes the amplitude by δ times the amplitude that all light in phase would have. A
    comparison of two methods does not show this error if both round the paths in a similar way.
    """
    return WAVE_ROUNDING * problem.waves * 10.0**darkness


def _darkness(beam: Beam, problem: Problem, mean: float) -> float:
    """Return log10(U / amplitude in the window), at least 0. U is the amplitude that all light in phase would have.

    If the light of the whole aperture (area A) arrived in phase, its amplitude would be U = A/(λz), and the PSF U²/A =
    A/(λz)². The error of the direct sum over the pupil is proportional to U.

    mean: root mean square of the PSF over the window.
    """
    in_phase = beam.pupil.area / (problem.wavelength * problem.distance) ** 2
    return max(0.0, 0.5 * math.log10(in_phase / mean))


def _affordable(beam: Beam, problem: Problem, darkness: float, seconds: float) -> _DirectSum:
    """Return the most accurate direct sum that can be computed in time at all points.

    If there is none, return the least accurate direct sum, at as many points as the time permits.
    """
    samples, fine = math.prod(problem.window.shape), _finer_detail(beam, problem)
    share = EFFORT.share if samples >= EFFORT.few else EFFORT.share_of_few
    pairs = max(share * seconds, EFFORT.seconds) * PAIRS_PER_SECOND["float32"]
    along_radius = problem.symmetric and problem.window.centre == (0.0, 0.0)
    wanted = min(EFFORT.points_along_radius if along_radius else EFFORT.points, samples)
    for spare, detail in dict.fromkeys((spare, detail) for spare in EFFORT.spare_digits for detail in (fine, 0.0)):
        wished = spare - math.log10(problem.tolerance) + darkness
        digits = min(math.ceil(wished / DIGITS_STEP) * DIGITS_STEP, MOST_DIGITS)
        cycles = stepped_up(turns(problem, digits) + detail)
        nodes = node_count(problem.aperture, cycles, digits) / (2 if problem.symmetric else 1)
        found = _DirectSum(int(min(wanted, pairs / nodes)), cycles, digits)
        if found.points == wanted:
            break
    return found


def _finer_detail(beam: Beam, problem: Problem) -> float:
    """Return the resolution of a spot check's direct sum minus that of the PSF, in cycles per pupil radius.

    A PSF neglects detail that changes phases [rad] or a mask's amplitude by less than a tenth of the PSF's tolerance.
    The direct sum resolves finer detail, so that its comparison with the PSF shows the resulting error.
    """
    fine = beam.pupil.bandwidth(beam.wavelength, FINER_DETAIL * problem.tolerance / 10)
    return problem.radius * max(fine - problem.detail, 0.0)


def _drawn(problem: Problem, image: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Return flat indices of the points at which a PSF is checked, and the probability with which each was drawn.

    A point is drawn each time the sum of the probabilities grows by 1/`points`. No more probable point is missed.
    """
    # If there are few points, each is compared once.
    even = np.full(points, 1 / points)
    chance = even if points == image.size else _chances(image.astype(np.float64), problem.window)
    order = _in_order(problem.window) if problem.symmetric else np.arange(image.size)
    levels = (np.arange(points) + 0.5) / points
    drawn = order[np.searchsorted(np.cumsum(chance[order]), levels).clip(max=image.size - 1)]
    return drawn, chance[drawn]


def exact_psf(
    beam: Beam, problem: Problem, x: np.ndarray, y: np.ndarray, bright: float, seconds: float
) -> tuple[np.ndarray, float] | None:
    """Return the PSF at (x, y) [m] by direct sums over the pupil, and their relative error for the PSF `bright` [1/m²].

    The result is None if PSFs of this problem may be wrong beyond some distance from the axis (`Problem.reach`), or if
    the sum takes too long. Its time limit is that of a `spot_check` with the same `seconds`.
    """
    darkness = _darkness(beam, problem, bright)
    reference = _affordable(beam, problem, darkness, seconds)
    if problem.reach is not None or reference.points < min(x.size, math.prod(problem.window.shape)):
        return None
    return _at_points(beam, problem, reference, x, y), _own_error(problem, reference, darkness)


def _exact(beam: Beam, problem: Problem, reference: _DirectSum, drawn: np.ndarray) -> np.ndarray:
    """Return the exact PSF at the points with the flat indices `drawn`, by the direct sum in float64."""
    row, column = np.divmod(drawn, problem.window.shape[1])
    return _at_points(beam, problem, reference, problem.window.x[column], problem.window.y[row])


def _at_points(beam: Beam, problem: Problem, reference: _DirectSum, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the exact PSF [1/m²] at points (x, y) [m], (point,)."""
    import drjit as dr

    types = precision("float64")
    if problem.symmetric:
        x, y = np.hypot(x, y), np.zeros_like(y)
    rule = problem.aperture, reference.cycles, reference.digits, problem.symmetric
    with dr.suspend_grad():
        x, y = (types.Float64(padded_for_packets(each)) for each in (x, y))
        field = direct_sum(beam, rule, x, y, types)
        exact: np.ndarray = field.intensity.numpy() / beam.pupil.area
    return exact


KINDS = 6  # kinds of points in `_chances`


def _chances(bright: np.ndarray, window: Grid) -> np.ndarray:
    """Return the probability with which each sample of a window is drawn for the spot check, as a flat array.

    It is the mean of six distributions. The first is uniform. The others are proportional to the following quantities:

    - Intensity: if the amplitude has the same error everywhere, the squared error of the intensity is proportional to
        the intensity. Next to a bright focus, the other distributions do not detect this error.
    - Squared intensity, spread over neighbouring samples: if a focus lights one sample, errors lie in its neighbours.
    - Nearness to a side, and nearness to a corner: phases change fastest there, so quadratures fail first at the few
        outermost samples. In a window off the axis, phases change fastest at the sides that are farthest from the axis.
    - Intensity times the sum of both kinds of nearness: the light of a slit reaches the sides only in few places, and
        errors are largest in bright places.
    """
    height, width = shape = window.shape
    squares = np.zeros((height + 2, width + 2))
    squares[1:-1, 1:-1] = np.square(bright).reshape(shape)
    rows = squares[:-2] + squares[1:-1] + squares[2:]
    near = (rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]).ravel()
    rim, fixed = (_large_chances if bright.size > LARGE else _small_chances)(
        shape, (window.centre[0] / window.dx, window.centre[1] / window.dx)
    )
    lit = bright * rim
    found = fixed + bright / bright.sum() + near / near.sum()
    return (found + lit / lit.sum() if lit.any() else found + fixed / 3) / KINDS


LARGE = 2**18  # choice, limited by memory: arrays of 16 windows are cached up to this number of samples, else of one


def _in_order(window: Grid) -> np.ndarray:
    """Return the result of `_by_radius`, from a cache if possible."""
    return (_large_order if math.prod(window.shape) > LARGE else _small_order)(window)


def _by_radius(window: Grid) -> np.ndarray:
    """Return the flat indices of a window's samples in order of their distance from the axis.

    For symmetric problems, `_drawn` adds up the samples' probabilities in this order, and draws a sample at equal steps
    of the growing sum. The drawn samples are therefore spread over all bright rings.
    """
    radii = np.add.outer(np.square(window.y), np.square(window.x)).ravel()
    # Squared radii are rounded, so that rounding errors do not change the order of equal radii.
    return np.argsort(np.round(radii / window.dx**2, 6), kind="stable")


_small_order, _large_order = (lru_cache(maxsize=count)(_by_radius) for count in (16, 1))


# Choice: exponent of u², where u in [-1, 1] is the position across the window. u²⁴ has fallen to one half at 1 - |u| =
# ln 2 / 24, a seventieth of the window's width from the side.
STEEP = 12
OUTWARDS = 2  # choice: exponent of the squared distance from the axis, for windows off the axis


def _fixed_chances(shape: tuple[int, int], centre: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return two flat arrays, with one number per sample of a window, from which `_chances` computes probabilities.

    The arrays do not depend on the PSF. The first is the sum of two probability distributions. One of them prefers
    samples near a side of the window, the other samples near a corner. The second adds the uniform distribution.

    centre: position (x, y) of the window's centre, in samples.
    """
    height, width = shape
    y, x = (np.square(np.linspace(-1, 1, n)) if n > 1 else np.ones(1) for n in shape)
    # Both pairs of sides have the same weight, regardless of their lengths. One half of it is for the outermost samples
    # alone.
    sides = np.zeros(shape)
    for steepness in (STEEP, math.inf):
        across, along = x**steepness, y**steepness
        sides += across[None, :] / (across.sum() * height) + along[:, None] / (along.sum() * width)
    corners = (np.add.outer(y, x) / 2) ** STEEP
    rim = sides.ravel() / 4 + corners.ravel() / corners.sum()
    if centre != (0.0, 0.0):
        away = Grid(shape, 1.0, centre)
        squared = np.add.outer(np.square(away.y), np.square(away.x)).ravel()
        far = rim * (squared / squared.max()) ** OUTWARDS
        rim = (rim + far * (rim.sum() / far.sum())) / 2
    return rim, 1 / rim.size + rim


_small_chances, _large_chances = (lru_cache(maxsize=count)(_fixed_chances) for count in (16, 1))
