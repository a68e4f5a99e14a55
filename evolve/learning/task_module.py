"""Execution of the code of a user task. No other module executes code that belongs to a run."""

from __future__ import annotations

import sys
import traceback
from functools import lru_cache
from types import ModuleType

from evolve.config.checks import ConfigError
from evolve.config.task_code import TaskCode
from evolve.config.task_errors import MODULE
from rhabdom.streams import open_closed_streams
from sim.scene.source import with_compiled_color_spaces
from sim.tasks.batch_task import BatchTask
from sim.tasks.task import Task
from sim.tasks.task_fidelity import resolve_other_fidelities
from sim.tasks.task_settings import compiled
from sim.tasks.user_tasks import require_rewards

__all__ = ["executed_task"]


@lru_cache(maxsize=4)
def executed_task(code: TaskCode, encoded_textures: bool = True) -> Task | BatchTask:
    """Execute the code of a user task, and return the task. Later changes of the task's file have no effect.

    encoded_textures: True to treat colour textures as display colours, except textures for which the model requests
        linear light. False: MuJoCo's compiler decides which textures contain linear light

    Raises:
        ConfigError: the code cannot be executed, the task's class does not derive from `sim.Task` or `sim.BatchTask`,
            its constructor requires arguments, the task's model cannot be compiled, or a task setting is invalid.
            With `encoded_textures=False`, it is also an error if the task's model is already compiled and has textures
            that the compiler decided to treat as linear. The message is one line; it names file and line of an error in
            the user's code.
    """
    module = _executed(code)
    cls = getattr(module, code.name, None)
    if not (isinstance(cls, type) and issubclass(cls, Task | BatchTask)):
        raise ConfigError(f"{code.label}: must be a class that derives from sim.Task or sim.BatchTask", "task")
    try:
        task = cls()
        if not encoded_textures and hasattr(task, "model"):
            _resolve_textures(task)
        compiled(task)
        require_rewards(task)
        return resolve_other_fidelities(task) if isinstance(task, Task) else task
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # for example SystemExit, which would end this process
        raise ConfigError(f"{code.label}: {_message(error, code)}", "task") from error


def _resolve_textures(task: Task | BatchTask) -> None:
    """Set `colorspace="linear"` for those colour textures of a task's model that MuJoCo would treat as linear light.

    MuJoCo's compiler decides this by itself only for textures whose colour space is "auto". All other textures are
    unchanged.

    Raises:
        ValueError: the model has such textures but is already compiled, or it cannot be compiled.
    """
    try:
        task.model = with_compiled_color_spaces(task.model)
    except ValueError as error:
        raise ValueError(f"{error}, because this run has world.encoded_textures = false") from error


def _executed(code: TaskCode) -> ModuleType:
    """Execute the code as a module with a unique name in `sys.modules`, where pickle and dataclasses look it up.

    Raises:
        ConfigError: the code raises an error.
    """
    name = f"{MODULE}{code.sha256[:16]}"
    module = ModuleType(name)
    module.__file__ = str(code.file)
    sys.modules[name] = module
    if str(code.file.parent) not in sys.path:
        sys.path.append(str(code.file.parent))  # at the end, so that its files do not shadow modules
    try:
        exec(compile(code.text, str(code.file), "exec"), module.__dict__)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        del sys.modules[name]
        raise ConfigError(f"{code.file.name}: {_message(error, code)}", "task") from error
    finally:
        open_closed_streams()  # the code may have closed a stream
    return module


def _message(error: BaseException, code: TaskCode) -> str:
    """Return the message of an error. If the user's file caused the error, the message starts with the line number."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(code.file)]
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return f"line {lines[-1]}: {text}" if lines else text
