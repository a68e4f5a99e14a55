"""A world made ready for given eyes: what choosing a fidelity and rendering both begin with, built once for both."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np

import optics
from sim.eyes.depth_layers import DepthLayers
from sim.eyes.eyes import Eyes
from sim.eyes.sampling import EyeSampling, FieldSampling, Trial, eye_sampling
from sim.eyes.sensor import Sensor
from sim.scene.band_error import lights_in_bands
from sim.scene.mirror import MirrorWarning
from sim.tracing.areas.area_tracer import AreaTracer
from sim.tracing.static_scene import StaticScene, build_static_scene
from sim.tracing.tracer import Tracers
from sim.worlds.world import World


def with_band_averaged_lights(world: World, eye: optics.Eye) -> World:
    """The same world as this eye's bands have it, see `lights_in_bands`.

    Warns (`sim.MirrorWarning`) of lights of which so few bands give a type another catch.
    """
    spectra, off = lights_in_bands(world.model, world.spectra, eye)
    for words in off:
        warnings.warn(words, MirrorWarning, stacklevel=3)
    return replace(world, spectra=spectra)


class PreparedScene:
    """A world as the spectral bands of given eyes have it. Nothing in it depends on how finely it will be seen.

    world: geometry, materials and lights
    eyes: of every agent; with their own bands
    tracer: which way rays are traced, see `sim.BatchedRenderer`

    Raises:
        ValueError: a world or a tracer that `sim.BatchedRenderer` refuses.
    """

    def __init__(self, world: World, eyes: Eyes, tracer: str = "auto") -> None:
        self.world, self.eyes, self.eye = world, eyes, eyes.eye()
        self.static: StaticScene = build_static_scene(with_band_averaged_lights(world, self.eye))
        self.tracers = Tracers(world, self.static, self.bands.wavelengths, tracer)
        self._samplings: dict[DepthLayers, EyeSampling] = {}

    @property
    def bands(self) -> optics.SpectralBands:
        """Of the eyes."""
        return self.eye.spectral_bands

    def areas(self, light: str) -> AreaTracer:
        """What sees the world by areas.

        Raises:
            ValueError: a world that has no closed form.
        """
        return self.tracers.areas(light)

    def area_sensor(self, sampling: EyeSampling, per_receptor: float) -> Sensor:
        """What areas are seen along: so many for each receptor."""
        return sampling.areas(per_receptor, in_rows=self._in_rows)

    def area_trial(self, sampling: EyeSampling, per_receptor: float, receptors: np.ndarray) -> Trial:
        """What that sensor has for these receptors."""
        return sampling.area_trial(per_receptor, receptors, in_rows=self._in_rows)

    def may_share(self, sampling: EyeSampling, per_receptor: float) -> bool:
        """Whether areas may be larger than receptors' squares, so many for each."""
        return isinstance(sampling, FieldSampling) and sampling.may_share(per_receptor, in_rows=self._in_rows)

    @property
    def _in_rows(self) -> bool:
        """What is upright has closed forms along columns of any height; spheres' outlines want rows, too."""
        return len(self.static.spheres) > 0

    def sampling(self, depth: DepthLayers, tolerance: float | None = None) -> EyeSampling:
        """How the eye is sampled with these depth layers; its PSFs are computed once, when first asked for.

        tolerance: error allowed to a signal, see `sim.eyes.allowed_error`

        Raises:
            optics.AccuracyError: a pupil whose light spreads too far to be computed.
        """
        if depth not in self._samplings:
            self._samplings[depth] = eye_sampling(self.eye, depth)
        found = self._samplings[depth]
        return replace(found, tolerance=tolerance) if isinstance(found, FieldSampling) else found
