"""As little work as the receptors' noise allows: how many rays, bands and depth layers a world needs for given eyes.

An error below half of the noise changes nothing that the brain can tell. Every stage has levels, cheapest first; the
cheapest whose predicted error fits is taken, and what was chosen is on record with its reason.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from numbers import Real

import numpy as np

import optics
from optics.numerics.arguments import whole
from sim.eyes.depth_layers import ONE_PSF, DepthLayers
from sim.eyes.eyes import Eyes
from sim.eyes.receptive_fields import NoRaysError
from sim.eyes.sensor import EyeSampling
from sim.render.band_error import band_error, measured
from sim.render.fidelity_trials import FidelityTrials
from sim.render.prepared_scene import PreparedScene
from sim.tracing.lighting import BOUNCE, DIRECT, LEVELS
from sim.worlds.world import World

# Errors beside noise add up as squares: half of it makes √(1 + 1/4) = 1.12 of it.
SHARE_OF_NOISE = 0.5
# Chosen: errors of less than this share of white's signal never cost rays, however little noise there is.
LEAST_TOLERANCE = 5e-3
# Chosen: times an error that a few random views have; what agents live through has another
# (tests/sim/render/test_fidelity.py holds that against the noise).
CAUTION = 1.2
# Numbers of rays that are tried: steps of about √2, so that hardly more are traced than are needed.
PERFECT_LENS_RAYS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)
PUPIL_RAYS = (*(2.0**k * (1 + half / 2) for k in range(-4, 6) for half in (0, 1)), 64.0)
# Chosen, of the tolerance; errors add up as squares, so that √(1 - 2 · 0.35² - 0.5²) = 0.71 of it is left to the rays.
SHARE_OF_DEPTH = SHARE_OF_BANDS = 0.35
SHARE_OF_LIGHT = 0.5
LAYERS = (1, 3, 5, 9)  # nodes of each are among those of the next
RAYS, AREAS = SAMPLES = ("rays", "areas")
NEAREST = 0.005  # chosen: quantile of the distances that counts as the nearest
MOST_RAYS = 1e7  # per receptor: what is more was a slip, and its arithmetic overflows
MOST_BANDS = 4096


@dataclass(frozen=True)
class Level:
    """What was chosen for one stage, and why. predicted_error: of a signal, root mean square (of the eyes' own bands a
    bound: the worst measured reflectance and type of receptor, which may exceed any tolerance); None where unknown."""

    stage: str
    level: str
    predicted_error: float | None
    why: str


@dataclass(frozen=True)
class Fidelity:
    """How finely a world is rendered for given eyes; printed, it is a table.

    rays_per_receptor: on average; behind a pupil it may be below 1, since all receptors share all rays
    bands: spectral bands
    depth: distances for which the eye has a PSF
    light: what of it is followed: "direct", or "bounce", which adds light that is reflected twice
    samples: what eyes look along: "rays", or "areas", which cut each receptor's square into rays_per_receptor
        rectangles and find the mean of each in closed form; direct light, perfect lenses and upright worlds only
    tolerance: error allowed to a receptor's signal (root mean square); None where nothing was chosen
    levels: what was chosen for each stage, and why

    Raises:
        ValueError: bands or rays_per_receptor that are no numbers or out of range, or unknown light.
    """

    rays_per_receptor: float
    bands: int
    depth: DepthLayers = ONE_PSF
    tolerance: float | None = None
    levels: tuple[Level, ...] = ()
    light: str = DIRECT
    samples: str = RAYS

    def __post_init__(self) -> None:
        rays = self.rays_per_receptor
        if not (isinstance(rays, Real) and 0 < rays <= MOST_RAYS):
            raise ValueError(f"rays_per_receptor = {rays!s:.40}: must be positive and at most {MOST_RAYS:g}, or 'auto'")
        whole("bands", self.bands, 1, MOST_BANDS)
        if self.light not in LEVELS:
            raise ValueError(f"light = {self.light!r}: must be one of {', '.join(map(repr, LEVELS))}")
        if self.samples not in SAMPLES:
            raise ValueError(f"samples = {self.samples!r}: must be one of {', '.join(map(repr, SAMPLES))}")

    @property
    def predicted_error(self) -> float | None:
        """Of a receptor's signal, all stages together (root mean square); None where nothing was predicted."""
        known = [level.predicted_error for level in self.levels if level.predicted_error is not None]
        return math.hypot(*known) if known else None

    @property
    def why(self) -> str:
        """The reasons, one line per stage."""
        return "\n".join(f"{level.stage}: {level.why}" for level in self.levels) or "as asked"

    def __str__(self) -> str:
        levels = self.levels or (
            Level("bands", f"{self.bands}", None, "as asked"),
            Level("depth", f"{self.depth}", None, "as asked"),
            Level("light", self.light, None, "as asked"),
            Level(self.samples, f"{self.rays_per_receptor:g} per receptor", None, "as asked"),
        )
        rows = [("stage", "level", "error", "why")]
        for level in levels:
            error = "" if level.predicted_error is None else f"{level.predicted_error:.1e}"
            rows.append((level.stage, level.level, error, level.why))
        widths = [max(len(row[i]) for row in rows) for i in range(3)]
        return "\n".join("  ".join([*(c.ljust(w) for c, w in zip(r, widths, strict=False)), r[3]]) for r in rows)


def choose_fidelity(
    world: World, eyes: Eyes, tolerance: float | None = None, *, bands: str = "auto", tracer: str = "auto"
) -> Fidelity:
    """The cheapest fidelity whose predicted error is within the tolerance.

    tolerance: of a receptor's signal (root mean square); None: half of the receptors' noise, but no less than
        LEAST_TOLERANCE of what white is worth behind the eyes' pupil.
    bands: "auto": as few as scenes of any colours want; "own": the eyes' own, as environments have them
    tracer: by which it is tried, see `sim.BatchedRenderer`

    Raises:
        ValueError: a tolerance that is not positive, unknown bands, and what BatchedRenderer raises for such a world.
    """
    if bands not in ("auto", "own"):
        raise ValueError(f"bands = {bands!r}: must be 'auto' or 'own'")
    allowed = _allowed(eyes, eyes.eye(), tolerance)
    if bands == "own":
        return chosen_fidelity(PreparedScene(world, eyes, tracer), allowed)
    n_bands, level = _bands(eyes.eye(), SHARE_OF_BANDS * allowed)
    fidelity = chosen_fidelity(PreparedScene(world, replace(eyes, bands=n_bands), tracer), allowed)
    return replace(fidelity, levels=(level, *fidelity.levels[1:]))


def fidelity_for(scene: PreparedScene, rays_per_receptor: float | str) -> Fidelity:
    """What these words mean in a scene: so many rays in direct light, or, "auto", what is chosen.

    Raises:
        ValueError: neither a positive number nor "auto".
    """
    return fidelity_asked(rays_per_receptor, scene.eyes) or chosen_fidelity(scene)


def fidelity_asked(rays_per_receptor: float | str, eyes: Eyes) -> Fidelity | None:
    """So many rays in direct light; None where that is left to be chosen, "auto".

    Raises:
        ValueError: neither a positive number nor "auto".
    """
    if not isinstance(rays_per_receptor, str):
        return Fidelity(rays_per_receptor, eyes.bands)
    if rays_per_receptor != "auto":
        raise ValueError(f"rays_per_receptor = {rays_per_receptor!r}: must be positive, or 'auto'")
    return None


def chosen_fidelity(scene: PreparedScene, tolerance: float | None = None) -> Fidelity:
    """What `choose_fidelity` gives for a scene that has been prepared, with the bands that it has."""
    eyes, eye, trials = scene.eyes, scene.eye, FidelityTrials(scene)
    allowed = _allowed(eyes, eye, tolerance)
    depth, depth_level = _depth(trials, eye, SHARE_OF_DEPTH * allowed)
    sampling = scene.sampling(depth)
    light_level = _light(trials, sampling, SHARE_OF_LIGHT * allowed)
    spent = (
        SHARE_OF_DEPTH**2 + SHARE_OF_BANDS**2 + min((light_level.predicted_error or 0) / allowed, SHARE_OF_LIGHT) ** 2
    )
    numbers = PERFECT_LENS_RAYS if eye.pupil is None else PUPIL_RAYS
    errors = trials.errors(sampling, light_level.level)
    rays, rays_level = _fewest(errors, numbers, allowed * math.sqrt(1 - spent))
    levels = _own_bands(scene.world, eye), depth_level, light_level, rays_level
    return Fidelity(rays, eyes.bands, depth, allowed, levels, light_level.level)


def _light(trials: FidelityTrials, sampling: EyeSampling, allowed: float) -> Level:
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


def _allowed(eyes: Eyes, eye: optics.Eye, tolerance: float | None) -> float:
    allowed = max(SHARE_OF_NOISE * eyes.noise_sigma, LEAST_TOLERANCE * eye.throughput)
    if tolerance is None:
        return float(allowed)
    if not 0 < tolerance < math.inf:
        raise ValueError(f"tolerance = {tolerance!r}: must be positive")
    return tolerance


def _bands(eye: optics.Eye, allowed: float) -> tuple[int, Level]:
    """As few bands as `optics.Eye` wants for scenes of any colour."""
    within = min(max(allowed / eye.throughput, 1e-6), 0.5)  # what an Eye takes as its tolerance
    try:
        bands = int(replace(eye, bands="auto", tolerance=within).bands)
    except optics.AccuracyError as error:
        return eye.bands, Level("bands", f"{eye.bands}", None, f"the eyes' own: {error}")
    return bands, Level("bands", f"{bands}", allowed, f"fewest with {allowed:.1e} for any colours up to white")


def _own_bands(world: World, eye: optics.Eye) -> Level:
    """What the eye's own bands make of the world's measured reflectances; of colours given as RGB nothing is known."""
    if not (spectra := measured(world)):
        return Level("bands", f"{eye.bands}", None, "the eyes' own")
    error = float(eye.throughput) * band_error(spectra, eye.receptors, eye.bands)
    return Level("bands", f"{eye.bands}", error, "the eyes' own; error: of measured reflectances in daylight")


def _depth(trials: FidelityTrials, eye: optics.Eye, allowed: float) -> tuple[DepthLayers, Level]:
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


def _fewest(error: Callable[[float], float], numbers: tuple[float, ...], allowed: float) -> tuple[float, Level]:
    """The lowest of these numbers of rays whose error fits. Errors fall no faster than 1/n: numbers that
    could not do by that are left out."""
    at, tried = 0, 0
    while True:
        tried += 1
        try:
            predicted = CAUTION * error(numbers[at])
        except NoRaysError:
            predicted = math.inf
        if predicted <= allowed or at == len(numbers) - 1:
            break
        least = numbers[at] * (predicted / allowed if math.isfinite(predicted) else 1)
        at = next((i for i in range(at + 1, len(numbers)) if numbers[i] >= least), len(numbers) - 1)
    found = "fewest of" if predicted <= allowed else "not enough, but the most of"
    why = f"{found} {numbers[0]:g} ... {numbers[-1]:g} for {allowed:.1e}, {tried} tried"
    return numbers[at], Level("rays", f"{numbers[at]:g} per receptor", predicted, why)
