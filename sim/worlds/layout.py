"""Elements of task worlds: a grid of cells, walls, a floor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import mujoco
import numpy as np

from optics.numerics.read_only import ReadOnlyArrays
from optics.spectra.spectrum import Spectrum

CELL = 2.0  # [m] side of a grid cell
WALL_HEIGHT = 1.0  # [m], the height of the objects; a receptor row of 11° sees only wall up to 8 m away

REACH = 1.0  # [m] from the agent's centre to an object's: an object that is closer is reached, as published
SEPARATION = 2 * REACH  # [m] between objects: no position is within reach of two
CLEARANCE = REACH + 0.5  # [m] between the agent's start and an object; the first action from rest covers 0.44 m

# Collision filter: the agent's contype matches the walls' conaffinity, and there are no other matches. MuJoCo therefore
# tests only pairs of the agent and a wall.
WALL_CONAFFINITY = 1


@dataclass(frozen=True)
class Starts(ReadOnlyArrays):
    """Starting positions of agents.

    position: (n, 2) [m]
    heading: initial heading [rad], (n,); None: random
    """

    position: np.ndarray
    heading: np.ndarray | None = None


@dataclass(frozen=True)
class Layout(ReadOnlyArrays):
    """Additions of a task to a world: mocap sphere bodies and starting positions.

    objects: names of mocap sphere bodies
    starts: starting positions of the agent
    object_spawn: possible positions of objects, (m, 2) [m]
    goal_region: (x_min, y_min, x_max, y_max) [m] or None
    spectra: reflectances of materials, by name, for materials that need more than a colour
    training_starts: starting positions of the agent in training, if they differ
    episode_steps: number of actions after which an episode is truncated; None: the default
    """

    objects: tuple[str, ...]
    starts: Starts
    object_spawn: np.ndarray
    goal_region: np.ndarray | None
    spectra: Mapping[str, Spectrum] = field(default_factory=dict)
    training_starts: Starts | None = None
    episode_steps: int | None = None


def cell_centers(columns: np.ndarray, rows: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Return the centres (n, 2) [m] of grid cells. The grid of `shape` (rows, columns) is centred on the origin, with
    row 0 at the smallest y."""
    x = (np.asarray(columns) - (shape[1] - 1) / 2) * CELL
    y = (np.asarray(rows) - (shape[0] - 1) / 2) * CELL
    return np.stack([x, y], axis=-1).astype(float)


def add_wall(spec: mujoco.MjSpec, name: str, center: np.ndarray, size: tuple[float, float], material: str) -> None:
    """Add a wall: a box of `size` (length along x, along y) [m] that stands on the floor.

    The geom's own x axis runs along the wall, because MuJoCo counts a uniform texture's repeats along this axis.
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


def add_floor(spec: mujoco.MjSpec, size: tuple[float, float]) -> None:
    """Add the floor, `size` [m] along x and y. It is only visible: nothing falls."""
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[size[0] / 2, size[1] / 2, CELL],
        material="floor",
        contype=0,
        conaffinity=0,
    )
