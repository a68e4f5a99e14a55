"""Choice of a fidelity (accuracy of rendering) for a built-in world and given eyes, by rendering random views."""

from __future__ import annotations

from dataclasses import replace

import optics
from optics.numerics.arguments import one_of
from sim.eyes.allowed_error import allowed_error
from sim.eyes.compound_eye import CompoundEye
from sim.eyes.depth_layers import DepthLayers
from sim.eyes.eyes import Eyes
from sim.render import fidelity_stages as stages
from sim.render.fidelity import Fidelity, Level
from sim.render.fidelity_choice import Allowed, Samples, Shares, cheapest
from sim.render.fidelity_trials import FidelityTrials
from sim.render.model_fidelity import AUTO, ModelStages
from sim.render.random_views import near_views, random_views
from sim.render.sample_choice import fewest_samples
from sim.render.world_scene import WorldScene, require_eyes_in_world
from sim.scene.poses import Poses
from sim.worlds.world import World

MOMENTS = 6  # number of random views of each kind in which compound eyes are tried
SHARES = Shares(bands=0.35, depth=0.35, light=0.5)  # chosen; 0.71 of the tolerance remains for samples


def choose_fidelity(
    world: World, eyes: Eyes, tolerance: float | None = None, *, bands: str = "auto", tracer: str = "auto"
) -> Fidelity:
    """Return the cheapest fidelity (accuracy of rendering) whose predicted error is within the tolerance.

    Most errors are predicted by rendering random views of the world. If no fidelity is accurate enough, a
    FidelityWarning states by how much the tolerance is exceeded.

    world, eyes: the world, and the eyes of every agent in it
    tolerance: allowed error of a receptor's signal (root mean square, in the unit of signals). The error over
        all receptors and the error over receptors that see a nearby object must both be within it. None: half of the
        eyes' `noise_sigma`, but at least 0.005 times the signal of a white surface
    bands: "auto": the lowest number of spectral bands that is accurate for scenes of any colours; "own": the number of
        bands in `eyes`, with which environments render as well. Compound eyes always use their own bands.
    tracer: tracer that renders the random views, see `sim.BatchedRenderer`

    Raises:
        ValueError: an argument has the wrong type, the tolerance is not positive and finite, `bands` is unknown, or
            BatchedRenderer refuses the world, the eyes or the tracer.
        optics.AccuracyError: the pupil spreads light too far for the PSF to be computed.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
    """
    require_eyes_in_world(world, eyes)
    one_of("bands", bands, ("auto", "own"))
    allowed = allowed_error(eyes.eye(), tolerance)
    if bands == "own" or eyes.ommatidium is not None:
        return chosen_fidelity(WorldScene(world, eyes, tracer), allowed)
    eye = eyes.eye()
    assert isinstance(eye, optics.Eye)
    n_bands, level = stages.bands(eye, SHARES.bands * allowed, world.medium)
    fidelity = chosen_fidelity(WorldScene(world, replace(eyes, bands=n_bands), tracer), allowed)
    return replace(fidelity, levels=(level, *fidelity.levels[1:]))


def chosen_fidelity(scene: WorldScene, tolerance: float | None = None) -> Fidelity:
    """Return the result of `choose_fidelity` for a prepared scene, with the spectral bands of the scene's eyes."""
    if isinstance(scene.eye, CompoundEye):
        return cheapest(ModelStages(scene, _moments(scene), allowed_error(scene.eye, tolerance), AUTO))
    return cheapest(WorldStages(scene, tolerance))


def _moments(scene: WorldScene) -> Poses:
    """Return poses of the agent and the objects in which the error of rendering compound eyes is measured.

    The agent stands at random places. If the world has objects, further poses place it near an object.
    """
    drawn = [random_views, near_views] if scene.world.objects else [random_views]
    views = [draw(scene.world, scene.eyes, MOMENTS) for draw in drawn]
    return Poses.joined(*(scene.poses_at(view.position, view.heading, view.objects) for view in views))


class WorldStages:
    """The stages in which the accuracy of rendering a built-in world is chosen, by trials; see `Stages`."""

    shares: Shares | None = SHARES

    def __init__(self, scene: WorldScene, tolerance: float | None = None) -> None:
        assert isinstance(scene.eye, optics.Eye)
        self.eye, self.allowed = scene.eye, allowed_error(scene.eye, tolerance)
        self._scene, self._trials = scene, FidelityTrials(scene)

    def bands(self) -> Level:
        """See `Stages`."""
        return stages.own_bands(self._scene.world, self.eye)

    def depth(self, allowed: float) -> tuple[DepthLayers, Level | None]:
        """See `Stages`."""
        return stages.depth(self._trials, self.eye, allowed)

    def light(self, depth: DepthLayers, allowed: float) -> Level:
        """See `Stages`."""
        return stages.light(self._trials, self._scene.camera_sampling(depth, self.allowed), allowed)

    def samples(self, depth: DepthLayers, light: Level, allowed: Allowed) -> Samples:
        """See `Stages`."""
        return fewest_samples(self._trials, self._scene.camera_sampling(depth, self.allowed), light, allowed)
