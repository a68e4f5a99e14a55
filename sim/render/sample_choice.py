"""Choice of the number and kind of samples per receptor: rays, or areas of the visual field.

Areas are available in worlds in which the mean light in an area has a closed form.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

from sim.eyes.receptive_fields import NoRaysError
from sim.eyes.sampling import BoxSampling, EyeSampling
from sim.render.fidelity import AREAS, RAYS, Level
from sim.render.fidelity_choice import Allowed, Samples
from sim.render.fidelity_stages import CAUTION
from sim.render.fidelity_trials import FidelityTrials
from sim.tracing.lighting import ALL, BOUNCE

# Numbers of rays that are tried, in steps of about √2, so that few more rays are traced than needed.
PERFECT_LENS_RAYS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)
PUPIL_RAYS = (*(2.0**k * (1 + half / 2) for k in range(-4, 6) for half in (0, 1)), 64.0)
FEW_RAYS = 1  # rays per receptor behind a pupil; if they are enough, areas are not tried
NUMBERS_OF_AREAS = (1, 2, 4, 6, 9, 12, 16, 20, 25, 30)
SHARED_AREAS = (4 / 9, 1 / 4, 1 / 9)  # areas per receptor if areas are shared: they are 1.5, 2 and 3 receptors wide
# Cost of an area, in rays (docs/measurements/rendering.md). If fewer rays than this are enough, rays are chosen. Behind
# a pupil, the ratio is smaller, because distributing light among receptors adds the same cost to a ray and to an area.
PERFECT_LENS_AREA, PUPIL_AREA = 3, 1.6
PUPIL_AREA_IN_ALL_LIGHT = 2  # cost of an area with light of any number of reflections, in rays with one bounce
HARDLY_MORE = 1.1  # errors up to this multiple of the smallest error count as close to it


def fewest_samples(trials: FidelityTrials, sampling: EyeSampling, light: Level, allowed: Allowed) -> Samples:
    """Return the cheapest samples whose error, including the error due to light that they omit, is allowed.

    Samples are rays, or areas: rectangles of the visual field over which light is averaged in closed form. Areas are
    not tried if a few rays are enough. If no samples are accurate enough, return the cheapest samples whose error is
    close to the smallest error.

    light: level of light (number of reflections) if rays are used
    """
    errors = cache(trials.errors(sampling, light.level))
    perfect = isinstance(sampling, BoxSampling)
    numbers: tuple[float, ...] = PERFECT_LENS_RAYS if perfect else PUPIL_RAYS
    if sampling.eye.lattice is not None:  # receptors of different sizes are rendered with rays only
        return Samples(RAYS, light, *_fewest(errors, numbers, _left(light, allowed), RAYS))
    shared = tuple(number for number in SHARED_AREAS if trials.may_share(sampling, number))
    of_pupil = PUPIL_AREA_IN_ALL_LIGHT if light.level == BOUNCE else PUPIL_AREA

    def cost(areas: float) -> float:
        return (PERFECT_LENS_AREA if perfect else of_pupil) * trials.areas_of_field(sampling, areas)

    left_out, left = light.predicted_error or 0, _left(light, allowed)

    def rays(most: float = math.inf) -> Samples:
        tried = tuple(number for number in numbers if number <= most)
        return Samples(RAYS, light, *_fewest(errors, tried, left, RAYS))

    if (few := rays(max(FEW_RAYS, cost(min(shared, default=1))))).enough:
        return few
    areas = _areas(trials, sampling, light, shared, allowed)
    if areas is None:
        return rays()
    if areas.enough:
        cheaper = rays(cost(areas.number))
        return cheaper if cheaper.enough else areas
    if areas.error <= left_out:  # no number of rays is as accurate
        return areas
    if (many := rays()).enough:
        return many
    accurate = [found for found in (areas, many) if found.error <= HARDLY_MORE * min(areas.error, many.error)]
    return min(accurate, key=lambda found: cost(found.number) if found is areas else found.number)


def _left(light: Level, allowed: Allowed) -> float:
    """Return the largest error due to sampling with which the total error is at most the allowed one.

    The total error has two causes: a finite number of samples, and light that is omitted. The squares of the two errors
    add. If omitted light alone causes at least the allowed error, the result is nearly 0, so that no number of rays is
    accurate enough.
    """
    left_out = light.predicted_error or 0
    return math.sqrt(max(allowed.without_light**2 - left_out**2, (1e-6 * allowed.without_light) ** 2))


def _areas(
    trials: FidelityTrials,
    sampling: EyeSampling,
    light: Level,
    shared: tuple[float, ...],
    allowed: Allowed,
) -> Samples | None:
    """Return the lowest number of areas per receptor that is accurate enough; None if the world permits no areas.

    An area is a rectangle of the visual field over which light is averaged. If every number of areas that is tried
    causes an error above the allowed one, return the lowest number whose error is close to the smallest.

    shared: additional numbers of areas per receptor, all below 1, in decreasing order. With such a number, an area is
        larger than a receptor, and neighbouring receptors share it. These numbers are tried only if one area per
        receptor is accurate enough.
    """
    if not trials.have_areas(*((BOUNCE, ALL) if light.level == BOUNCE else (light.level,))):
        return None
    errors, most = trials.area_errors(sampling, light.level), allowed.error
    if light.level == BOUNCE:
        more, most = trials.reflected_more_often(sampling), allowed.without_light
        light = Level("light", ALL, None, f"light that is reflected more than twice adds {more:.1e}; it is in tables")
    found = _fewest(errors, NUMBERS_OF_AREAS, most, AREAS)
    for number in shared if found[2] and found[0] == 1 else ():
        if (predicted := CAUTION * errors(number)) > most:
            break
        why = f"receptors share areas: one per receptor is more than enough for {most:.1e}"
        found = number, Level(AREAS, f"{number:.3g} per receptor", predicted, why), True
    return Samples(AREAS, light, *found)


def _fewest(
    error: Callable[[float], float], numbers: tuple[float, ...], allowed: float, kind: str
) -> tuple[float, Level, bool]:
    """Return the lowest sufficient number of samples per receptor, a `Level` that describes this choice, and True.

    A number is sufficient if its predicted error is at most `allowed`. If no number is, return the lowest number whose
    error is close to the smallest error, its `Level`, and False. An n times larger number of samples is assumed to
    divide the error by at most n, so numbers that are certainly too low are skipped.
    """
    at = 0
    tried: dict[float, float] = {}
    while True:
        try:
            predicted = CAUTION * error(numbers[at])
        except NoRaysError:
            predicted = math.inf
        tried[numbers[at]] = predicted
        if predicted <= allowed or at == len(numbers) - 1:
            break
        least = numbers[at] * (predicted / allowed if math.isfinite(predicted) else 1)
        at = next((i for i in range(at + 1, len(numbers)) if numbers[i] >= least), len(numbers) - 1)
    enough = predicted <= allowed
    number = numbers[at] if enough else next(n for n, e in tried.items() if e <= HARDLY_MORE * min(tried.values()))
    found = "fewest of" if enough else "not enough, but close to the best of"
    why = f"{found} {numbers[0]:g} ... {numbers[-1]:g} for {allowed:.1e}, {len(tried)} tried"
    return number, Level(kind, f"{number:g} per receptor", tried[number], why), enough
