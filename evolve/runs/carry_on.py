"""Evaluation of the candidates that are missing in a run. An executor evaluates them; watchers show the progress."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol

from evolve.config.run_config import RunConfig
from evolve.search.local_executor import LocalExecutor
from evolve.search.loop import Executor, Watcher, evolve
from evolve.search.worker import evaluate_candidate, prepare_device
from evolve.store.directory import Run

__all__ = ["Workers", "carry_on", "local_workers"]


class Workers(Executor, Protocol):
    """An executor with a known number of workers.

    count: number of workers
    """

    count: int


def local_workers(config: RunConfig) -> LocalExecutor:
    """Return an executor with processes on this machine.

    The setting `workers` is the number of processes; for 0, there is one for each core.
    """
    return LocalExecutor(evaluate_candidate, config.workers, prepare_device)


def carry_on(
    run: Run,
    watched: Callable[[Run, int], AbstractContextManager[Watcher]],
    workers: Callable[[RunConfig], AbstractContextManager[Workers]] = local_workers,
) -> None:
    """Evaluate all candidates that are missing in the record of a run. The caller must hold the lock of the run.

    If this function raises an exception, the record remains valid, and the run can be resumed.

    watched: function that takes the run and the number of workers, and returns a watcher, which shows the progress;
        this function is called after the executor has started
    workers: function that takes the settings of the run, and returns an executor

    Raises:
        RunError: the record cannot be written, or the search proposes candidates that differ from those on record.
        ExecutorError: candidates cannot be evaluated.
        ConfigError: the optimizer is unknown, or rejects the settings of the run.
        OSError: a file of the run cannot be read or written.
    """
    with workers(run.config) as executor, watched(run, executor.count) as watcher:
        evolve(run, executor, watcher)
