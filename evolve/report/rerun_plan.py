"""A world of rhabdom's own for rerun: walls, objects and the agent with its eyes."""

from __future__ import annotations

from typing import Any

import numpy as np

from evolve.analysis.episode import Episode
from evolve.report.ground_plan import GroundPlan
from evolve.report.rerun_stream import RerunStream, camera_frames
from sim.eyes.eyes import EYE_HEIGHT, eye_positions, eye_rotations
from sim.worlds.layout import WALL_HEIGHT

__all__ = ["EYES", "draw_plan"]

EYES = ("world", "agent", "eyes")
GREY, GOAL, ADVERSARY, BODY = (150, 150, 150), (60, 150, 80), (190, 70, 60), (70, 110, 180)


def draw_plan(to: RerunStream, episode: Episode, stage: GroundPlan) -> None:
    """What there is, and where it is before each action."""
    _furnish(to, stage)
    _move(to, episode, stage)


def _furnish(to: RerunStream, stage: GroundPlan) -> None:
    """What does not change: walls, the shapes of agent and objects, and the eyes as cameras."""
    to.always(("world", "walls"), _boxes(to.rr, stage.walls, WALL_HEIGHT, GREY))
    if stage.goal_region is not None:
        x_min, y_min, x_max, y_max = stage.goal_region
        region = [[(x_min + x_max) / 2, (y_min + y_max) / 2, (x_max - x_min) / 2, (y_max - y_min) / 2]]
        to.always(("world", "goal_region"), _boxes(to.rr, np.array(region), 0.02, GOAL))
    to.always(("world", "agent", "body"), _ball(to.rr, stage.body_radius, BODY))
    for name, radius in zip(stage.object_names, stage.object_radius, strict=True):
        color = GOAL if name.startswith("goal") else ADVERSARY
        to.always(("world", name), _ball(to.rr, radius, color))
    azimuths = stage.eyes.azimuths()
    places = zip(stage.eyes.names(), eye_positions(azimuths), eye_rotations(azimuths), strict=True)
    for name, position, frame in places:
        to.always((*EYES, name), to.rr.Transform3D(translation=position, mat3x3=camera_frames(frame)))
        to.camera((*EYES, name), stage.eyes)


def _move(to: RerunStream, episode: Episode, stage: GroundPlan) -> None:
    """Where agent and objects are before each action."""
    rr, places = to.rr, np.column_stack([episode.position, np.full(len(episode), EYE_HEIGHT)])
    for t in range(len(episode)):
        half = episode.heading[t] / 2
        turned = rr.Quaternion(xyzw=(0.0, 0.0, np.sin(half), np.cos(half)))
        to.log(t, ("world", "agent"), rr.Transform3D(translation=places[t], rotation=turned))
        for name, position in zip(stage.object_names, episode.objects[t], strict=True):
            to.log(t, ("world", name), rr.Transform3D(translation=position))
    to.path(places)


def _boxes(rr: Any, plan: np.ndarray, height: float, color: tuple[int, int, int]) -> Any:
    """Boxes on the floor, from (n, 4): centre x, y and half sides."""
    level = np.full(len(plan), height / 2)
    centers, half_sizes = np.column_stack([plan[:, :2], level]), np.column_stack([plan[:, 2:], level])
    return rr.Boxes3D(centers=centers, half_sizes=half_sizes, colors=color)


def _ball(rr: Any, radius: float, color: tuple[int, int, int]) -> Any:
    return rr.Ellipsoids3D(half_sizes=[[radius] * 3], colors=color, fill_mode="solid")
