"""Rendering of a built-in world as all eyes of all agents see it; the rays of all eyes are traced together."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from optics.numerics.arguments import of_kind
from sim.eyes.compound_eye import CompoundEye, WorldEye
from sim.eyes.eyes import Eyes
from sim.render.eye_renderer import EyeRenderer
from sim.render.fidelity import AREAS, Fidelity
from sim.render.pending_frame import PendingFrame
from sim.render.prepared_scene import Placed
from sim.render.world_fidelity import chosen_fidelity
from sim.render.world_scene import WorldScene, require_eyes_in_world
from sim.worlds.state import WorldState
from sim.worlds.world import World


class BatchedRenderer(EyeRenderer):
    """A renderer of `n_envs` worlds with the same eyes.

    world: geometry, materials and lights, which all worlds share
    eyes: the eyes of every agent
    n_envs: number of worlds that are rendered at once
    fidelity: accuracy of rendering: number and kind of samples (rays or areas), number of spectral bands, depth layers,
        and reflections of light. `Fidelity(4, bands=4)` traces 4 rays for each receptor in 4 bands. None: the result of
        `choose_fidelity(world, eyes, bands="own")`. It has the eyes' own bands, and is the cheapest fidelity whose
        error of the signals is small compared with the receptors' noise. The fidelity in use is in `.fidelity`
    tracer: "closed_form" (worlds of upright walls, a floor and spheres), "mitsuba" (any shapes), or "auto": the closed
        form if the world has one. The tracer in use is in `.tracer.name`, and the reason for its choice in
        `.tracer.why`
    brightest: attribute, the signal of a white surface that faces all directional lights at once, or the signal of
        veiling light if that is larger

    Raises:
        ValueError: n_envs is below 1, the rays do not fit into memory, an argument has the wrong type, the world or the
            eyes do not support the fidelity, or `tracer` is unknown or "closed_form" for a world without a closed form.
        optics.AccuracyError: the pupil spreads light too far for the PSF to be computed.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
    """

    def __init__(
        self, world: World, eyes: Eyes, n_envs: int, fidelity: Fidelity | None = None, tracer: str = "auto"
    ) -> None:
        require_eyes_in_world(world, eyes)
        if fidelity is not None:
            of_kind("fidelity", fidelity, Fidelity, "sim.Fidelity(4, bands=4), or None")
        scene = WorldScene(world, eyes if fidelity is None else replace(eyes, bands=fidelity.bands), tracer)
        self._open(scene, n_envs, fidelity or chosen_fidelity(scene))

    @classmethod
    def from_scene(cls, scene: WorldScene, n_envs: int, fidelity: Fidelity) -> BatchedRenderer:
        """Return the renderer of a prepared scene.

        Raises:
            ValueError: as in the constructor, or the fidelity and the scene have different numbers of bands.
            optics.AccuracyError: see the constructor.
            optics.BackendError: see the constructor.
        """
        renderer = cls.__new__(cls)
        renderer._open(scene, n_envs, fidelity)
        return renderer

    def _open(self, scene: WorldScene, n_envs: int, fidelity: Fidelity) -> None:
        self.world, self.eyes = scene.world, scene.eyes
        super().__init__(scene, n_envs, in_whole_rays(fidelity, scene.eye))

    def _launched(self, poses: Placed, frozen: Any = None) -> PendingFrame:
        if isinstance(poses, WorldState) and poses.n != self.n_envs:
            raise ValueError(f"state has {poses.n} worlds, this renderer was built for n_envs = {self.n_envs}")
        return super()._launched(poses, frozen)


def in_whole_rays(fidelity: Fidelity, eye: WorldEye) -> Fidelity:
    """Return the fidelity, with the number of samples per receptor rounded to a whole number of at least 1.

    If receptors share their samples, return the fidelity unchanged. Samples are rays or areas, which are rectangles of
    the visual field. In an eye with a pupil, receptors always share rays, but share areas only if there are fewer areas
    than receptors.
    """
    asked = fidelity.rays_per_receptor
    if isinstance(eye, CompoundEye) or eye.pupil is None or (fidelity.samples == AREAS and asked >= 1):
        return replace(fidelity, rays_per_receptor=float(max(1, round(asked))))
    return fidelity
