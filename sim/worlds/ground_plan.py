"""The ground plan of a built-in world, for drawings from above."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from sim.eyes.eyes import BODY_RADIUS
from sim.worlds.world import World

__all__ = ["GroundPlan"]


@dataclass(frozen=True)
class GroundPlan:
    """Ground plan of a world. Lengths are in [m].

    walls: centre (x, y) and half side lengths along x and y of each wall, (n, 4)
    bounds: x_min, y_min, x_max, y_max of all walls
    goal_region: x_min, y_min, x_max, y_max of the goal region in navigation or a maze; None in other tasks
    object_names: names of the objects, (object,)
    object_radius: radii of the objects, (object,)
    object_bodies: ids of the objects' bodies in the model
    body_radius: radius of the agent
    """

    walls: np.ndarray
    bounds: tuple[float, ...]
    goal_region: tuple[float, ...] | None
    object_names: tuple[str, ...]
    object_radius: tuple[float, ...]
    object_bodies: tuple[int, ...]
    body_radius: float

    @classmethod
    def from_world(cls, world: World, place: np.ndarray) -> GroundPlan:
        """Return the plan of a world. If the world has several layouts, the plan shows one of them.

        place: point (x, y) [m], (2,); the plan shows the layout that contains it
        """
        model = world.model
        walls = np.array([_footprint(model, i) for i in range(model.ngeom) if model.geom(i).name.startswith("wall")])
        region = world.goal_region
        if world.mazes > 1:
            north = float(model.geom("floor").size[1])
            walls, region = _layout_around(walls, region, (-north, north), world.mazes, float(place[1]))
        low, high = walls[:, :2] - walls[:, 2:], walls[:, :2] + walls[:, 2:]
        return cls(
            walls=walls,
            bounds=(*low.min(axis=0).tolist(), *high.max(axis=0).tolist()),
            goal_region=None if region is None else tuple(float(edge) for edge in region),
            object_names=tuple(world.objects),
            object_radius=tuple(float(model.geom(name).size[0]) for name in world.objects),
            object_bodies=tuple(int(model.body(name).id) for name in world.objects),
            body_radius=BODY_RADIUS,
        )


def _layout_around(
    walls: np.ndarray, region: np.ndarray | None, extent: tuple[float, float], mazes: int, y: float
) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the walls and the goal region of the maze or course that contains the coordinate y [m].

    The layouts are arranged from south to north and have the same extent along y.

    walls: centres and half side lengths of all walls [m], (wall, 4), as in `GroundPlan`
    region: x_min, y_min, x_max, y_max of the goal regions of all layouts together [m], (4,); None: no goal region
    extent: south and north end of the floor [m]
    mazes: number of layouts
    """
    south, north = extent
    height = (north - south) / mazes
    low = south + height * int(np.clip((y - south) // height, 0, mazes - 1))
    own = walls[(walls[:, 1] > low) & (walls[:, 1] < low + height)]
    if region is None:
        return own, None
    rim = region[1] - south
    return own, np.array([region[0], low + rim, region[2], low + height - rim])


def _footprint(model: mujoco.MjModel, geom: int) -> tuple[float, float, float, float]:
    """Return the centre (x, y) and the half side lengths along x and y of a box that is turned by a multiple of 90°.

    With the rotation matrix R, the half side lengths are |R| times those in the frame of the box.
    """
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    half = np.abs(rotation.reshape(3, 3)) @ model.geom_size[geom]
    x, y = model.geom_pos[geom][:2]
    return float(x), float(y), float(half[0]), float(half[1])
