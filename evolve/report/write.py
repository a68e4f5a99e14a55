"""Report of a run, as one self-contained HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from evolve.report.doing import Doing, in_silence

if TYPE_CHECKING:
    from evolve.episodes.episode import Episode
    from evolve.store.directory import Run

__all__ = ["FILE", "write"]

FILE = "report.html"


def write(run: Run, episode: Episode | None = None, out: Path | None = None, doing: Doing = in_silence) -> Path:
    """Write the report of a run, completely or not at all, and return its path.

    With the same versions of the libraries, the same run gives the same bytes.

    episode: an episode of the best candidate; None: an episode is played now, if a candidate has succeeded
    out: path of the file; None: `report.html` in the run directory
    doing: function that is called with the current step and the completed fraction of the work, in [0, 1]

    Raises:
        RunError: the best candidate's policy is missing or damaged.
        ConfigError: the run was opened without naming its user task (argument `task`), or the task's module cannot be
            executed.
        RuntimeError: a method of the user task fails at the start of the episode.
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
        StrangeFileError: `out` is not a regular file, for example a directory.
        OSError: a file cannot be read or written.
    """
    from evolve.episodes.recorder import record
    from evolve.report.page import render
    from evolve.store.atomic_files import require_file_name, write_whole

    if out is not None:  # checked first, because playing an episode takes time
        require_file_name(out)
    if episode is None and run.best is not None:
        doing("the best agent plays an episode", 0.0)
        episode = record(run, pictures=True)
    path = out or run.path / FILE
    if out is not None:  # a run directory that was deleted meanwhile must not reappear
        path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, render(run, episode, doing))
    return path
