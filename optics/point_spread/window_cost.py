"""Time and memory that every PSF needs for its window, in addition to the time and memory of its method."""

from __future__ import annotations

import math

from optics.methods.method_sampling import Sampling
from optics.methods.problem import Problem
from optics.methods.rayleigh_sommerfeld import LANES
from optics.methods.window_sampling import WindowSampling
from optics.numerics.accuracy import MOST_BYTES, MOST_SECONDS, AccuracyError, size_of
from optics.numerics.cost import (
    CHECK_BYTES,
    CHECK_SAMPLE,
    CHECK_SYMMETRIC_SAMPLE,
    ITEM_BYTES,
    OUTPUT_ARRAYS,
    OUTPUT_SAMPLE,
    PAIRS_PER_SECOND,
)
from optics.numerics.grid import Grid
from optics.point_spread.spot_check import EFFORT

__all__ = ["check_seconds", "check_window", "window_bytes", "window_seconds"]


def window_seconds(problem: Problem) -> float:
    """Return the time [s] to evaluate the PSF, copy it to NumPy, and select the few points at which it is checked."""
    check = CHECK_SYMMETRIC_SAMPLE if problem.symmetric else CHECK_SAMPLE
    each = OUTPUT_SAMPLE[problem.dtype] + (0.0 if problem.reach is not None else check)
    return math.prod(problem.window.shape) * each


def check_seconds(problem: Problem, sampling: Sampling) -> float:
    """Return the time [s] of the spot check if the PSF is computed by the direct sum; otherwise 0.

    A spot check compares the PSF at a few points with a second direct sum, which has about twice as many nodes as the
    PSF's own sum. For methods other than the direct sum, the time of the check is neglected, because it is a small part
    of the PSF's time. The result is also 0 if there is no check.
    """
    if problem.reach is not None or sampling.method != "rayleigh_sommerfeld":
        return 0.0
    samples = math.prod(problem.window.shape)
    points = max(min(EFFORT.points, samples), LANES)
    needed = 2 * sampling.samples[0] * points / PAIRS_PER_SECOND["float64"]
    slower = PAIRS_PER_SECOND["float32"] / PAIRS_PER_SECOND["float64"]
    most = EFFORT.share if samples >= EFFORT.few else EFFORT.share_of_few
    return needed if samples < EFFORT.fewest else min(needed, most * sampling.seconds * slower)


def window_bytes(problem: Problem, sampling: Sampling) -> float:
    """Return the peak memory [bytes] of all arrays that are as large as the window.

    The result includes the memory of a spot check, which sorts all samples of the window to select a few of them. A PSF
    with a `WindowSampling` is checked in a few rows and columns instead. A PSF whose problem has a `reach`, a distance
    beyond which light is neglected, is not checked.
    """
    sorts = problem.reach is None and not isinstance(sampling, WindowSampling)
    each = OUTPUT_ARRAYS * ITEM_BYTES[problem.dtype] + (CHECK_BYTES if sorts else 0.0)
    return math.prod(problem.window.shape) * each


def check_window(window: Grid, dtype: str, count: int = 1, arrays: int = 1) -> None:
    """Raise an AccuracyError if a window exceeds the limits on memory or time.

    The memory and time of the method that computes the PSF are not counted.

    count: number of PSFs over the window that exist at the same time.
    arrays: number of arrays of real numbers that are stored for each PSF.

    Raises:
        AccuracyError: the window needs too much memory or time.
    """
    samples = math.prod(window.shape)
    each = OUTPUT_ARRAYS * ITEM_BYTES[dtype] + CHECK_BYTES + (count * arrays - 1) * ITEM_BYTES[dtype]
    seconds = samples * (OUTPUT_SAMPLE[dtype] + CHECK_SAMPLE)
    if samples * each <= MOST_BYTES and seconds <= MOST_SECONDS:
        return
    height, width = window.shape
    most = math.isqrt(int(MOST_BYTES / each))
    many, fewer = (f"{count} PSFs of shape", "compute fewer PSFs at once, or ") if count > 1 else ("shape", "")
    raise AccuracyError(
        f"{many} = ({height}, {width}) needs {size_of(samples * each)} and about {seconds:.2g} s for each PSF; the "
        f"limits are {size_of(MOST_BYTES)} and {MOST_SECONDS:g} s: {fewer}use at most {most**2} samples, such as "
        f"({most}, {most}), with a larger dx, or compute the window in parts (centre)"
    )
