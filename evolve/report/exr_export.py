"""Export of the radiance and the signals of an animal's eyes, as a sequence of spectral EXR files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

import sim
from evolve.episodes.episode import Episode
from evolve.episodes.recorder import EVERY, record
from evolve.report.doing import Doing, in_silence
from evolve.store.checksums import list_checksums
from evolve.store.directory import EXR, Run
from evolve.store.regular_files import folder, require_regular
from evolve.store.versions import provenance

__all__ = ["export_episode", "export_run"]


def export_run(
    run: Run,
    candidate_id: int | None = None,
    seed: int = 0,
    every: int = EVERY,
    out: Path | None = None,
    doing: Doing = in_silence,
) -> list[Path]:
    """Record an episode, write EXR files, and return their paths.

    candidate_id: id of the candidate that plays; None: the best candidate
    seed: seed of the episode
    every: number of actions from one file to the next
    out: folder of the files; None: `exr/` in the run directory
    doing: function that is called with a text on the current work and its completed fraction, in [0, 1]

    Raises:
        RunError: the candidate does not exist, or its policy is missing or damaged.
        ConfigError: the run was opened without naming its user task (argument `task`), or the task's module cannot be
            executed.
        ValueError: `every` is not a whole number from 1 to 1,000,000, or `seed` is negative.
        RuntimeError: a method of the user task fails at the start of the episode.
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
        OSError: a file cannot be read or written.
    """
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
    doing("the agent plays an episode", 0.0)
    return export_episode(run, record(run, candidate_id, seed, every), out or run.path / EXR, doing)


def export_episode(run: Run, episode: Episode, directory: Path, doing: Doing = in_silence) -> list[Path]:
    """Write one file for each time at which radiance was recorded, and return the paths.

    A file has two parts for each eye: the spectral radiance in front of the eye (for the eye "left": `left.spectral`)
    and the signals of its receptors (`left.receptors`). Attributes identify the run
    (`evolve.store.versions.provenance`), the candidate and the time, and state the pose of the eye. File names contain
    the candidate, the seed of the episode and the time, so that exports of different episodes do not overwrite each
    other. A list of the files' checksums is also written.

    directory: folder of the files, which is created if it is missing; its parent must exist

    Raises:
        OSError: a file cannot be read or written.
    """
    folder(directory)
    source = provenance(run.path)
    files, (height, width) = [], episode.eyes.resolution
    aspect = episode.eyes.field_aspect * height / width
    for frame, t in enumerate(episode.radiance_frames):
        path = directory / f"candidate{episode.candidate_id:06d}_seed{episode.seed}_t{t:04d}.exr"
        require_regular(path)
        doing(f"writing {path.name}", frame / len(episode.radiance_frames))
        sim.write_exr(path, _views(episode, frame, source), pixel_aspect=aspect)
        files.append(path)
    list_checksums(directory, files)
    return files


def _views(episode: Episode, frame: int, source: Mapping[str, Any]) -> list[sim.View]:
    """Return the views of all eyes at one recorded time.

    frame: index of the time in `Episode.radiance_frames`
    source: attributes that identify the run
    """
    t, lens = int(episode.radiance_frames[frame]), episode.eyes.eye()
    peaks = None if lens.mosaic is not None else [kind.peak_nm for kind in lens.receptors.types]
    return [
        sim.View(
            name=name,
            wavelengths_nm=episode.wavelengths_nm,
            radiance=episode.radiance[frame, eye],
            receptors=episode.signals[t, eye],
            attributes={**source, **_attributes(episode, t, eye)},
            peaks_nm=peaks,
        )
        for eye, name in enumerate(episode.eyes.names())
    ]


def _attributes(episode: Episode, t: int, eye: int) -> dict[str, Any]:
    """Return the metadata of a view: task, candidate, time, fields of view, and poses of the animal and of the eye.

    The pose of the eye is the position of its pupil [m] and the unit vectors to its right, upwards and ahead, in world
    coordinates.
    """
    up, scene = float(episode.elevations_deg[eye]), episode.scene
    axes = zip(("eye_right", "eye_up", "eye_ahead"), scene.eye_rotations[t, eye].T, strict=True)
    return {
        "task": episode.task,
        "candidate": episode.candidate_id,
        "seed": episode.seed,
        "time": t,
        "position_m": episode.position[t].tolist(),
        "heading_rad": float(episode.heading[t]),
        "eye_position_m": scene.eye_positions[t, eye].tolist(),
        **{name: axis.tolist() for name, axis in axes},
        "eye_azimuth_deg": float(np.degrees(episode.azimuths[eye])),
        **({} if episode.phenotype.elevation_deg is None else {"eye_elevation_deg": up}),
        "fov_deg": episode.eyes.fov_deg,
        **({} if episode.eyes.vertical_fov_deg is None else {"vertical_fov_deg": episode.eyes.vertical_fov_deg}),
    }
