"""Progress bar with the current step, the completed fraction and the elapsed time. It appears only on a terminal."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import Any, TextIO

from evolve.runs.output import as_it_is, printable

__all__ = ["Waiting"]


class Waiting:
    """Progress bar over steps of unknown duration, a context manager.

    steps: number of steps
    shown: True to show the bar, if the output is a terminal
    out: output stream; None: stderr
    """

    def __init__(self, steps: int, shown: bool = True, out: TextIO | None = None) -> None:
        self._out = out or sys.stderr
        self._steps, self._shown, self._bar = steps, shown, None
        self._done = -1
        self._first: str | None = None
        self._progress: Any = None

    def of_one_step(self, text: str) -> Waiting:
        """Set the text for a bar with a single step, and return this object.

        The step starts when the context is entered.
        """
        self._first = text
        return self

    def __enter__(self) -> Waiting:
        if self._shown and self._out.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

            columns = (SpinnerColumn(), BarColumn(bar_width=20), TimeElapsedColumn(), TextColumn("{task.description}"))
            self._progress = Progress(*columns, console=Console(file=as_it_is(self._out)), transient=True)
            self._progress.start()
            self._bar = self._progress.add_task("", total=self._steps)
        if self._first is not None:
            self.step(self._first)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._progress is not None:
            self._progress.stop()

    def step(self, text: str) -> None:
        """Start the next step, described by `text`."""
        self._done += 1
        self.within(text, 0.0)

    def within(self, text: str, share: float) -> None:
        """Show the completed fraction `share` of the current step, described by `text`."""
        if self._progress is not None:
            shown = printable(text).replace("[", "\\[")
            self._progress.update(self._bar, completed=self._done + share, description=shown)
