"""How a run is going: a bar on a terminal, a line per candidate elsewhere."""

from __future__ import annotations

import statistics
import sys
import time
from types import TracebackType
from typing import Any, TextIO

from evolve.candidate import Candidate
from evolve.store import Run

__all__ = ["Bar", "Lines", "Tally", "watcher"]


class Tally:
    """Counts what happened since the run was begun or continued; candidates in training count by their steps."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self._began = time.monotonic()
        self._known_before = len(run.candidates)
        self._steps_done = 0
        self._in_training: dict[int, tuple[int, int]] = {}

    def training(self, candidate_id: int, steps: int, planned: int) -> None:
        self._in_training[candidate_id] = steps, planned

    def evaluated(self, candidate: Candidate) -> None:
        self._in_training.pop(candidate.id, None)
        self._steps_done += candidate.steps

    @property
    def done(self) -> float:
        """Candidates evaluated, those in training by the part that is over."""
        parts = (min(steps / planned, 1.0) for steps, planned in self._in_training.values() if planned)
        return len(self._run.candidates) + sum(parts)

    @property
    def steps_per_second(self) -> float:
        steps = self._steps_done + sum(steps for steps, _ in self._in_training.values())
        return steps / max(time.monotonic() - self._began, 1e-9)

    @property
    def seconds_left(self) -> float | None:
        """At the pace so far; None before anything has been done."""
        since = self.done - self._known_before
        if since <= 0:
            return None
        return (time.monotonic() - self._began) / since * (self._run.config.candidates - self.done)

    def summary(self) -> str:
        """Generation, best and median fitness, pace and time left."""
        run = self._run
        reached = min(len(run.candidates) // run.config.search.population + 1, run.config.search.generations)
        parts = [f"generation {reached}/{run.config.search.generations}"]
        if run.best is not None:
            latest = run.generation(max(candidate.generation for candidate in run.candidates))
            fitness = [candidate.fitness for candidate in latest if candidate.failure is None]
            parts.append(f"best {run.best.fitness:.3g}")
            parts += [f"median {statistics.median(fitness):.3g}"] if fitness else []
        parts.append(f"{self.steps_per_second:,.0f} steps/s")
        if self.seconds_left is not None:
            parts.append(f"{_clock(self.seconds_left)} left")
        return ", ".join(parts)


class Lines:
    """Watcher that writes one plain line per candidate."""

    def __init__(self, run: Run, out: TextIO) -> None:
        self._run, self._out, self._tally = run, out, Tally(run)

    def __enter__(self) -> Lines:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return None

    def training(self, candidate_id: int, steps: int, planned: int) -> None:
        self._tally.training(candidate_id, steps, planned)

    def evaluated(self, candidate: Candidate) -> None:
        self._tally.evaluated(candidate)
        outcome = f"failed ({candidate.failure})" if candidate.failure else f"fitness {candidate.fitness:.3g}"
        count = f"{len(self._run.candidates)}/{self._run.config.candidates}"
        print(f"candidate {candidate.id} ({count}): {outcome}; {self._tally.summary()}", file=self._out, flush=True)


class Bar:
    """Watcher that draws a progress bar on a terminal; failures stay above it."""

    def __init__(self, run: Run, out: TextIO) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        columns: list[Any] = [BarColumn(), TextColumn("{task.percentage:>3.0f}%"), TimeElapsedColumn()]
        self._progress = Progress(*columns, TextColumn("{task.description}"), console=Console(file=out))
        self._tally = Tally(run)
        self._bar = self._progress.add_task(self._tally.summary(), total=run.config.candidates)

    def __enter__(self) -> Bar:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()

    def training(self, candidate_id: int, steps: int, planned: int) -> None:
        self._tally.training(candidate_id, steps, planned)
        self._update()

    def evaluated(self, candidate: Candidate) -> None:
        self._tally.evaluated(candidate)
        if candidate.failure:
            self._progress.console.print(
                f"candidate {candidate.id} failed: {candidate.failure}", markup=False, highlight=False
            )
        self._update()

    def _update(self) -> None:
        self._progress.update(self._bar, completed=self._tally.done, description=self._tally.summary())


def watcher(run: Run, out: TextIO = sys.stderr) -> Bar | Lines:
    """The watcher that suits `out`."""
    return Bar(run, out) if out.isatty() else Lines(run, out)


def _clock(seconds: float) -> str:
    """1:02:03, or 2:03 below an hour."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
