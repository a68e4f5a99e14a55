"""Choice of a task: a built-in task by its name, or a user task by file and class."""

from __future__ import annotations

import re
from dataclasses import dataclass

from evolve.config.checks import ConfigError, quoted
from evolve.config.task_card import TaskCard, card_of
from evolve.config.task_code import TaskCode, names_code
from sim.worlds.catalog import TASKS

__all__ = ["TaskChoice"]


@dataclass(frozen=True)
class TaskChoice:
    """A task, with its code if the user has allowed the code to run.

    label: name of the task in config.toml: the name of a built-in task, or FILE.py:CLASS
    sha256: hash of the file; "" for a built-in task
    code: code of a user task that the user has named on the command line or in a call. None: a built-in task, or a user
        task that the user has not named, whose code must not be executed
    """

    label: str
    sha256: str = ""
    code: TaskCode | None = None

    @classmethod
    def named(cls, said: str) -> TaskChoice:
        """Return the task with the name that the user gave on the command line or in a call.

        The file of a user task is read but not executed. The name of a built-in task is not checked here; see `card`.

        said: name of a built-in task, or "FILE.py:CLASS"

        Raises:
            ConfigError: the file of a user task cannot be read, is too large or is not valid Python, or the class does
                not exist.
        """
        if not names_code(said):
            return cls(said)
        code = TaskCode.read(said)
        return cls(code.label, code.sha256, code)

    @property
    def settings(self) -> dict[str, str]:
        """Entries of the task in config.toml."""
        return {"task": self.label, **({"task_sha256": self.sha256} if self.sha256 else {})}

    @property
    def card(self) -> TaskCard:
        """Properties of the task.

        Raises:
            ConfigError: the task does not exist, its hash is missing, or a hash is given for a task without a file.
        """
        if (card := card_of(self.label)) is None:
            raise ConfigError(
                f"task = {quoted(self.label)}: must be one of {', '.join(TASKS)}, or FILE.py:CLASS of a user task",
                "task",
            )
        if re.fullmatch("[0-9a-f]{64}" if card.has_file else "", self.sha256 or "") is None:
            needs = "the SHA-256 of the file, 64 digits" if card.has_file else "empty, as no file belongs to this task"
            raise ConfigError(f"task_sha256 = {self.sha256!r:.80}: must be {needs}", "task_sha256", "task")
        return card

    @property
    def named_code(self) -> TaskCode | None:
        """Code of a user task; None for a built-in task, which has none.

        Raises:
            ConfigError: the user has not named the user task on the command line or in a call, so its code must not
                run.
        """
        if self.sha256 and self.code is None:
            raise ConfigError(
                f"this run evolves {self.label}, whose code runs only if you name it: add --task {self.label} "
                "(or the present path of the file)"
            )
        return self.code

    def read(self, named: str) -> TaskCode:
        """Read the code of this task from the file that the user names as "FILE.py:CLASS".

        Raises:
            ConfigError: this task has no code, the class has another name, or the file cannot be read or has changed.
        """
        if not self.sha256:
            raise ConfigError(f"--task {named}: this run's task, {self.label}, is built in: leave --task out")
        code = TaskCode.read(named)
        if code.name != self.card.name:
            raise ConfigError(f"--task {named}: this run evolves {self.label}, not {code.name}")
        if code.sha256 != self.sha256:
            raise ConfigError(
                f"--task {named}: {code.file.name} has changed since the run began (SHA-256 {code.sha256[:12]}..., was "
                f"{self.sha256[:12]}...): restore the old file, or start a new run"
            )
        return code
