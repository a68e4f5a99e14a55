"""Calls of a user's functions after each evaluation of a candidate."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from typing import Any

from evolve.config.checks import ConfigError, quoted
from evolve.runs.carry_on import carry_on
from evolve.runs.output import voices
from evolve.runs.progress import Watchers, watcher
from evolve.store.candidate import Candidate
from evolve.store.directory import Run

__all__ = ["Callback", "Callbacks"]

Callback = Callable[[Run, Candidate], Any]


@dataclass(frozen=True)
class CallbackWatcher:
    """Watcher that calls a user's functions with the run and each candidate, after the candidate is recorded."""

    run: Run
    callbacks: Sequence[Callback]

    def training(self, candidate_id: int, steps: int, planned: int) -> None:
        """Do nothing while a candidate trains."""

    def evaluated(self, candidate: Candidate) -> None:
        for callback in self.callbacks:
            callback(self.run, candidate)


@dataclass(frozen=True)
class Callbacks:
    """Functions that a run from Python calls, and display of its progress.

    callbacks: functions that are called as callback(run, candidate) after every evaluation of a candidate
    progress: True to show a progress bar, or lines if stderr is not a terminal

    Raises:
        ConfigError: the callbacks are not a list of functions.
    """

    callbacks: Sequence[Callback] = ()
    progress: bool = True

    def __post_init__(self) -> None:
        given: Any = self.callbacks
        if not isinstance(given, Sequence) or not all(map(callable, given)):
            raise ConfigError(f"callbacks = {quoted(given)}: must be a list of functions of a run and a candidate")

    def carry_on(self, run: Run) -> None:
        """Continue a run, whose lock this process holds, to its end.

        If a callback raises an exception, the run stops and can be resumed.

        Raises:
            RunError: the record cannot be written, or the search proposes candidates that differ from those on record.
            ExecutorError: no worker can evaluate candidates.
            ConfigError: the optimizer is unknown, or cannot be used with the run's settings.
            OSError: a file of the run cannot be read or written.
        """
        with voices(patient=True):
            carry_on(run, self._watched)

    @contextmanager
    def _watched(self, run: Run, workers: int) -> Iterator[Watchers]:
        with watcher(run, sys.stderr, workers) if self.progress else nullcontext() as shown:
            yield Watchers([*([shown] if shown else []), CallbackWatcher(run, self.callbacks)])
