"""CPU times of single PSFs, each of a new pupil, with planning and predicted error.

Plans keep what depends neither on reliefs nor on wavefronts. Times are therefore measured twice: over the same window
in each call, and over windows with a different pitch in each call, for which nothing is kept.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

import optics
from validation.reference import relative_l2

__all__ = ["Case", "cases", "table"]

RADIUS, FOCUS, WAVE, DX, TOLERANCE = 1.49e-3, 22.2e-3, 550e-9, 2e-6, 1e-2  # NA 0.067
MODES = ((2, -2), (2, 0), (2, 2), (3, -3), (3, -1), (3, 1), (3, 3), (4, 0), (4, 2), (4, -2))
BEFORE, TIMED = 20, 40  # PSFs before timing starts, and timed PSFs
OTHER = 1e-3  # largest relative change of the pitch, for other windows


@dataclass(frozen=True)
class Case:
    """A kind of pupil and a window.

    size: samples of the window along an axis.
    goal: CPU time [ms]; None without a goal.
    """

    name: str
    pupil: Callable[[np.random.Generator], optics.Pupil]
    size: int = 65
    goal: float | None = None


def cases() -> Iterator[Case]:
    for size, goal in ((65, 1.0), (129, 1.5), (513, 10.0)):
        yield Case("ten Zernike modes", _zernike, size, goal)
    yield Case("ten modes, slit", lambda rng: _zernike(rng, aperture=optics.Slit(1.2, 1.2)))
    yield Case("ten modes, annulus", lambda rng: _zernike(rng, aperture=optics.Annulus(0.4)))
    yield Case("ten modes, mask", lambda rng: _zernike(rng, mask=optics.GaussianMask(RADIUS * rng.uniform(0.7, 0.9))))
    yield Case("relief of 4 x 4 splines", _relief)
    yield Case("defocus", lambda rng: _lens(wavefront=optics.Zernike({(2, 0): rng.uniform(0.3, 0.5)})))


def table(all_cases: Iterator[Case]) -> tuple[str, list[str]]:
    """Return the table of times and errors, and a line for each error above its prediction."""
    lines = [
        f"{'single PSFs':<26}{'window':>12}{'same [ms]':>12}{'other [ms]':>12}{'goal':>7}{'error':>10}{'predicted':>12}"
    ]
    broken = []
    for case in all_cases:
        same, other = (_milliseconds(case, change) for change in (0.0, OTHER))
        found = _psf(case, case.pupil(np.random.default_rng(2)))
        exact = _psf(case, found.pupil, tolerance=1e-5, dtype="float64")
        error, predicted = relative_l2(found.psf, exact.psf), found.plan.predicted_error
        window, goal = f"{case.size} x {case.size}", "" if case.goal is None else f"{case.goal:g}"
        times = f"{same:>12.1f}{other:>12.1f}{goal:>7}"
        lines.append(f"{case.name:<26}{window:>12}{times}{error:>10.1e}{predicted:>12.1e}")
        if not error <= predicted:
            broken.append(f"{case.name}, {window}: error {error:.1e}, predicted {predicted:.1e}")
    return "\n".join(lines), broken


def _milliseconds(case: Case, change: float) -> float:
    """Return the median CPU time [ms] of PSFs of new pupils.

    change: largest relative change of the window's pitch.
    """
    rng, times = np.random.default_rng(1), []
    for _ in range(BEFORE + TIMED):
        pupil, dx = case.pupil(rng), DX * (1 + change * rng.random())
        start = time.process_time()
        _psf(case, pupil, dx=dx)
        times.append(1e3 * (time.process_time() - start))
    return statistics.median(times[BEFORE:])


def _psf(case: Case, pupil: optics.Pupil, **changed: object) -> optics.PSFResult:
    asked = {"dx": DX, "shape": (case.size, case.size), "tolerance": TOLERANCE, **changed}
    found = optics.psf(pupil, [WAVE], FOCUS, **asked)
    assert found.psf.size  # read the result
    return found


def _zernike(rng: np.random.Generator, **others: object) -> optics.Pupil:
    modes = dict(zip(MODES, rng.normal(0, 0.05, len(MODES)), strict=True))
    return _lens(wavefront=optics.Zernike(modes), **others)


def _relief(rng: np.random.Generator) -> optics.Pupil:
    return _lens(height=optics.BSplineRelief(1e-6 * rng.random((4, 4))))


def _lens(**others: object) -> optics.Pupil:
    return optics.Pupil(RADIUS, thin_lens_focal_length=FOCUS, **others)
