"""Carrying a run to its end: an executor evaluates its candidates, and watchers follow them."""

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
    """An executor that states the number of its workers.

    count: of workers
    """

    count: int


def local_workers(config: RunConfig) -> LocalExecutor:
    """Processes on this machine; the setting `workers` is their number."""
    return LocalExecutor(evaluate_candidate, config.workers, prepare_device)


def carry_on(
    run: Run,
    watched: Callable[[Run, int], AbstractContextManager[Watcher]],
    workers: Callable[[RunConfig], AbstractContextManager[Workers]] = local_workers,
) -> None:
    """Evaluate all candidates that the record of a run lacks. The caller holds its lock. If an exception ends this
    early, the record remains and the run can be resumed.

    watched: makes the watcher, given the run and the number of workers; entered after the executor
    workers: makes the executor

    Raises:
        RunError: the record cannot be written, or this search does not propose what is on record.
        ExecutorError: no candidate can be evaluated.
    """
    with workers(run.config) as executor, watched(run, executor.count) as watcher:
        evolve(run, executor, watcher)
