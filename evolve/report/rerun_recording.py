"""An episode as a recording of rerun, to be looked at from all sides: `rerun FILE.rrd`. Needs the extra `rerun`.

Timelines: `action` counts actions, `time` is the world's [s]. Entities: `world` holds walls, objects and the agent with
its eyes, each a camera that shows what it signals; `signals` the same as numbers (channel, y, x); `perfect_lens` and
`scene` what the same receptors would signal behind a perfect lens, and what a fine grid of them would; `action`,
`reward` and `contact` are numbers over time.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from evolve.analysis.episode import Episode
from evolve.config.run_config import ConfigError
from evolve.report.ground_plan import GroundPlan
from evolve.report.picture import display
from evolve.store.atomic_files import unfinished
from sim.eyes.eyes import EYE_HEIGHT, eye_positions, eye_rotations
from sim.worlds.layout import WALL_HEIGHT

__all__ = ["require_rerun", "write_recording"]

GREY, GOAL, ADVERSARY, BODY = (150, 150, 150), (60, 150, 80), (190, 70, 60), (70, 110, 180)
PICTURES = "world/agent/eyes"


def require_rerun() -> Any:
    """The package rerun.

    Raises:
        ConfigError: it is not installed.
    """
    try:
        import rerun
    except ImportError:
        raise ConfigError("--rrd needs rerun: pip install 'rhabdom[rerun]'") from None
    return rerun


def write_recording(episode: Episode, path: Path) -> Path:
    """Write an episode, whole or not at all; returns the path.

    Raises:
        ConfigError: rerun is not installed.
    """
    rr = require_rerun()
    stage = GroundPlan.of(episode)
    name = f"{episode.task}, candidate {episode.candidate_id}, seed {episode.seed}"
    stream = rr.RecordingStream("rhabdom", recording_id=name, send_properties=False)
    strict = rr.strict_mode()
    rr.set_strict_mode(True)  # else it warns and leaves out what it does not understand
    try:
        with unfinished(path) as neighbour:
            stream.save(neighbour)
            stream.set_log_time_enabled(False)  # when it was written says nothing about the episode
            stream.set_log_tick_enabled(False)
            _furnish(rr, stream, stage)
            _move(rr, stream, episode, stage)
            _look(rr, stream, episode, stage)
            _count(rr, stream, episode, stage)
            stream.flush()
            stream.disconnect()
    finally:
        rr.set_strict_mode(strict)
    return path


def _furnish(rr: Any, stream: Any, stage: GroundPlan) -> None:
    """What does not change: walls, the shapes of agent and objects, and the eyes as cameras."""
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    stream.log("world/walls", _boxes(rr, stage.walls, WALL_HEIGHT, GREY), static=True)
    if stage.goal_region is not None:
        x_min, y_min, x_max, y_max = stage.goal_region
        region = [[(x_min + x_max) / 2, (y_min + y_max) / 2, (x_max - x_min) / 2, (y_max - y_min) / 2]]
        stream.log("world/goal_region", _boxes(rr, np.array(region), 0.02, GOAL), static=True)
    stream.log("world/agent/body", _ball(rr, stage.body_radius, BODY), static=True)
    for name, radius in zip(stage.object_names, stage.object_radius, strict=True):
        color = GOAL if name.startswith("goal") else ADVERSARY
        stream.log(f"world/{name}", _ball(rr, radius, color), static=True)
    height, width = stage.eyes.resolution
    azimuths = stage.eyes.azimuths()
    places = zip(stage.eyes.names(), eye_positions(azimuths), eye_rotations(azimuths), strict=True)
    for name, position, frame in places:
        right, up, axis = frame.T
        camera = np.column_stack([right, -up, axis])  # x to the right, y down, z forward: right-handed
        stream.log(f"{PICTURES}/{name}", rr.Transform3D(translation=position, mat3x3=camera), static=True)
        focal_length = width / (2 * math.tan(math.radians(stage.eyes.fov_deg) / 2))  # in receptors
        stream.log(
            f"{PICTURES}/{name}",
            rr.Pinhole(focal_length=focal_length, width=width, height=height, camera_xyz=rr.ViewCoordinates.RDF),
            static=True,
        )


def _move(rr: Any, stream: Any, episode: Episode, stage: GroundPlan) -> None:
    """Where agent and objects are before each action."""
    for t in range(len(episode)):
        _now(stream, t, stage)
        half = episode.heading[t] / 2
        turned = rr.Quaternion(xyzw=(0.0, 0.0, np.sin(half), np.cos(half)))
        stream.log("world/agent", rr.Transform3D(translation=(*episode.position[t], EYE_HEIGHT), rotation=turned))
        for name, position in zip(stage.object_names, episode.objects[t], strict=True):
            stream.log(f"world/{name}", rr.Transform3D(translation=position))


def _look(rr: Any, stream: Any, episode: Episode, stage: GroundPlan) -> None:
    """What each eye signals, would signal behind a perfect lens, and what there is to see, before each action."""
    weights = stage.eyes.eye().spectral_bands.weights
    scenes = {int(t): frame for frame, t in enumerate(episode.radiance_frames)}
    for eye, name in enumerate(stage.eyes.names()):
        for t in range(len(episode)):
            _now(stream, t, stage)
            stream.log(f"{PICTURES}/{name}", rr.Image(display(episode.signals[t, eye], stage.gain)))
            stream.log(f"signals/{name}", rr.Tensor(episode.signals[t, eye], dim_names=("channel", "y", "x")))
            stream.log(f"perfect_lens/{name}", rr.Image(display(episode.perfect_signals[t, eye])))
            if t in scenes:
                scene = np.einsum("cb,byx->cyx", weights, episode.radiance[scenes[t], eye])
                stream.log(f"scene/{name}", rr.Image(display(scene)))


def _count(rr: Any, stream: Any, episode: Episode, stage: GroundPlan) -> None:
    """Numbers over time: commands, rewards by term, contact."""
    numbers = {f"reward/{name}": term for name, term in episode.reward_terms.items()}
    numbers |= {"reward/total": episode.reward, "contact": episode.contact}
    numbers |= {"action/speed": episode.action[:, 0], "action/turn": episode.action[:, 1]}
    actions = np.arange(len(episode))
    for name, values in numbers.items():
        times = [rr.TimeColumn("action", sequence=actions), rr.TimeColumn("time", duration=actions * stage.seconds)]
        rr.send_columns(name, times, rr.Scalars.columns(scalars=values.astype(np.float64)), recording=stream)


def _now(stream: Any, t: int, stage: GroundPlan) -> None:
    stream.set_time("action", sequence=t)
    stream.set_time("time", duration=t * stage.seconds)


def _boxes(rr: Any, plan: np.ndarray, height: float, color: tuple[int, int, int]) -> Any:
    """Boxes on the floor, from (n, 4): centre x, y and half sides."""
    level = np.full(len(plan), height / 2)
    centers, half_sizes = np.column_stack([plan[:, :2], level]), np.column_stack([plan[:, 2:], level])
    return rr.Boxes3D(centers=centers, half_sizes=half_sizes, colors=color)


def _ball(rr: Any, radius: float, color: tuple[int, int, int]) -> Any:
    return rr.Ellipsoids3D(half_sizes=[[radius] * 3], colors=color, fill_mode="solid")
