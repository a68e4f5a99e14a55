"""Worlds and views for tests of areas: near objects, and corridors whose walls form steps."""

import dataclasses

import mujoco
import numpy as np

import sim
from sim.eyes.eyes import BODY_RADIUS, EYE_HEIGHT
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation
from sim.worlds import layout, materials
from sim.worlds.layout import Starts
from sim.worlds.state import WorldState
from sim.worlds.world import build_world

VIEWS = 32
SIGMA = 0.01  # the noise of the default eye, as the unit of errors
EYES = sim.Eyes()
COARSE = sim.Eyes(n_eyes=7, resolution=(3, 3), placement_range_deg=180.0)
BEE = sim.Eyes(receptors="honeybee", bands=6)
ROW = sim.Eyes(n_eyes=10, resolution=(1, 4))


def stairs(change=None) -> sim.World:
    """Return a world with a corridor, two cells wide, between walls of 2 m that follow a diagonal in steps, with
    stripes of two widths.

    change: a function applied to one of the walls
    """
    spec = mujoco.MjSpec.from_string(
        '<mujoco><visual><headlight active="0"/></visual><worldbody>'
        '<body name="agent" pos="0 0 .2"><joint name="agent_x" type="slide" axis="1 0 0"/>'
        '<joint name="agent_y" type="slide" axis="0 1 0"/><joint name="agent_heading" axis="0 0 1"/>'
        '<geom size=".2"/></body></worldbody></mujoco>'
    )
    materials.add_daylight(spec)
    materials.add_plain(spec, "floor", 0.3)  # far brighter than in the tasks, so that shadows on the floor matter
    materials.add_texture(spec, "stripes", materials.stripes((8, 256), 2, axis=1))
    for i, period in enumerate((1.0, 1.6)):
        materials.add_textured(spec, f"stripes_{i}", "stripes", repeat=(2 / period, 1), uniform=True)
    n = 12
    layout.add_floor(spec, (n * layout.CELL, n * layout.CELL))
    row, column = np.indices((n, n))
    free = (abs(row - column) <= 1) & (np.minimum(row, column) > 0) & (np.maximum(row, column) < n - 1)
    for i, (r, c) in enumerate(np.argwhere(~free)):
        centre = layout.cell_centers(np.array(c), np.array(r), (n, n))
        layout.add_wall(spec, f"wall_{i}", centre, (layout.CELL, layout.CELL), f"stripes_{i % 2}")
    if change:
        change(spec.geom("wall_0"))
    spots = layout.cell_centers(column[free], row[free], (n, n))
    return sim.World("navigation", spec.compile(), (), Starts(spots), np.empty((0, 2)), None)


def views(world, n=VIEWS, seed=0) -> WorldState:
    """Return agents at random positions and headings, at least a body's width from the walls. If there are objects,
    half of the agents look at one 0.8 to 4 m away.
    """
    rng = np.random.default_rng(seed)
    state = Simulation(task_of(build_world("detection")), n, seed).reset()
    objects = state.objects[:, : len(world.objects)]
    spots = np.concatenate([world.agent_spawn, world.object_spawn])
    position = spots[rng.integers(len(spots), size=n)] + rng.uniform(-0.6, 0.6, (n, 2))
    heading = rng.uniform(-np.pi, np.pi, n)
    for i in range(n if world.objects else 0):
        if i % 2:
            while np.linalg.norm(objects[i, :, :2] - position[i], axis=1).min() < 0.8:
                position[i] = spots[rng.integers(len(spots))]
            continue
        while True:
            azimuth, distance = rng.uniform(-np.pi, np.pi), rng.uniform(0.8, 4)
            position[i] = objects[i, 0, :2] - distance * np.array([np.cos(azimuth), np.sin(azimuth)])
            if np.linalg.norm(objects[i, :, :2] - position[i], axis=1).min() >= 0.8:
                break
        heading[i] = azimuth + rng.uniform(-0.6, 0.6)
    return dataclasses.replace(state, position=position, heading=heading, objects=objects)


@dataclasses.dataclass(frozen=True)
class Case:
    """Views of a world, the reference by rays, and the receptors that see an object."""

    world: sim.World
    eyes: sim.Eyes
    state: WorldState
    truth: np.ndarray
    on_object: np.ndarray

    @classmethod
    def of(cls, world, eyes, rays):
        """Return the case. rays: number per receptor for the reference"""
        state = views(world)
        truth = sim.BatchedRenderer(world, eyes, state.n, sim.Fidelity(rays, eyes.bands)).signals(state)
        return cls(world, eyes, state, truth, sees_object(world, eyes, state))

    def errors(self, samples, kind="areas"):
        """Return the root-mean-square error, relative to the noise of a perfect lens: over all receptors, and over
        receptors that see an object.
        """
        fidelity = sim.Fidelity(samples, self.eyes.bands, samples=kind)
        signals = sim.BatchedRenderer(self.world, self.eyes, self.state.n, fidelity).signals(self.state)
        error = (signals - self.truth).transpose(0, 1, 3, 4, 2) / SIGMA / self.eyes.eye().throughput
        seen = error[self.on_object]
        return np.sqrt(np.mean(error**2)), np.sqrt(np.mean(seen**2)) if seen.size else 0.0


def sees_object(world, eyes, state) -> np.ndarray:
    """Return the receptors with a part of an object in or near their square, (env, eye, h, w)."""
    height, width = eyes.resolution
    pitch = 2 * np.tan(np.radians(eyes.fov_deg) / 2) / width
    y, x = np.indices(eyes.resolution)
    found = np.zeros((state.n, eyes.n_eyes, height, width), bool)
    for i, (position, heading, objects) in enumerate(zip(state.position, state.heading, state.objects, strict=True)):
        for e, azimuth in enumerate(heading + eyes.azimuths()):
            axis, right = (
                np.array([np.cos(azimuth), np.sin(azimuth), 0]),
                np.array([np.sin(azimuth), -np.cos(azimuth), 0]),
            )
            rays = (
                axis
                + pitch * (x + 0.5 - width / 2)[..., None] * right
                - pitch * (y + 0.5 - height / 2)[..., None] * [0, 0, 1]
            )
            rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
            for centre in objects:
                way = centre - [*position, EYE_HEIGHT] - BODY_RADIUS * axis
                distance = np.linalg.norm(way)
                apart = np.arccos(np.clip(rays @ way / distance, -1, 1))
                found[i, e] |= apart < np.arcsin(min(0.5 / distance, 1)) + pitch * np.sqrt(0.5)
    return found
