"""`evolve.run`, which starts and completes a run, and `evolve.resume`, which completes an interrupted one."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import NoneType
from typing import Any

import numpy as np

from evolve.config.checks import ConfigError, quoted
from evolve.interactive.callbacks import Callback, Callbacks
from evolve.interactive.opened_run import OpenedRun
from evolve.runs.begin import RunRequest, prepare_run

__all__ = ["resume", "run"]


def run(
    task: str | None = None,
    preset: str = "paper",
    settings: Mapping[str, Any] | None = None,
    *,
    config: Path | str | None = None,
    scale: str | None = None,
    start_from: str | None = None,
    out: Path | str | None = None,
    callbacks: Sequence[Callback] = (),
    progress: bool = True,
) -> OpenedRun:
    """Start a run, as the command `evolve run` does, and return it when it has finished.

    A run that was started from Python has the same files as one that was started with the command. `evolve status`,
    `evolve resume` and `evolve report` can therefore be used with both.

    task: task for which eyes evolve: a name, or "FILE.py:CLASS" of a user task; None: the task that the preset or the
        settings name
    preset: settings to start from: "quick" (minutes), "paper" (a day), or the name of an experiment (`evolve presets`)
    settings: settings by dotted name, such as {"search.generations": 2, "seed": 1}; they override all other settings.
        Values are numbers, texts, True or False. None: no such settings
    config: path of a TOML file with settings, which override those of the preset; None: no file
    scale: scale of a preset that has several, "laptop" or "paper"; None: "laptop". Presets without scales require None
    start_from: animal whose genes are the start values: "RUN:ID" for the animal ID of another run, or "RUN" for the
        best animal of that run; None: the start values in the settings
    out: run directory; None: runs/TASK-PRESET-N, with the first free number N
    callbacks: functions that are called as callback(run, candidate) after every evaluation of a candidate; an exception
        ends the run
    progress: True to print the progress to stderr

    Raises:
        ConfigError: a setting or an argument is invalid, or the user task fails; the message is one line.
        RunError: the directory is not empty or cannot be written, the animal of `start_from` does not exist, or the
            record of its run is damaged.
        LockedError: another process is creating a run in the directory; see `evolve.store.lock`.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
        ExecutorError: no worker can evaluate candidates; see `evolve.search.job`.
        OSError: a file of the run cannot be read or written.
    """
    _check(task=task, preset=preset, settings=settings, config=config, scale=scale, start_from=start_from, out=out)
    watchers = Callbacks(callbacks, progress)
    assignments = [f"{key}={_toml(value)}" for key, value in (settings or {}).items()]
    file = None if config is None else Path(config)
    with prepare_run(RunRequest(task, preset, file, assignments, scale, start_from)).create(OpenedRun, out) as begun:
        watchers.carry_on(begun)
    return begun


def resume(
    directory: Path | str,
    task: str | None = None,
    *,
    before_damage: bool = False,
    callbacks: Sequence[Callback] = (),
    progress: bool = True,
) -> OpenedRun:
    """Continue an interrupted run to its end, as the command `evolve resume` does, and return it.

    A finished run stays unchanged.

    directory: directory of a run that was started with the command or from Python
    task: "FILE.py:CLASS" if the run has a user task, else None; a user task's code runs only if it is named here
    before_damage: True to continue from the lines of the record before the first damaged line, and to keep a copy of
        the damaged record
    callbacks: functions that are called as callback(run, candidate) after every evaluation of a candidate; an exception
        ends the run
    progress: True to print the progress to stderr

    Raises:
        ConfigError: an argument or the configuration is invalid, or `task` does not name the run's user task, or the
            task has changed or fails; the message is one line.
        RunError: the run does not exist, its format is too old, its record is damaged or cannot be written, or the
            search proposes candidates that differ from those on record.
        LockedError: another process is working on the run; see `evolve.store.lock`.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
        ExecutorError: no worker can evaluate candidates; see `evolve.search.job`.
        OSError: a file of the run cannot be read or written.
    """
    _check(directory=directory, task=task)
    opened = OpenedRun.open(directory, task, before_damage)
    opened.resume(callbacks, progress)
    return opened


RIGHT: Mapping[str, tuple[Any, str]] = {
    "task": ((str, NoneType), "a task's name, or 'FILE.py:CLASS'"),
    "preset": (str, "a preset's name: 'quick', 'paper' or an experiment's"),
    "scale": ((str, NoneType), "'laptop' or 'paper'"),
    "settings": ((Mapping, NoneType), "names and values, {'search.generations': 2}"),
    "config": ((str, os.PathLike, NoneType), "a file's path"),
    "start_from": ((str, NoneType), "'RUN:ID'"),
    "out": ((str, os.PathLike, NoneType), "a directory's path"),
    "directory": ((str, os.PathLike), "a directory's path"),
}


def _check(**given: Any) -> None:
    """Check the types of arguments; `given` contains their values by name.

    Raises:
        ConfigError: an argument has the wrong type.
    """
    for name, value in given.items():
        kinds, right = RIGHT[name]
        if not isinstance(value, kinds):
            raise ConfigError(f"{name} = {quoted(value)}: must be {right}")


def _toml(value: Any) -> str:
    """Return the value of a setting as TOML text, as in the option `--set`.

    The text is written as JSON. JSON and TOML write true, false, finite numbers and most texts in the same way.
    NumPy values are converted to Python values.

    Raises:
        ConfigError: the value cannot be written as JSON.
    """
    try:
        return json.dumps(value.tolist() if isinstance(value, (np.generic, np.ndarray)) else value)
    except TypeError:
        raise ConfigError(f"settings contain {quoted(value)}: must be numbers, texts, true or false") from None
