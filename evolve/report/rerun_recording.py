"""Recording of an episode for the viewer Rerun. `rerun FILE.rrd` opens it. The extra `rerun` must be installed.

A recording has two timelines: `action` is the number of the action, and `time` is the time in the world [s]. The
recording has the following entities.

`world` contains `bodies`, the animal's `path`, its `eyes` and, if the task has one, the `goal_region`. Each eye is a
camera with an image of its signals.

`signals` contains the same signals as numbers, (channel, y, x). `perfect_lens` contains images of the signals of the
same receptors behind a perfect lens, or, for compound eyes, of the signals without noise. `scene` contains images of
the scene in front of each eye, on a finer grid, at the times at which radiance was recorded.

`action`, `reward` with its terms, and the entries of the observation that are not signals of eyes, such as `contact` or
`feels`, are numbers over time. `outcome` is the outcome of the episode.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np

from evolve.episodes.episode import Episode
from evolve.report.picture import display
from evolve.report.rerun_bodies import EYES, draw_bodies, draw_goal_region
from evolve.report.rerun_layout import layout
from evolve.report.rerun_stream import RerunStream, require_rerun
from evolve.store.atomic_files import unfinished

__all__ = ["write_recording"]

# Colours that colour-blind readers can distinguish on black (Okabe and Ito 2008).
COLORS = ((235, 235, 235), (230, 159, 0), (86, 180, 233), (213, 94, 0), (0, 158, 115), (240, 228, 66), (204, 121, 167))


def write_recording(episode: Episode, path: Path) -> Path:
    """Write a recording of an episode, and return the path. The file is written completely or not at all.

    Raises:
        ConfigError: the package `rerun` is not installed.
        OSError: the file cannot be written.
    """
    rr = require_rerun()
    name = f"{episode.task}, candidate {episode.candidate_id}, seed {episode.seed}"
    stream = rr.RecordingStream("rhabdom", recording_id=name, send_properties=False)
    opens_with = layout(rr, episode)
    strict = rr.strict_mode()
    rr.set_strict_mode(True)  # otherwise, Rerun omits invalid arguments with only a warning
    try:
        with unfinished(path) as neighbour:
            stream.save(neighbour, default_blueprint=opens_with)
            stream.set_log_time_enabled(False)  # Rerun would add timelines for the time of writing
            stream.set_log_tick_enabled(False)
            _write(RerunStream(rr, stream, episode.seconds), episode)
            stream.flush()
            stream.disconnect()
    finally:
        rr.set_strict_mode(strict)
    return path


def _write(to: RerunStream, episode: Episode) -> None:
    to.always(("world",), to.rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    draw_bodies(to, episode.scene, episode.eyes)
    if episode.plan is not None:
        draw_goal_region(to, episode.plan)
    _log_images(to, episode)
    _log_numbers(to, episode)
    _end(to, episode)


def _log_images(to: RerunStream, episode: Episode) -> None:
    """Log the signals of each eye before each action.

    For comparison, also log the signals behind a perfect lens or, for compound eyes, the signals without noise.

    At times at which radiance was recorded, also log the scene in front of each eye.
    """
    rr, weights = to.rr, episode.eyes.eye().spectral_bands.weights
    gain = episode.gain
    scenes = {int(t): frame for frame, t in enumerate(episode.radiance_frames)}
    for eye, name in enumerate(episode.eyes.names()):
        for t in range(len(episode)):
            to.log(t, (*EYES, name), rr.Image(display(episode.signals[t, eye], gain)))
            to.log(t, ("signals", name), rr.Tensor(episode.signals[t, eye], dim_names=("channel", "y", "x")))
            to.log(t, ("perfect_lens", name), rr.Image(display(episode.perfect_signals[t, eye])))
            if t in scenes:
                scene = np.einsum("cb,byx->cyx", weights, episode.radiance[scenes[t], eye])
                to.log(t, ("scene", name), rr.Image(display(scene)))


def _log_numbers(to: RerunStream, episode: Episode) -> None:
    """Log numbers over time: rewards by term, commands, and other entries of the observation."""
    numbers: dict[tuple[str, ...], np.ndarray] = {("reward",): episode.reward}  # its terms are below it
    numbers |= {("reward", name): term for name, term in episode.reward_terms.items()}
    commands = zip(episode.commands, episode.action.T, strict=True)
    numbers |= {("action", command.name): commanded for command, commanded in commands}
    for name, entry in episode.beside.items():
        several = entry.shape[1] > 1
        numbers |= {(name, str(i)) if several else (name,): column for i, column in enumerate(entry.T)}
    for (entity, values), color in zip(numbers.items(), itertools.cycle(COLORS), strict=False):
        to.always(entity, to.rr.SeriesLines(colors=color, names=entity[-1]))
        to.columns(entity, len(episode), to.rr.Scalars.columns(scalars=values.astype(np.float64)))


def _end(to: RerunStream, episode: Episode) -> None:
    """Log the outcome of the episode at the time of the last action."""
    outcome, level = ("solved" if episode.solved else "not solved"), "INFO"
    if episode.failure is not None:
        outcome, level = f"failed: {episode.failure}", "ERROR"
    to.log(len(episode) - 1, ("outcome",), to.rr.TextLog(outcome, level=level))
