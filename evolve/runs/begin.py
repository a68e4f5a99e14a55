"""Start of a run: its settings are collected from all sources and checked, then its directory is created."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from evolve.config.assemble import assemble
from evolve.config.run_config import RunConfig
from evolve.learning.task_trial import check_layouts, check_settings, try_task
from evolve.runs.start_from import starts_from
from evolve.search.optimizers import OWN
from evolve.search.search import Search
from evolve.store.directory import Run, next_directory
from optics.numerics import device

__all__ = ["PreparedRun", "RunRequest", "check_task", "prepare_run"]

RunT = TypeVar("RunT", bound=Run)


@dataclass(frozen=True)
class RunRequest:
    """The choices from which the settings of a new run are assembled.

    task: name of a built-in task, or "FILE.py:CLASS" for a user task; None if the preset or the TOML file names the
        task
    preset: name of the preset
    config: TOML file, whose settings override the preset; None: no file
    assignments: single settings, "KEY=VALUE", which override all others
    scale: size of the run, "laptop" or "paper", if the preset has both; None: "laptop" for such a preset
    start_from: "RUN:ID", an animal of another run, whose genes become the start values; None: no animal
    """

    task: str | None = None
    preset: str = "paper"
    config: Path | None = None
    assignments: Sequence[str] = ()
    scale: str | None = None
    start_from: str | None = None


@dataclass(frozen=True)
class PreparedRun:
    """Checked settings of a run, which is ready to start. Nothing has been written yet.

    config: settings of the run
    preset: name of the preset, for the name of the run directory; if the preset's name ends with "-" and the name of
        the task, this ending is removed
    origin: "RUN:ID", the animal whose genes are the start values; None without such an animal
    """

    config: RunConfig
    preset: str
    origin: str | None

    def directory(self, out: Path | str | None = None) -> Path:
        """Return the run directory that `create` would use if it were called now.

        out: run directory; None: runs/TASK-PRESET-N, with the first free number N
        """
        return next_directory(self.config.task_name, self.preset) if out is None else Path(out)

    @contextmanager
    def create(self, kind: type[RunT], out: Path | str | None = None) -> Iterator[RunT]:
        """Create the run, yield it, and hold its lock within the context.

        kind: class of the returned object, `Run` or a subclass
        out: run directory; None: runs/TASK-PRESET-N, with the first free number N

        Raises:
            RunError: the directory is not empty, or cannot be written.
            LockedError: another process is creating a run there.
        """
        if out is None:
            run = kind.create_next(self.config, self.preset, self.origin)
        else:
            run = kind.create(out, self.config, self.origin)
        with run.lock():
            yield run


def prepare_run(request: RunRequest, tried: bool = True) -> PreparedRun:
    """Collect the settings of a run, and check that the run can start on this machine. Nothing is written.

    tried: True to build the search, draw random layouts and try the user task in this process. False for a plan
        of a run, for which other processes try the task and measure the speed of training; this process then builds
        the search only for optimizers other than "CMA" and "mutation"

    Raises:
        ConfigError: a setting is invalid, the optimizer is unknown, random layouts cannot be drawn or two of them are
            equal, the user task fails, or it has several mounts (places for eyes) but no method `place` that would
            use them; the message is one line.
        RunError: the run or the animal of `start_from` does not exist, or its record is damaged.
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
    """
    starts = starts_from(request.start_from) if request.start_from else None
    config = assemble(request.task, request.preset, request.config, request.assignments, starts, request.scale)
    if tried or config.search.optimizer not in OWN:  # importing nevergrad takes seconds
        Search(config)  # refuses an unknown optimizer
    device.make_ready()
    if tried:
        check_settings(config)
        check_layouts(config)
        try_task(config)
    origin = starts.name.removeprefix("--from ") if starts else None
    return PreparedRun(config, request.preset.removesuffix(f"-{config.task}"), origin)


def check_task(config: RunConfig) -> list[Warning | str]:
    """Check the layouts and the user task of a run, including a few actions in it, and return the warnings.

    Only warnings that are defined in `optics`, `sim` or `evolve` are returned. A warning that is issued several times
    is returned once.

    A worker process calls this function while a run is planned; see `evolve.cli.pace`.

    Raises:
        ConfigError: see `check_settings`, `check_layouts` and `try_task`.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_settings(config)
        check_layouts(config)
        try_task(config)
    own = [warning for warning in caught if warning.category.__module__.split(".")[0] in ("optics", "sim", "evolve")]
    return list({str(warning.message): warning.message for warning in own}.values())
