"""Rhabdom's own worlds as any model is seen: eyes mounted on their agent, and where everything is in a state."""

from __future__ import annotations

import warnings
from dataclasses import fields

import mujoco
import numpy as np

import optics
from sim.eyes.eyes import BODY_RADIUS, Eyes
from sim.eyes.mounts import ring
from sim.render.fidelity import Fidelity
from sim.render.model_renderer import ModelRenderer
from sim.scene.mirror import MirrorWarning
from sim.scene.poses import Poses
from sim.worlds.state import WorldState
from sim.worlds.world import World

OUTSIDE = 1e-6  # of the radius: how far above the skin a pupil is, so that rounding does not put it below


def model_renderer(world: World, eyes: Eyes, eye: optics.Eye, n: int) -> ModelRenderer:
    """Eyes at the agent's places on the world's model: for depth, ids and flow."""
    mounts = ring("agent", eyes.n_eyes, eyes.placement_range_deg, BODY_RADIUS * (1 + OUTSIDE))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MirrorWarning)  # of light, which is not asked for
        return ModelRenderer(world.model, eye, mounts, n, Fidelity(1, eye.bands), spectra=world.spectra)


class WorldPoses:
    """Where everything is in all worlds of a state; what does not move is where the model has it."""

    def __init__(self, world: World) -> None:
        model = world.model
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        self._template = Poses.of([data])
        self._agent = int(model.body("agent").id)
        self._agents_geoms = np.flatnonzero(model.geom_bodyid == self._agent)
        self._objects = [int(model.body(name).id) for name in world.objects]
        self._objects_geoms = [int(np.flatnonzero(model.geom_bodyid == body)[0]) for body in self._objects]
        self._offsets = data.geom_xpos[self._objects_geoms] - data.xpos[self._objects]

    def of(self, state: WorldState) -> Poses:
        """As `Poses.of` has them after `sim.worlds.state.pose`."""
        found = {f.name: np.repeat(getattr(self._template, f.name), state.n, axis=0) for f in fields(self._template)}
        turned = np.zeros((state.n, 3, 3))
        turned[:, 0, 0] = turned[:, 1, 1] = np.cos(state.heading)
        turned[:, 1, 0] = np.sin(state.heading)
        turned[:, 0, 1] = -turned[:, 1, 0]
        turned[:, 2, 2] = 1
        found["xpos"][:, self._agent, :2], found["xmat"][:, self._agent] = state.position, turned
        found["geom_xpos"][:, self._agents_geoms, :2] = state.position[:, None]
        found["geom_xmat"][:, self._agents_geoms] = turned[:, None]
        found["xpos"][:, self._objects] = state.objects
        found["geom_xpos"][:, self._objects_geoms] = state.objects + self._offsets
        return Poses(**found)
