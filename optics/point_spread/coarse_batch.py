"""PSFs of many beams at coarse tolerances, as stacks of matrix products.

All beams are planned at once (`window_plan`). Those with equal numbers of samples are then computed together. The error
of each PSF is checked. If it is too large, the PSF is computed again with a smaller tolerance.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np

from optics.elements.beam import Beam
from optics.elements.derivative_knots import carries_derivatives
from optics.elements.light_stack import LightStack
from optics.methods.problem import DETAIL_PART, SLOPE_MARGIN
from optics.methods.scalar_theory import light_spread, scalar_theory_error, steepest_sine
from optics.methods.window_images import window_image_errors, window_images
from optics.methods.window_plan import TIGHTEST, WindowPlan
from optics.numerics.accuracy import Plan
from optics.numerics.grid import Grid

__all__ = ["coarse_psfs"]

MOST_SECONDS = 8e-3  # choice: predicted time of a PSF [s] above which another method may be faster
TRIES = 3  # choice: number of attempts to meet a tolerance
NEXT_TOLERANCE = 0.6  # choice: if an error is f times too large, the next tolerance is f / 0.6 times smaller
STACK = 300_000  # choice, limited by memory: samples of pupils, or of windows, in a stack


def coarse_psfs(
    beams: Sequence[Beam], window: Grid, tolerance: float, dtype: str
) -> Iterator[tuple[int, np.ndarray, Plan]]:
    """Yield index of the beam, PSF (y, x) [1/m²] and plan, for each beam whose PSF meets the tolerance.

    Nothing is yielded for tolerances below TIGHTEST, 3e-4. Beams with derivatives or pixelated reliefs are left out, as
    are beams whose PSF is predicted to take 8 ms or more to compute.
    """
    if tolerance < TIGHTEST:
        return
    places = [place for place, beam in enumerate(beams) if not beam.pupil.pixels and not carries_derivatives(beam)]
    stack, wanted = LightStack(tuple(beams[place] for place in places)), np.full(len(places), tolerance)
    for attempt in range(TRIES):
        if not places:
            return
        plan = WindowPlan(stack, window, wanted, smoothed=True)
        failed = []
        for mine, images, errors in _computed(plan, dtype):
            for place, image, error in zip(mine, images, errors, strict=True):
                if error <= tolerance:
                    yield places[place], image, _plan(plan, place, dtype, float(error))
                elif error > tolerance and attempt + 1 < TRIES:  # not for a dark window
                    failed.append((place, NEXT_TOLERANCE * wanted[place] * tolerance / error))
        kept = [(place, smaller) for place, smaller in failed if smaller >= TIGHTEST]
        stack, wanted = stack.part([place for place, _ in kept]), np.array([smaller for _, smaller in kept])
        places = [places[place] for place, _ in kept]


def _computed(plan: WindowPlan, dtype: str) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield indices of beams, their PSFs [1/m²] and errors, for groups of beams with equal numbers of samples."""
    groups: dict[tuple[int, int, bool], list[int]] = defaultdict(list)
    for place in np.flatnonzero((plan.counts > 0) & (plan.seconds < MOST_SECONDS)):
        groups[int(plan.counts[place]), int(plan.ranks[place]), bool(plan.crossed[place])].append(int(place))
    for (count, rank, crossed), group in groups.items():
        across = rank * (2 * int(plan.finer_count(np.array(count))) + 1)
        size = max(1, STACK // max(across**2, math.prod(plan.window.shape)))
        for start in range(0, len(group), size):
            part = np.array(group[start : start + size])
            samples, finer = plan.samples(part)
            own = plan.stack.part(part)
            images = window_images(own, samples, rank, crossed, plan.window, dtype)
            errors = window_image_errors(own, finer, images, plan.window, float(plan.tolerance.max()))
            areas = np.array([beam.pupil.area for beam in own.beams])
            yield part, images / areas[:, None, None].astype(images.dtype), errors


def _plan(plan: WindowPlan, place: int, dtype: str, error: float) -> Plan:
    stack, across = plan.stack, 2 * int(plan.counts[place]) + 1
    pupil, wavelength, distance = stack.beams[place].pupil, stack.wavelength[place], float(stack.distance[place])
    band = SLOPE_MARGIN * stack.slopes.steepest[place] / stack.vacuum_wavelength[place] + 1 / pupil.radius
    if steepest_sine(pupil.radius, distance, band * wavelength) == band * wavelength:  # else the rim limits the sine
        band += pupil.bandwidth(stack.beams[place].wavelength, DETAIL_PART * plan.tolerance[place])
    sine = steepest_sine(pupil.radius, distance, band * wavelength)
    scalar = scalar_theory_error(sine, light_spread(pupil))
    why = "as few samples as the light in the window needs"
    return Plan("low_rank", (across, across), dtype, error, why, float(plan.seconds[place]), scalar_error=scalar)
