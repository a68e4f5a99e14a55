"""Worlds, eyes with perfect and real lenses, and states of agents for the proofs of rendering."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import optics
import sim
from sim.eyes.sampling import BoxSampling
from sim.render.random_views import RandomViews, on_objects
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation
from sim.worlds.state import WorldState

__all__ = ["SCENES", "SIGMA", "Scene", "facing_objects", "lived_through", "rms", "sees_object"]

SIGMA = 0.01
NEAR = (0.8, 4.0)  # [m] distance from an object's centre
STRAY = 0.75  # [m] distance from a cell's centre, along either axis
TURN = 0.6  # [rad] largest angle to the object: within an eye's field of view, or in the gap between two
WITHIN = 16  # rays through a receptor's square; a receptor sees an object if one of them hits it


@dataclass(frozen=True)
class Scene:
    """A task's world, its eyes, and the width of their pupil relative to the retina; None for a perfect lens."""

    task: str
    seed: int
    eyes: sim.Eyes
    aperture: float | None

    @property
    def name(self) -> str:
        height, width = self.eyes.resolution
        pupil = "" if self.aperture is None else f", a = {self.aperture:g}"
        return f"{self.task}, {self.eyes.n_eyes} x ({height} x {width}), {self.lens}{pupil}"

    @property
    def lens(self) -> str:
        return "perfect lens" if self.aperture is None else "lens"

    def eyes_with(self, bands: int) -> sim.Eyes:
        """Return the eyes with the scene's lens, in focus at infinity, and this number of bands."""
        pupil = None
        if self.aperture is not None:
            pupil = optics.Pupil(
                self.aperture * self.eyes.sensor_width / 2, thin_lens_focal_length=self.eyes.eye().sensor_distance
            )
        return replace(self.eyes, optics=pupil, bands=bands, noise_sigma=SIGMA)


TWO_EYES = sim.Eyes(n_eyes=2, resolution=(15, 15), fov_deg=45, placement_range_deg=60)
TEN_EYES = sim.Eyes(n_eyes=10, resolution=(1, 4), fov_deg=30, placement_range_deg=150)
SCENES = (
    Scene("detection", 0, TWO_EYES, None),
    Scene("tracking", 0, TWO_EYES, None),
    Scene("maze", 12, TEN_EYES, None),
    Scene("detection", 0, TWO_EYES, 0.25),
    Scene("tracking", 0, TWO_EYES, 0.5),
    Scene("maze", 12, TEN_EYES, 0.5),
)


def lived_through(world: sim.World, n: int, steps: int = 20) -> WorldState:
    """Return states that agents reach with random actions."""
    simulation = Simulation(task_of(world), n, 3)
    simulation.reset()
    rng = np.random.default_rng(5)
    for _ in range(steps):
        step = simulation.step(rng.uniform(-1, 1, (n, 2)))
        if step.done.any():
            simulation.restart(np.flatnonzero(step.done))
    simulation.close()
    return simulation.state


def facing_objects(world: sim.World, state: WorldState) -> WorldState:
    """Return the same worlds, with each agent at a distance in NEAR from one of its objects and turned towards it."""
    rng = np.random.default_rng(6)
    cells = np.concatenate([world.agent_spawn, world.object_spawn])
    position, heading = np.empty((state.n, 2)), np.empty(state.n)
    for i in range(state.n):
        objects, free = state.objects[i, :, :2], False
        while not free:
            azimuth, distance = rng.uniform(-np.pi, np.pi), rng.uniform(*NEAR)
            place = objects[i % len(objects)] - distance * np.array([np.cos(azimuth), np.sin(azimuth)])
            on_floor = np.abs(cells - place).max(axis=1).min() <= STRAY
            free = on_floor and np.linalg.norm(objects - place, axis=1).min() >= NEAR[0] - 1e-9
        position[i], heading[i] = place, azimuth + rng.uniform(-TURN, TURN)
    return replace(state, position=position, heading=(heading + np.pi) % (2 * np.pi) - np.pi)


def sees_object(world: sim.World, eyes: sim.Eyes, state: WorldState) -> np.ndarray:
    """Return the mask (env, eye, height, width) of the receptors with a part of an object in their square field."""
    sharp = replace(eyes, optics=None)
    directions = BoxSampling(sharp.eye()).sensor(WITHIN).directions
    position, heading, objects = (
        np.repeat(a, eyes.n_eyes, axis=0) for a in (state.position, state.heading, state.objects)
    )
    views = RandomViews(position, heading, objects, np.tile(np.arange(eyes.n_eyes), state.n))
    radii = np.array([world.model.geom_size[world.model.body(name).geomadr[0], 0] for name in world.objects])
    met = on_objects(views, *views.in_agents(sharp, directions), radii)
    return met.reshape(state.n, eyes.n_eyes, *eyes.resolution, WITHIN).any(axis=-1)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
