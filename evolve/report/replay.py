"""Replay of an episode: a page that plays it, further files, and a table of its outcome for the terminal."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

from evolve.config.checks import ConfigError, quoted
from evolve.episodes.episode import Episode
from evolve.episodes.recorder import EVERY, record
from evolve.report.moving_picture import require_ffmpeg, write_gif, write_mp4
from evolve.report.player import write_player
from evolve.report.rerun_recording import write_recording
from evolve.report.rerun_stream import require_rerun
from evolve.store.atomic_files import require_file_name
from evolve.store.directory import Run

__all__ = ["BESIDE", "episode_facts", "episode_table", "write_page", "write_replay"]

BESIDE: Mapping[str, Callable[[Any, Path], Path]] = {"rrd": write_recording, "gif": write_gif, "mp4": write_mp4}


def write_replay(
    run: Run,
    candidate_id: int | None = None,
    seed: int = 0,
    every: int | None = None,
    also: Collection[str] = (),
    out: Path | None = None,
    mode: str = "evaluation",
) -> tuple[Episode, list[Path]]:
    """Record an episode, write a page that plays it, and return the episode and the paths of all files.

    candidate_id: id of the candidate that plays; None: the best candidate
    seed: seed of the episode
    every: number of actions between two images of the scene in a recording for Rerun; None: 8
    also: formats of additional files next to the page: "rrd" (a recording for Rerun), "gif" and "mp4"
    out: path of the page; None: a name in the run directory
    mode: "evaluation", or "test" for an episode in layouts that neither training nor evaluation has used (the test set)

    Raises:
        RunError: the candidate does not exist, no candidate has succeeded, or the policy is missing or damaged.
        ConfigError: the package `rerun` or ffmpeg is needed but not installed, `out` ends in .rrd, .gif or .mp4, a
            format or the mode is unknown, `every` is given without "rrd", or the run has no test set. A run with a user
            task also fails if it was opened without naming the task (argument `task`), or if the task's module cannot
            be executed.
        StrangeFileError: `out` is not a regular file, for example a directory.
        ValueError: `every` is not a whole number from 1 to 1,000,000, or `seed` is negative.
        RuntimeError: a method of the user task fails at the start of the episode.
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
        OSError: a file cannot be read or written.
    """
    if isinstance(also, str) or not set(also) <= set(BESIDE):
        raise ConfigError(f"also = {quoted(also)}: must be a list of {', '.join(BESIDE)}")
    if every is not None and "rrd" not in also:
        raise ConfigError(f"every = {quoted(every)}: needs rrd, because only recordings for Rerun show the scene")
    if out is not None:
        _require_page(out)
    if "rrd" in also:
        require_rerun()
    if "mp4" in also:
        require_ffmpeg()
    episode = record(run, candidate_id, seed, EVERY if every is None else every, pictures=True, mode=mode)
    page = write_page(run, episode, out)
    return episode, [page, *(BESIDE[form](episode, page.with_suffix(f".{form}")) for form in BESIDE if form in also)]


def _require_page(out: Path) -> None:
    """Check the path of the page. The check precedes the episode, because playing an episode takes time.

    Raises:
        ConfigError: the path ends in .rrd, .gif or .mp4, the endings of files other than the page.
        StrangeFileError: the path is a link, FIFO, device or directory.
    """
    require_file_name(out)
    if (form := out.suffix.lower().removeprefix(".")) in BESIDE:
        page = out.with_suffix(".html")
        raise ConfigError(f"out = {out}: must name the page, such as {page}; --{form} writes {out.name} next to it")


def write_page(run: Run, episode: Episode, out: Path | None = None) -> Path:
    """Write the page that plays an episode of a run, to `out` or into the run directory, and return its path.

    Raises:
        OSError: the file cannot be written.
    """
    test = "_test" if episode.mode == "test" else ""
    path = out or run.path / f"replay_candidate{episode.candidate_id:06d}_seed{episode.seed}{test}.html"
    if out is not None:  # a run directory that was deleted meanwhile must not reappear
        path.parent.mkdir(parents=True, exist_ok=True)
    return write_player(episode, path)


def episode_facts(episode: Episode) -> dict[str, Any]:
    """Return the outcome of an episode by name, such as its return, the terms of the return, and counts of events."""
    return {
        "task": episode.task,
        "candidate": episode.candidate_id,
        "episode seed": episode.seed,
        **({"layouts": "test set"} if episode.mode == "test" else {}),
        "actions": len(episode),
        "return": float(episode.reward.sum()),
        "terms": {name: float(term.sum()) for name, term in episode.reward_terms.items()},
        **{title: episode.count(term) for term, title in episode.counted.items()},
        "solved": episode.solved,
        **({} if episode.failure is None else {"failure": episode.failure}),
    }


def episode_table(episode: Episode) -> str:
    """Return the outcome of an episode as a table with one line per quantity."""
    rows: list[tuple[str, str]] = []
    for name, value in episode_facts(episode).items():
        if isinstance(value, dict):
            rows += [(f"  {term}", f"{total:.2f}") for term, total in value.items()]
        elif isinstance(value, bool):
            rows.append((name, "yes" if value else "no"))
        else:
            rows.append((name, f"{value:.2f}" if isinstance(value, float) else str(value)))
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {value}" for name, value in rows)
