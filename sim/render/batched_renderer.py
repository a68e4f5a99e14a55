"""All eyes of all agents in a built-in world, as one wavefront."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import optics
from sim.eyes.eyes import Eyes
from sim.render.eye_renderer import EyeRenderer
from sim.render.fidelity import AREAS, Fidelity
from sim.render.fidelity_choice import chosen_fidelity
from sim.render.pending_frame import PendingFrame
from sim.render.world_scene import WorldScene
from sim.scene.moved_bodies import MovedBodies
from sim.worlds.state import WorldState
from sim.worlds.world import World


class BatchedRenderer:
    """Sees `n_envs` worlds with the same eyes.

    world: geometry, materials and lights; shared by all worlds
    eyes: of every agent
    n_envs: number of worlds in a state
    fidelity: how finely, with its own number of bands: `Fidelity(4, bands=4)` traces 4 rays for each receptor; None:
        `choose_fidelity(world, eyes, bands="own")`, as finely as the receptors' noise asks for. The one in use is in
        `.fidelity`
    tracer: "closed_form" (worlds of upright walls, a floor and spheres), "mitsuba" (any shapes), or "auto"; the one in
        use is in `.tracer.name`, why in `.tracer.why`
    brightest: signal of a white surface that faced all lights at once
    renderer: what does it

    Raises:
        ValueError: less than one world, more rays than there is memory for, a fidelity that the world cannot have, and
            a world that has no closed form where that is asked for.
    """

    def __init__(
        self, world: World, eyes: Eyes, n_envs: int, fidelity: Fidelity | None = None, tracer: str = "auto"
    ) -> None:
        if fidelity is not None and not isinstance(fidelity, Fidelity):
            raise ValueError(f"fidelity = {fidelity!r}: must be a sim.Fidelity, such as Fidelity(4, bands=4), or None")
        scene = WorldScene(world, eyes if fidelity is None else replace(eyes, bands=fidelity.bands), tracer)
        self._open(scene, EyeRenderer(scene, n_envs, in_whole_rays(fidelity or chosen_fidelity(scene), scene.eye)))

    @classmethod
    def of(cls, scene: WorldScene, n_envs: int, fidelity: Fidelity) -> BatchedRenderer:
        """The renderer of a scene that has been prepared.

        Raises:
            ValueError: as the constructor, and a fidelity for another number of bands than the scene's.
        """
        renderer = cls.__new__(cls)
        renderer._open(scene, EyeRenderer(scene, n_envs, in_whole_rays(fidelity, scene.eye)))
        return renderer

    def _open(self, scene: WorldScene, renderer: EyeRenderer) -> None:
        self._scene, self.renderer = scene, renderer
        self.world, self.eyes, self.eye, self.bands = scene.world, scene.eyes, scene.eye, scene.bands
        self.fidelity, self.tracer, self.sensor = renderer.fidelity, renderer.tracer, renderer.sensor
        self.n_envs, self.brightest = renderer.n_envs, renderer.brightest

    def resized(self, n_envs: int) -> BatchedRenderer:
        """The same eyes and scene for another number of worlds; the scene is shared, not loaded again."""
        other = BatchedRenderer.__new__(BatchedRenderer)
        other._open(self._scene, self.renderer.resized(n_envs))
        return other

    def radiance(self, state: WorldState) -> np.ndarray:
        """Spectral radiance along every ray, (env, eye, ray, band) float32."""
        return self.renderer.radiance(self._poses(state))

    def receptor_radiance(self, state: WorldState) -> np.ndarray:
        """Spectral radiance averaged over every receptor's field, (band, env, eye, height, width) float32."""
        return self.renderer.receptor_radiance(self._poses(state))

    def signals(self, state: WorldState) -> np.ndarray:
        """Noise-free photoreceptor signals, (env, eye, channel, height, width) float32:
        a² sum_b weights[channel, b] radiance_b."""
        return self.begin(state).wait()

    def begin(self, state: WorldState, light: np.ndarray | None = None) -> PendingFrame:
        """Begin to see; see `EyeRenderer.begin`."""
        return self.renderer.begin(self._poses(state), light)

    def begin_some(self, state: WorldState, worlds: np.ndarray, light: np.ndarray | None = None) -> PendingFrame:
        """Begin to see these of the worlds alone; see `EyeRenderer.begin_some`."""
        return self.renderer.begin_some(self._poses(state), worlds, light)

    @property
    def recordings(self) -> int:
        """How often the kernels were recorded: once per kernel in use."""
        return self.renderer.recordings

    def _poses(self, state: WorldState) -> MovedBodies:
        if state.n != self.n_envs:
            raise ValueError(f"state has {state.n} worlds, this renderer was built for n_envs = {self.n_envs}")
        return self._scene.poses(state)


def in_whole_rays(fidelity: Fidelity, eye: optics.Eye) -> Fidelity:
    """With as many samples as each receptor has of its own; behind a pupil they share rays, and may share areas."""
    asked = fidelity.rays_per_receptor
    if eye.pupil is None or (fidelity.samples == AREAS and asked >= 1):
        return replace(fidelity, rays_per_receptor=float(max(1, round(asked))))
    return fidelity
