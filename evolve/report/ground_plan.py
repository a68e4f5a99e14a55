"""Where an episode plays: the world's ground plan and the eyes that look at it."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

import sim
from evolve.analysis.episode import Episode
from sim.eyes.eyes import BODY_RADIUS
from sim.physics.agent_motion import SUBSTEPS

__all__ = ["GroundPlan"]


@dataclass(frozen=True)
class GroundPlan:
    """Ground plan [m] and eyes.

    walls: (n, 4): centre x, y and half sides along x, y
    bounds: x_min, y_min, x_max, y_max of all walls
    goal_region: the same of the goal of navigation or maze, or None
    object_names, object_radius: (object,)
    body_radius: of the agent
    seconds: that one action lasts
    gain: 1/a²: what the pupil's area takes from the light
    """

    eyes: sim.Eyes
    object_names: tuple[str, ...]
    walls: np.ndarray
    bounds: tuple[float, ...]
    goal_region: tuple[float, ...] | None
    object_radius: tuple[float, ...]
    body_radius: float
    seconds: float
    gain: float

    @classmethod
    def of(cls, episode: Episode) -> GroundPlan:
        """The stage of an episode."""
        where = episode.world.evaluation
        world = sim.build_world(episode.task, seed=where["world_seed"], mazes=where["mazes"], course=where["course"])
        model = world.model
        walls = np.array([_footprint(model, i) for i in range(model.ngeom) if model.geom(i).name.startswith("wall")])
        region = world.goal_region
        if where["mazes"] > 1:
            walls, region = _own_maze(walls, region, where["mazes"], float(episode.position[0, 1]))
        low, high = walls[:, :2] - walls[:, 2:], walls[:, :2] + walls[:, 2:]
        return cls(
            eyes=episode.eyes,
            object_names=tuple(world.objects),
            walls=walls,
            bounds=(*low.min(axis=0).tolist(), *high.max(axis=0).tolist()),
            goal_region=None if region is None else tuple(float(edge) for edge in region),
            object_radius=tuple(float(model.geom(name).size[0]) for name in world.objects),
            body_radius=BODY_RADIUS,
            seconds=SUBSTEPS * float(model.opt.timestep),
            gain=1 / episode.eyes.eye().white_signal,
        )


def _own_maze(
    walls: np.ndarray, region: np.ndarray | None, mazes: int, y: float
) -> tuple[np.ndarray, np.ndarray | None]:
    """Walls and goal of the maze around y [m], of as many that lie north of each other, all as high."""
    south, north = (walls[:, 1] - walls[:, 3]).min(), (walls[:, 1] + walls[:, 3]).max()
    height = (north - south) / mazes
    low = south + height * int(np.clip((y - south) // height, 0, mazes - 1))
    own = walls[(walls[:, 1] > low) & (walls[:, 1] < low + height)]
    if region is None:
        return own, None
    rim = region[1] - south
    return own, np.array([region[0], low + rim, region[2], low + height - rim])


def _footprint(model: mujoco.MjModel, geom: int) -> tuple[float, float, float, float]:
    """Ground plan of a box that is turned by a multiple of 90°: half sides are |R| times the box's own."""
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    half = np.abs(rotation.reshape(3, 3)) @ model.geom_size[geom]
    x, y = model.geom_pos[geom][:2]
    return float(x), float(y), float(half[0]), float(half[1])
