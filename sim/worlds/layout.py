"""Elements of the built-in worlds: a grid of cells, walls and a floor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import mujoco
import numpy as np

from optics.numerics.read_only import ReadOnlyArrays
from optics.spectra.spectrum import Spectrum

CELL = 2.0  # [m] side of a grid cell
# [m] height of walls, equal to the height of the objects. A row of receptors with a vertical field of view of 11° does
# not see over a wall that is at most 8 m away.
WALL_HEIGHT = 1.0

# [m] An object is reached if its centre is closer than this to the agent's centre, as published.
REACH = 1.0
SEPARATION = 2 * REACH  # [m] minimum distance between objects, so that an agent cannot be within reach of two
# [m] minimum distance between the agent's start and an object. The first action from rest covers 0.44 m.
CLEARANCE = REACH + 0.5

# Collision filter: the agent's contype matches the walls' conaffinity. No other pairs match, so MuJoCo tests only
# collisions between the agent and a wall.
WALL_CONAFFINITY = 1


@dataclass(frozen=True)
class Starts(ReadOnlyArrays):
    """Starting positions of agents.

    position: positions [m], (n, 2)
    heading: initial heading at each position [rad], (n,); None: random
    """

    position: np.ndarray
    heading: np.ndarray | None = None


@dataclass(frozen=True)
class Layout(ReadOnlyArrays):
    """Objects, starting positions and goal region that a task adds to a world.

    objects: names of the objects, which are mocap bodies with one sphere each
    starts: starting positions of the agent
    object_spawn: possible positions of objects, (m, 2) [m]
    goal_region: (x_min, y_min, x_max, y_max) [m]; None: no goal region
    spectra: reflectances by material name, for materials that a colour does not describe sufficiently
    training_starts: starting positions of the agent in training; None: `starts`
    episode_steps: number of actions after which an episode is truncated; None: the task's default
    """

    objects: tuple[str, ...]
    starts: Starts
    object_spawn: np.ndarray
    goal_region: np.ndarray | None
    spectra: Mapping[str, Spectrum] = field(default_factory=dict)
    training_starts: Starts | None = None
    episode_steps: int | None = None


def cell_centers(columns: np.ndarray, rows: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Return the centres of grid cells [m], (n, 2).

    The grid is centred on the origin, and row 0 has the smallest y.

    columns, rows: indices of the cells, (n,)
    shape: size of the grid (rows, columns)
    """
    x = (np.asarray(columns) - (shape[1] - 1) / 2) * CELL
    y = (np.asarray(rows) - (shape[0] - 1) / 2) * CELL
    return np.stack([x, y], axis=-1).astype(float)


def add_wall(spec: mujoco.MjSpec, name: str, center: np.ndarray, size: tuple[float, float], material: str) -> None:
    """Add a wall: a box around `center` (x, y) with the sides `size` along x and y [m], which stands on the floor.

    The geom's own x axis runs along the wall, because MuJoCo counts the repeats of a texture with
    `texuniform` along this axis.
    """
    along_y = size[1] > size[0]
    length, width = (size[1], size[0]) if along_y else size
    half_turn = np.sqrt(0.5)
    spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=[center[0], center[1], WALL_HEIGHT / 2],
        quat=[half_turn, 0, 0, half_turn] if along_y else [1, 0, 0, 0],
        size=[length / 2, width / 2, WALL_HEIGHT / 2],
        material=material,
        contype=0,
        conaffinity=WALL_CONAFFINITY,
    )


def set_wall_height(spec: mujoco.MjSpec, height: float) -> None:
    """Change the height of all walls [m]. The walls still stand on the floor."""
    for geom in spec.worldbody.geoms:
        if geom.name.startswith("wall"):
            geom.pos[2] = geom.size[2] = height / 2


def add_floor(spec: mujoco.MjSpec, size: tuple[float, float]) -> None:
    """Add the floor, of this size along x and y [m]. It is visible but does not collide with anything."""
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[size[0] / 2, size[1] / 2, CELL],
        material="floor",
        contype=0,
        conaffinity=0,
    )
