"""The stages of choosing how finely a world is rendered, each with its levels, cheapest first, and its reason."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

import optics
from sim.eyes.depth_layers import ONE_PSF, DepthLayers
from sim.eyes.sampling import EyeSampling
from sim.render.fidelity import Level
from sim.render.fidelity_trials import FidelityTrials
from sim.scene.band_error import band_error, measured
from sim.tracing.lighting import BOUNCE, DIRECT
from sim.worlds.world import World

# Chosen: times an error that a few random views have; what agents live through has another
# (tests/sim/render/test_fidelity.py holds that against the noise).
CAUTION = 1.2
LAYERS = (1, 3, 5, 9)  # nodes of each are among those of the next
NEAREST = 0.005  # chosen: quantile of the distances that counts as the nearest


def bands(eye: optics.Eye, allowed: float) -> tuple[int, Level]:
    """As few bands as `optics.Eye` wants for scenes of any colour."""
    within = min(max(allowed / eye.throughput, 1e-6), 0.5)  # what an Eye takes as its tolerance
    try:
        bands = int(replace(eye, bands="auto", tolerance=within).bands)
    except optics.AccuracyError as error:
        return eye.bands, Level("bands", f"{eye.bands}", None, f"the eyes' own: {error}")
    return bands, Level("bands", f"{bands}", allowed, f"fewest with {allowed:.1e} for any colours up to white")


def own_bands(world: World, eye: optics.Eye) -> Level:
    """What the eye's own bands make of the world's measured reflectances; of colours given as RGB nothing is known."""
    if not (spectra := measured(world.model, world.spectra)):
        return Level("bands", f"{eye.bands}", None, "the eyes' own")
    error = float(eye.throughput) * band_error(spectra, eye.receptors, eye.bands)
    return Level("bands", f"{eye.bands}", error, "the eyes' own; error: of measured reflectances in daylight")


def depth(trials: FidelityTrials, eye: optics.Eye, allowed: float) -> tuple[DepthLayers, Level]:
    """One PSF for infinity where that is certainly enough, else as few layers as random views of the world want.

    Light through the pupil's point p lands f p/z further off than from infinity. In the mean over a disk of radius R
    that is |Δx| + |Δy| = 8/(3π) f R/z; a square receptor's field moves by as much of its width, and no scene up to
    white makes more of it.
    """
    if eye.pupil is None:
        return ONE_PSF, Level("depth", str(ONE_PSF), 0.0, "a perfect lens blurs nothing")
    distances = trials.distances()
    near, far = float(np.quantile(distances, NEAREST, method="higher")), float(distances[-1])
    shift = 8 / (3 * math.pi) * eye.sensor_distance * eye.pupil.radius / near / eye.receptor_pitch
    bound = eye.throughput * shift
    if bound <= allowed:
        why = f"blur of {shift:.1e} of a receptor at {near:.2g} m, the nearest that is seen"
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
    """Direct light where what is reflected twice is little; else both, and of all that is reflected more often only
    its size is known: as small beside what is reflected twice as that is beside direct light."""
    try:
        twice, direct = trials.reflected_twice(sampling)
    except ValueError as error:
        return Level("light", DIRECT, None, f"of what is reflected twice nothing is known: {error}")
    if twice <= allowed:
        return Level("light", DIRECT, twice, f"light that is reflected twice is no more than {allowed:.1e}")
    rest = twice**2 / max(direct - twice, twice)
    return Level("light", BOUNCE, rest, f"light that is reflected twice is worth {twice:.1e}, more than {allowed:.1e}")
