"""Display of a run's progress: a bar on a terminal, one line per evaluation in other outputs, or lines of JSON."""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Any, TextIO

from evolve.analysis.fitness_parts import fitness_text
from evolve.config.numbering import Place
from evolve.runs.output import as_it_is, printable
from evolve.search.successive_halving import evaluations
from evolve.store.candidate import Candidate
from evolve.store.directory import Run

__all__ = ["Bar", "Events", "Lines", "Silent", "Tally", "Watchers", "clock", "watcher"]

EVENT_S = 1.0  # [s] minimum time between two events of one candidate's training


class Tally:
    """Counts of evaluations and training steps, from which the pace and the remaining time are computed.

    The pace refers to the time since this process started or resumed the run.

    workers: number of workers
    """

    def __init__(self, run: Run, workers: int = 1) -> None:
        self._run, self._workers = run, workers
        self._began = time.monotonic()
        self._known_before = len(run.in_order_of_finish)
        self._steps_done = 0
        self._busy = 0.0
        self._in_training: dict[int, tuple[int, int]] = {}

    def training(self, candidate_id: int, steps: int, planned: int) -> None:
        before = self._run.steps_of(candidate_id)
        self._in_training[candidate_id] = max(steps - before, 0), planned - before

    def evaluated(self, candidate: Candidate) -> None:
        self._in_training.pop(candidate.id, None)
        before = self._run.on_record(candidate.id, candidate.rung - 1)
        self._steps_done += candidate.steps - (before.steps if before else 0)
        self._busy += candidate.seconds - (before.seconds if before else 0.0)

    @property
    def done(self) -> float:
        """Number of evaluations on record, plus the completed fractions of those that are in progress."""
        parts = (min(steps / planned, 1.0) for steps, planned in self._in_training.values() if planned)
        return len(self._run.in_order_of_finish) + sum(parts)

    @property
    def planned(self) -> int:
        """Total number of evaluations in the whole run if no candidate fails.

        The training of a candidate consists of one or several rungs, and the candidate is evaluated after each of them.
        """
        return evaluations(self._run.config.search)

    @property
    def seconds(self) -> float:
        """Time since this process started or resumed the run [s]."""
        return max(time.monotonic() - self._began, 1e-9)

    @property
    def steps_per_second(self) -> float:
        return (self._steps_done + sum(steps for steps, _ in self._in_training.values())) / self.seconds

    @property
    def utilisation(self) -> float:
        """Fraction of the workers' time that was spent on evaluations that are now complete."""
        return self._busy / (self._workers * self.seconds)

    @property
    def seconds_left(self) -> float | None:
        """Predicted remaining time at the pace so far [s]; None before there is any progress."""
        since = self.done - self._known_before
        if since <= 0:
            return None
        return self.seconds / since * max(self.planned - self.done, 0.0)

    @property
    def median(self) -> float | None:
        """Median fitness of the latest generation; None if no candidate in this generation has succeeded."""
        if not self._run.candidates:
            return None
        latest = self._run.generation(max(candidate.generation for candidate in self._run.candidates))
        fitness = [candidate.fitness for candidate in latest if candidate.failure is None]
        return statistics.median(fitness) if fitness else None

    def summary(self) -> str:
        """Return the generation (counted from 0) and the training steps per second as text.

        Best and median fitness, and the time left, are added if they are known.
        """
        run = self._run
        search = run.config.search
        last = search.generations - 1
        reached = Place.from_id(len(run.candidates), search.population).generation
        parts = [f"generation {min(reached, last)} (last: {last})"]
        if run.best is not None:
            parts.append(f"best {run.best.fitness:.3g}")
        if run.best is not None and self.median is not None:
            parts.append(f"median {self.median:.3g}")
        parts.append(f"{self.steps_per_second:,.0f} steps/s")
        if self.seconds_left is not None:
            parts.append(f"{clock(self.seconds_left)} left")
        return ", ".join(parts)

    def closing(self) -> str:
        """Return a text for the end of a run: duration, training steps per second, and utilisation of the workers."""
        return (
            f"{clock(self.seconds)} at {self.steps_per_second:,.0f} steps/s; "
            f"the {self._workers} workers were busy {self.utilisation:.0%} of the time"
        )


class _Watcher:
    """Base class of watchers, which are context managers that follow a run and show its progress."""

    def __init__(self, run: Run, out: TextIO, workers: int) -> None:
        self.run, self.out, self.tally = run, out, Tally(run, workers)

    def __enter__(self) -> Any:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return None

    def training(self, candidate_id: int, steps: int, planned: int) -> None:
        self.tally.training(candidate_id, steps, planned)

    def evaluated(self, candidate: Candidate) -> None:
        self.tally.evaluated(candidate)


class Silent(_Watcher):
    """Watcher without output."""


class Lines(_Watcher):
    """Watcher that writes one plain line per evaluation of a candidate."""

    def evaluated(self, candidate: Candidate) -> None:
        super().evaluated(candidate)
        fitness = fitness_text(candidate.fitness, candidate.costs, "{:.3g}".format)
        outcome = f"failed ({candidate.failure})" if candidate.failure else f"fitness {fitness}"
        count = f"{len(self.run.in_order_of_finish)}/{self.tally.planned}"
        print(f"candidate {candidate.id} ({count}): {outcome}; {self.tally.summary()}", file=self.out, flush=True)


class Events(_Watcher):
    """Watcher that writes one line of JSON per event."""

    def __init__(self, run: Run, out: TextIO, workers: int) -> None:
        super().__init__(run, out, workers)
        self._reported_at: dict[int, float] = {}

    def training(self, candidate_id: int, steps: int, planned: int) -> None:
        super().training(candidate_id, steps, planned)
        now = time.monotonic()
        if now - self._reported_at.get(candidate_id, -EVENT_S) >= EVENT_S:
            self._reported_at[candidate_id] = now
            self._write({"event": "training", "candidate": candidate_id, "steps": steps, "planned": planned})

    def evaluated(self, candidate: Candidate) -> None:
        super().evaluated(candidate)
        event = {
            "event": "evaluated",
            "candidate": candidate.id,
            "generation": candidate.generation,
            "rung": candidate.rung,
            "fitness": None if candidate.failure else candidate.fitness,
            "task_fitness": None if candidate.failure else candidate.task_fitness,
            "costs": None if candidate.failure else candidate.costs,
            "failure": candidate.failure,
            "evaluated": len(self.run.in_order_of_finish),
            "planned": self.tally.planned,
            "best": None if self.run.best is None else self.run.best.fitness,
            "median": self.tally.median,
            "steps_per_second": self.tally.steps_per_second,
            "seconds_left": self.tally.seconds_left,
        }
        self._write(event)

    def _write(self, event: dict[str, Any]) -> None:
        print(json.dumps(event, allow_nan=False), file=self.out, flush=True)


class Bar(_Watcher):
    """Watcher that draws a progress bar on a terminal, and prints failures above the bar."""

    def __init__(self, run: Run, out: TextIO, workers: int) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        super().__init__(run, out, workers)
        columns: list[Any] = [BarColumn(), TextColumn("{task.percentage:>3.0f}%"), TimeElapsedColumn()]
        self._progress = Progress(*columns, TextColumn("{task.description}"), console=Console(file=as_it_is(out)))
        self._bar = self._progress.add_task(self.tally.summary(), total=self.tally.planned)

    def __enter__(self) -> Bar:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()

    def training(self, candidate_id: int, steps: int, planned: int) -> None:
        super().training(candidate_id, steps, planned)
        self._update()

    def evaluated(self, candidate: Candidate) -> None:
        super().evaluated(candidate)
        if candidate.failure:
            self._progress.console.print(
                f"candidate {candidate.id} failed: {printable(candidate.failure)}", markup=False, highlight=False
            )
        self._update()

    def _update(self) -> None:
        self._progress.update(self._bar, completed=self.tally.done, description=self.tally.summary())


class Watchers:
    """Watcher that forwards each report to several watchers."""

    def __init__(self, watchers: Sequence[Any]) -> None:
        self._watchers = watchers

    def training(self, candidate_id: int, steps: int, planned: int) -> None:
        for one in self._watchers:
            one.training(candidate_id, steps, planned)

    def evaluated(self, candidate: Candidate) -> None:
        for one in self._watchers:
            one.evaluated(candidate)


def watcher(run: Run, out: TextIO = sys.stderr, workers: int = 1, as_json: bool = False) -> Bar | Events | Lines:
    """Return the watcher for an output: Events if `as_json` is True, else Bar on a terminal, and Lines elsewhere.

    out: stream for the output
    workers: number of workers, from which the fraction of time in which workers were busy is computed
    """
    if as_json:
        return Events(run, out, workers)
    return Bar(run, out, workers) if out.isatty() else Lines(run, out, workers)


def clock(seconds: float) -> str:
    """Return a duration as text, in the form 1:02:03, or 2:03 for less than an hour."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
