"""Choice of spectral bands, depth layers and light for a built-in world, before the choice of rays or areas.

These are the first stages in the choice of a fidelity, the accuracy of rendering. Each stage has levels, ordered by
cost. The cheapest level whose error is allowed is chosen, with a reason.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

import optics
from optics.spectra.bands import FINEST
from sim.eyes.depth_layers import ONE_PSF, DepthLayers
from sim.eyes.sampling import EyeSampling
from sim.render.fidelity import Level
from sim.render.fidelity_trials import FidelityTrials
from sim.scene.band_error import band_error, measured
from sim.tracing.lighting import BOUNCE, DIRECT
from sim.worlds.world import World

# Chosen: safety factor for errors measured in a few random views, because the error in agents' episodes may be larger
# (tests/sim/render/test_fidelity.py compares the error in episodes with the noise).
CAUTION = 1.2
LAYERS = (1, 3, 5, 9)  # numbers of layers to try; each set of layers is a subset of the next
NEAREST = 0.005  # chosen: quantile of the visible distances that counts as the nearest distance


def bands(eye: optics.Eye, allowed: float, medium: optics.TurbidMedium | None = None) -> tuple[int, Level]:
    """Return the smallest number of spectral bands that is accurate enough, and a record of this choice.

    A number is accurate enough if the error is allowed for surfaces of any colour up to white. If no number is accurate
    enough for the surfaces, return the number of bands that the eye has. If some numbers are accurate enough for the
    surfaces, but none of them for the medium, return 64.

    allowed: allowed error of a signal
    medium: water or air that fills the world. If it is given, the error for white and for black surfaces that are seen
        through it must also be allowed
    """
    within = min(max(allowed / eye.throughput, 1e-6), 0.5)  # the tolerances that an Eye accepts
    try:
        bands = int(replace(eye, bands="auto", tolerance=within).bands)
    except optics.AccuracyError as error:
        return eye.bands, Level("bands", f"{eye.bands}", None, f"the eyes' own: {error}")
    if medium is None:
        return bands, Level("bands", f"{bands}", allowed, f"fewest for {allowed:.1e} with any colours up to white")
    worst = math.inf
    for n in range(bands, FINEST + 1):
        bands, worst = n, float(eye.throughput) * medium.band_error(n, eye.receptors)
        if worst <= allowed:
            break
    number = "fewest" if worst <= allowed else "most, not enough"
    why = f"{number} for {allowed:.1e} with any colours up to white, and for white and black in the medium"
    return bands, Level("bands", f"{bands}", max(allowed, worst), why)


def own_bands(world: World, eye: optics.Eye) -> Level:
    """Return a record of the spectral bands that the eye has, with the error that they cause.

    The error is the larger of two: the error for the world's measured reflectances, and the error for white and black
    surfaces that are seen through the medium. For RGB colours in clear air, the error is unknown.
    """
    spectra = measured(world.model, world.spectra)
    errors, cases = [], []
    if spectra:
        errors, cases = [band_error(spectra, eye.receptors, eye.bands)], ["measured reflectances in daylight"]
    if world.medium is not None:
        errors.append(world.medium.band_error(eye.bands, eye.receptors))
        cases.append("white and black in the medium")
    if not errors:
        return Level("bands", f"{eye.bands}", None, "the eyes' own")
    error = float(eye.throughput) * max(errors)
    return Level("bands", f"{eye.bands}", error, f"the eyes' own; error for {' and '.join(cases)}")


def depth(trials: FidelityTrials, eye: optics.Eye, allowed: float) -> tuple[DepthLayers, Level]:
    """Return the smallest number of depth layers that is accurate enough, and a record of this choice.

    Depth layers are distances for which the eye has a PSF. A perfect lens needs only a single PSF, for light from
    infinity. Other eyes, too, get only this PSF if it is accurate enough, that is, if an upper bound of the error that
    it causes is at most `allowed`. Otherwise, the errors of several numbers of layers are computed in random views, and
    the smallest number whose error is allowed is chosen. If none is accurate enough, the result is the largest number.
    If the PSFs of the layers cannot be computed, the result is one PSF for the mean depth.

    The upper bound is derived as follows. Consider light that passes the pupil at the position p. On the retina, light
    from a point at the distance z is displaced by (Δx, Δy) = f p/z relative to light from infinity, with the focal
    length f. The means of |Δx| and |Δy| over a pupil of radius R are both 4/(3π) f R/z. Divided by a receptor's width
    and height, respectively, they add up to the fraction of the receptor's light that is displaced across its border.
    This fraction is an upper bound of the error in scenes that are not brighter than white.
    """
    if eye.pupil is None:
        return ONE_PSF, Level("depth", str(ONE_PSF), 0.0, "a perfect lens does not blur")
    distances = trials.distances()
    near, far = float(np.quantile(distances, NEAREST, method="higher")), float(distances[-1])
    aside = 4 / (3 * math.pi) * eye.sensor_distance * eye.pupil.radius / near
    shift = sum(aside / side for side in eye.smallest_receptor)
    bound = eye.throughput * shift
    if bound <= allowed:
        why = f"blur of {shift:.1e} of a receptor at {near:.2g} m, the nearest visible distance"
        return ONE_PSF, Level("depth", str(ONE_PSF), bound, why)
    try:
        errors = trials.errors_of_layers(DepthLayers(far, near, LAYERS[-1]), LAYERS)
    except optics.AccuracyError as error:
        return DepthLayers(far, near, 1), Level("depth", "one PSF", None, f"at the mean depth: {error}")
    count = next((n for n, e in errors.items() if CAUTION * e <= allowed), LAYERS[-1])
    layers = DepthLayers(far, near, count)
    why = f"fewest of 1 ... {LAYERS[-1]} for {allowed:.1e}"
    return layers, Level("depth", str(layers), CAUTION * errors[count], why)


def light(trials: FidelityTrials, sampling: EyeSampling, allowed: float) -> Level:
    """Return a record of how many reflections of light are followed, with the error due to further reflections.

    The choice is "direct" (one reflection) if light that is reflected twice adds at most `allowed`, otherwise "bounce"
    (two). After "bounce", the further reflections are assumed to be a geometric series: each is weaker than the one
    before by the same factor. This factor is the second reflection divided by direct light, but at most 1/2. If the
    tracer cannot follow a second reflection, the result is direct light with an unknown error.
    """
    try:
        twice, direct = trials.reflected_twice(sampling)
    except ValueError as error:
        return Level("light", DIRECT, None, f"the error by light that is reflected twice is unknown: {error}")
    if twice <= allowed:
        return Level("light", DIRECT, twice, f"light that is reflected twice adds at most {allowed:.1e}")
    rest = twice**2 / max(direct - twice, twice)
    return Level("light", BOUNCE, rest, f"light that is reflected twice adds {twice:.1e}, more than {allowed:.1e}")
