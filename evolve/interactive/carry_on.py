"""A run carried to its end from Python, as `evolve run` and `evolve resume` do it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Any

from evolve.cli.output import voices
from evolve.cli.progress import Watchers, watcher
from evolve.config.checks import ConfigError, quoted
from evolve.search.local_executor import LocalExecutor
from evolve.search.loop import evolve
from evolve.search.worker import evaluate_candidate, prepare_device
from evolve.store.candidate import Candidate
from evolve.store.directory import Run

__all__ = ["Callback", "carry_on", "require_callbacks"]

Callback = Callable[[Run, Candidate], Any]


@dataclass(frozen=True)
class CallbackWatcher:
    """Calls back with each candidate that has been evaluated and is on record."""

    run: Run
    callbacks: Sequence[Callback]

    def training(self, candidate_id: int, steps: int, planned: int) -> None:
        """Nothing is called while a candidate trains."""

    def evaluated(self, candidate: Candidate) -> None:
        for callback in self.callbacks:
            callback(self.run, candidate)


def require_callbacks(callbacks: Any) -> None:
    """Before the first candidate is trained, after which one would be called.

    Raises:
        ConfigError: no list of functions.
    """
    if not isinstance(callbacks, Sequence) or not all(map(callable, callbacks)):
        raise ConfigError(f"callbacks = {quoted(callbacks)}: must be a list of functions of a run and a candidate")


def carry_on(run: Run, callbacks: Sequence[Callback], progress: bool) -> None:
    """Carry a run, whose lock is held, to its end. An exception in a callback ends it; what is on record stays, and
    the run can be carried on.

    progress: whether to print how it goes, to stderr

    Raises:
        RunError: the record cannot be written, or this search does not propose what is on record.
        ExecutorError: no candidate can be evaluated.
    """
    with (
        voices(patient=True),
        LocalExecutor(evaluate_candidate, run.config.workers, prepare_device) as executor,
        watcher(run, sys.stderr, executor.count) if progress else nullcontext() as shown,
    ):
        evolve(run, executor, Watchers([*([shown] if shown else []), CallbackWatcher(run, callbacks)]))
