"""As little work as the receptors' noise allows: how many samples, bands and depth layers a world needs for given eyes.

An error below half of the noise changes nothing that the brain can tell. Every stage has levels, cheapest first; the
cheapest whose predicted error fits is taken, and what was chosen is on record with its reason.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import replace

from optics.numerics.arguments import of_kind
from sim.eyes.allowed_error import allowed_error
from sim.eyes.eyes import Eyes
from sim.render import fidelity_stages as stages
from sim.render.fidelity import Fidelity, fidelity_asked
from sim.render.fidelity_trials import FidelityTrials
from sim.render.sample_choice import fewest_samples
from sim.render.world_scene import WorldScene
from sim.worlds.world import World

# Chosen, of the tolerance; errors add up as squares, so that √(1 - 2 · 0.35² - 0.5²) = 0.71 of it is left to samples.
SHARE_OF_DEPTH = SHARE_OF_BANDS = 0.35
SHARE_OF_LIGHT = 0.5


class FidelityWarning(UserWarning):
    """No level that is known keeps the error within what was allowed."""


def choose_fidelity(
    world: World, eyes: Eyes, tolerance: float | None = None, *, bands: str = "auto", tracer: str = "auto"
) -> Fidelity:
    """The cheapest fidelity whose predicted error is within the tolerance; a FidelityWarning says where there is none.

    tolerance: of a receptor's signal (root mean square), over all receptors and over those that see an object near;
        None: half of the receptors' noise, but no less than LEAST_TOLERANCE of what white is worth behind the eyes'
        pupil.
    bands: "auto": as few as scenes of any colours want; "own": the eyes' own, as environments have them
    tracer: by which it is tried, see `sim.BatchedRenderer`

    Raises:
        ValueError: a tolerance that is not positive, unknown bands, and what BatchedRenderer raises for such a world.
    """
    of_kind("world", world, World, "sim.build_world('detection')")
    of_kind("eyes", eyes, Eyes, "sim.Eyes(n_eyes=2)")
    if bands not in ("auto", "own"):
        raise ValueError(f"bands = {bands!r}: must be 'auto' or 'own'")
    allowed = allowed_error(eyes.eye(), tolerance)
    if bands == "own":
        return chosen_fidelity(WorldScene(world, eyes, tracer), allowed)
    n_bands, level = stages.bands(eyes.eye(), SHARE_OF_BANDS * allowed)
    fidelity = chosen_fidelity(WorldScene(world, replace(eyes, bands=n_bands), tracer), allowed)
    return replace(fidelity, levels=(level, *fidelity.levels[1:]))


def fidelity_for(scene: WorldScene, rays_per_receptor: float | str) -> Fidelity:
    """What these words mean in a scene: so many rays in direct light, or, "auto", what is chosen.

    Raises:
        ValueError: neither a positive number nor "auto".
    """
    return fidelity_asked(rays_per_receptor, scene.eyes) or chosen_fidelity(scene)


def chosen_fidelity(scene: WorldScene, tolerance: float | None = None) -> Fidelity:
    """What `choose_fidelity` gives for a scene that has been prepared, with the bands that it has."""
    eyes, eye, trials = scene.eyes, scene.eye, FidelityTrials(scene)
    allowed = allowed_error(eye, tolerance)
    depth, depth_level = stages.depth(trials, eye, SHARE_OF_DEPTH * allowed)
    sampling = scene.sampling(depth, allowed)
    light_level = stages.light(trials, sampling, SHARE_OF_LIGHT * allowed)
    spent = SHARE_OF_BANDS**2 + (SHARE_OF_DEPTH**2 if eye.pupil else 0)
    for_light = min((light_level.predicted_error or 0) / allowed, SHARE_OF_LIGHT) ** 2
    left, all_left = (allowed * math.sqrt(1 - share) for share in (spent + for_light, spent))
    samples = fewest_samples(trials, sampling, light_level, left, all_left)
    levels = stages.own_bands(scene.world, eye), depth_level, samples.light, samples.level
    found = Fidelity(samples.number, eyes.bands, depth, allowed, levels, samples.light.level, samples.kind)
    _warn_if_worse(found, allowed)
    return found


def _warn_if_worse(found: Fidelity, allowed: float) -> None:
    # Of the bands' error only a bound is known, which may be far above it.
    worst = math.hypot(*(level.predicted_error or 0 for level in found.levels[1:]))
    if worst > allowed * (1 + 1e-9):
        lead = max(found.levels[1:], key=lambda level: level.predicted_error or 0)
        warnings.warn(
            f"the best fidelity that pays errs by {worst:.1e} of a signal, {worst / allowed:.1f} times what is "
            f"allowed, {allowed:.1e}: mostly {lead.stage}, {lead.level} ({lead.why})",
            FidelityWarning,
            stacklevel=3,
        )
