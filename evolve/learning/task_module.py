"""A user's task, executed: the one place where a run's code becomes objects."""

from __future__ import annotations

import sys
import traceback
from functools import lru_cache
from types import ModuleType

from evolve.config.checks import ConfigError
from evolve.config.task_code import TaskCode
from sim.tasks.batch_task import BatchTask
from sim.tasks.task import Task
from sim.tasks.task_fidelity import with_settled_others
from sim.tasks.task_settings import compiled
from sim.tasks.user_tasks import require_rewards

__all__ = ["executed_task"]


@lru_cache(maxsize=4)
def executed_task(code: TaskCode) -> Task | BatchTask:
    """The task: its file's text is executed as it was read, whatever the file holds by now.

    Raises:
        ConfigError: one line, with file and line where it comes from there: it cannot be executed, the class is no
            `sim.Task` or `sim.BatchTask` or wants arguments, its model cannot be compiled, or a setting of it is wrong.
    """
    module = _executed(code)
    cls = getattr(module, code.name, None)
    if not (isinstance(cls, type) and issubclass(cls, Task | BatchTask)):
        raise ConfigError(f"{code.label}: must be a class that derives from sim.Task or sim.BatchTask", "task")
    try:
        task = cls()
        compiled(task)
        require_rewards(task)
        return with_settled_others(task) if isinstance(task, Task) else task
    except (Exception, SystemExit) as error:
        raise ConfigError(f"{code.label}: {_told(error, code)}", "task") from error


def _executed(code: TaskCode) -> ModuleType:
    """Under a name that no other module has, where pickle and dataclasses find it, too."""
    name = f"rhabdom_task_{code.sha256[:16]}"
    module = ModuleType(name)
    module.__file__ = str(code.file)
    sys.modules[name] = module
    if str(code.file.parent) not in sys.path:
        sys.path.append(str(code.file.parent))  # last: a neighbour of the file shadows nobody
    try:
        exec(compile(code.text, str(code.file), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:  # sys.exit, too, would end us without a word
        del sys.modules[name]
        raise ConfigError(f"{code.file.name}: {_told(error, code)}", "task") from error
    return module


def _told(error: BaseException, code: TaskCode) -> str:
    """The line of the user's file that it comes from, if it does, and what it says."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(code.file)]
    said = " ".join(f"{type(error).__name__}: {error}".split())
    return f"line {lines[-1]}: {said}" if lines else said
