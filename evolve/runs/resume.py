"""Preparation of an interrupted run, after it has been opened and before the next candidate is trained.

`evolve.runs.carry_on` then continues the run, and `evolve.search.loop` reports the recorded fitness to the optimizer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from evolve.learning.task_trial import try_task
from evolve.search.successive_halving import finished
from evolve.store.directory import Run
from evolve.store.versions import present, record_start, recorded
from optics.numerics import device

__all__ = ["resuming"]


def _ignore(note: str) -> None:
    """Ignore a note."""


@contextmanager
def resuming(run: Run, note: Callable[[str], Any] = _ignore) -> Iterator[bool]:
    """Repair a run, hold its lock within the context, and yield whether candidates remain to be evaluated.

    If candidates remain, the run is also checked, and this start is recorded in versions.json. Otherwise, obsolete
    checkpoints are removed.

    note: function that is called with each message for the user: on damaged files, on settings that have changed, and
        on software that has changed

    Raises:
        LockedError: another process is working on the run.
        RunError: the record is damaged or cannot be written, config.toml has changed since the run was opened, or
            config.toml has a format too old for the run to be continued.
        ConfigError: config.toml is invalid, the run was opened without naming its user task (argument `task`), or the
            user task fails in a short trial.
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
        OSError: a file of the run cannot be read or written.
    """
    device.make_ready()
    with run.lock():
        run.repair()
        if run.notice:
            note(run.notice)
        if finished(run):
            run.forget_trainings(candidate.id for candidate in run.candidates)
            yield False
            return
        run.require_present_light()
        try_task(run.config)
        for change in _changes(run):
            note(change)
        record_start(run.path, len(run.candidates))
        yield True


def _changes(run: Run) -> Iterator[str]:
    """Yield a note if the software has changed since the first start of the run. Results may then differ."""
    then, now = recorded(run.path), present()
    changed = [f"{name} {now[name]} (was {then[name]})" for name in now if name in then and then[name] != now[name]]
    if changed:
        yield f"the software has changed since this run began: {', '.join(changed)}"
