"""The report of a run: one HTML file that needs nothing but itself."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from evolve.report.doing import Doing, in_silence

if TYPE_CHECKING:
    from evolve.analysis.episode import Episode
    from evolve.store.directory import Run

__all__ = ["FILE", "write"]

FILE = "report.html"


def write(run: Run, episode: Episode | None = None, out: Path | None = None, doing: Doing = in_silence) -> Path:
    """Write `report.html` of a run, whole or not at all, with an episode of the best candidate (default: played now).

    out: another file to write to
    doing: is told what is being made, and how much of the page has been, [0, 1]

    The same run gives the same bytes with the same versions of the libraries.

    Raises:
        ValueError: the best candidate's policy is missing or damaged.
        StrangeFileError: `out` is a directory, say.
    """
    from evolve.analysis.recorder import record
    from evolve.report.page import render
    from evolve.store.atomic_files import require_file_name, write_whole

    if out is not None:  # before an episode is played
        require_file_name(out)
    if episode is None and run.best is not None:
        doing("the best agent plays an episode", 0.0)
        episode = record(run)
    path = out or run.path / FILE
    if out is not None:  # a run that was deleted meanwhile stays so
        path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, render(run, episode, doing))
    return path
