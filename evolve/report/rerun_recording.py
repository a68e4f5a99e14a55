"""An episode as a recording of rerun, to be looked at from all sides: `rerun FILE.rrd`. Needs the extra `rerun`.

Timelines: `action` counts actions, `time` is the world's [s]. Entities: `world` holds walls, objects and the agent, or
the bodies of a model of somebody's own, with `path`, the animal's, and its eyes, each a camera that shows what it
signals; `signals` the same as numbers (channel, y, x); `perfect_lens` and `scene` what the same receptors would signal
behind a perfect lens, and what a fine grid of them would; `action`, `reward` with its terms below it, and `contact` are
numbers over time, and `outcome` says how an episode in a task of somebody's own ended.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np

from evolve.analysis.filmed_episode import FilmedEpisode
from evolve.report import rerun_bodies, rerun_plan
from evolve.report.footage import AnyEpisode, Stage, stage_of
from evolve.report.ground_plan import GroundPlan
from evolve.report.picture import display
from evolve.report.rerun_layout import layout
from evolve.report.rerun_stream import RerunStream, require_rerun
from evolve.store.atomic_files import unfinished

__all__ = ["write_recording"]

# Told apart by the colour-blind (Okabe and Ito 2008), on black.
COLORS = ((235, 235, 235), (230, 159, 0), (86, 180, 233), (213, 94, 0), (0, 158, 115), (240, 228, 66), (204, 121, 167))


def write_recording(episode: AnyEpisode, path: Path) -> Path:
    """Write an episode, whole or not at all; returns the path.

    Raises:
        ConfigError: rerun is not installed.
    """
    rr = require_rerun()
    stage = stage_of(episode)
    name = f"{episode.task}, candidate {episode.candidate_id}, seed {episode.seed}"
    stream = rr.RecordingStream("rhabdom", recording_id=name, send_properties=False)
    eyes = (rerun_bodies if isinstance(episode, FilmedEpisode) else rerun_plan).EYES
    opens_with = layout(rr, episode, stage, eyes)
    strict = rr.strict_mode()
    rr.set_strict_mode(True)  # else it warns and leaves out what it does not understand
    try:
        with unfinished(path) as neighbour:
            stream.save(neighbour, default_blueprint=opens_with)
            stream.set_log_time_enabled(False)  # when it was written says nothing about the episode
            stream.set_log_tick_enabled(False)
            _write(RerunStream(rr, stream, stage.seconds), episode, stage)
            stream.flush()
            stream.disconnect()
    finally:
        rr.set_strict_mode(strict)
    return path


def _write(to: RerunStream, episode: AnyEpisode, stage: Stage) -> None:
    to.always(("world",), to.rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    if isinstance(episode, FilmedEpisode):
        rerun_bodies.draw_bodies(to, episode.scene, episode.eyes)
        _look(to, episode, stage, rerun_bodies.EYES)
        _count(to, episode, {str(i): commanded for i, commanded in enumerate(episode.action.T)})
        _end(to, episode)
        return
    assert isinstance(stage, GroundPlan)
    rerun_plan.draw_plan(to, episode, stage)
    _look(to, episode, stage, rerun_plan.EYES)
    _count(to, episode, {"speed": episode.action[:, 0], "turn": episode.action[:, 1]})
    to.columns(("contact",), len(episode), to.rr.Scalars.columns(scalars=episode.contact.astype(np.float64)))


def _look(to: RerunStream, episode: AnyEpisode, stage: Stage, eyes: tuple[str, ...]) -> None:
    """What each eye signals, would signal behind a perfect lens, and what there is to see, before each action."""
    rr, weights = to.rr, stage.eyes.eye().spectral_bands.weights
    scenes = {int(t): frame for frame, t in enumerate(episode.radiance_frames)}
    for eye, name in enumerate(stage.eyes.names()):
        for t in range(len(episode)):
            to.log(t, (*eyes, name), rr.Image(display(episode.signals[t, eye], stage.gain)))
            to.log(t, ("signals", name), rr.Tensor(episode.signals[t, eye], dim_names=("channel", "y", "x")))
            to.log(t, ("perfect_lens", name), rr.Image(display(episode.perfect_signals[t, eye])))
            if t in scenes:
                scene = np.einsum("cb,byx->cyx", weights, episode.radiance[scenes[t], eye])
                to.log(t, ("scene", name), rr.Image(display(scene)))


def _count(to: RerunStream, episode: AnyEpisode, commands: dict[str, np.ndarray]) -> None:
    """Numbers over time: commands, and rewards by term."""
    numbers: dict[tuple[str, ...], np.ndarray] = {("reward",): episode.reward}  # no term has its name
    numbers |= {("reward", name): term for name, term in episode.reward_terms.items()}
    numbers |= {("action", name): commanded for name, commanded in commands.items()}
    for (entity, values), color in zip(numbers.items(), itertools.cycle(COLORS), strict=False):
        to.always(entity, to.rr.SeriesLines(colors=color, names=entity[-1]))
        to.columns(entity, len(episode), to.rr.Scalars.columns(scalars=values.astype(np.float64)))


def _end(to: RerunStream, episode: FilmedEpisode) -> None:
    """How it ended, at the last action."""
    told, level = ("solved" if episode.solved else "not solved"), "INFO"
    if episode.failure is not None:
        told, level = f"failed: {episode.failure}", "ERROR"
    to.log(len(episode) - 1, ("outcome",), to.rr.TextLog(told, level=level))
