"""Source text of a user task, which is a class in a Python file.

The file is read and hashed here, and executed only by `evolve.learning.task_module`.
"""

from __future__ import annotations

import ast
import hashlib
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evolve.config.checks import ConfigError
from optics.numerics.arguments import did_you_mean

__all__ = ["LABEL", "TaskCode", "names_code"]

LABEL = re.compile(r"[^\n\r/\\]+\.py:[A-Za-z_]\w*")
LARGEST_FILE = 2_000_000  # bytes


@dataclass(frozen=True)
class TaskCode:
    """Code of a user task "FILE.py:CLASS".

    name: name of the class
    file: path of the file
    text: text of the whole file
    """

    name: str
    file: Path
    text: str = field(repr=False)

    @property
    def label(self) -> str:
        """Name of the task in a run's config: "FILE.py:CLASS", where FILE.py does not include the folder."""
        return f"{self.file.name}:{self.name}"

    @property
    def sha256(self) -> str:
        return hashlib.sha256(self.text.encode()).hexdigest()

    @classmethod
    def read(cls, named: str) -> TaskCode:
        """Read the code of "FILE.py:CLASS". The file is parsed but not executed.

        Raises:
            ConfigError: the file cannot be read, is too large or is not valid Python, or the class does not exist. The
                message is one line.
        """
        place, _, name = named.partition(".py:") if ".py:" in named else (named.removesuffix(".py"), "", "")
        file = Path(f"{place}.py")
        if any("\ud800" <= letter <= "\udfff" for letter in file.name):  # bytes that are not UTF-8
            raise ConfigError(
                f"task = {named!r}: the name of the file must be UTF-8, as in a run's config.toml", "task"
            )
        try:
            with file.open("rb") as opened:
                content = opened.read(LARGEST_FILE + 1)
        except OSError as error:
            raise ConfigError(f"task = {named!r}: {file} cannot be read ({error.strerror})", "task") from error
        if len(content) > LARGEST_FILE:
            raise ConfigError(
                f"task = {named!r}: {file} has more than {LARGEST_FILE:,} bytes: must be Python text", "task"
            )
        text, classes = _parsed(file, content)
        if name not in classes:
            known = did_you_mean(name, classes) if name else ""
            has = f"it has {', '.join(classes)}" if classes else "it has none"
            raise ConfigError(
                f"task = {named!r}: must be FILE.py:CLASS, a class of {file}{known or f': {has}'}", "task"
            )
        return cls(name, file.resolve(), text)


def names_code(said: Any) -> bool:
    """Return whether the name of a task refers to a Python file."""
    return isinstance(said, str) and (said.endswith(".py") or ".py:" in said)


def _parsed(file: Path, content: bytes) -> tuple[str, list[str]]:
    """Return the text of a file and the names of its top-level classes.

    Raises:
        ConfigError: the content is not UTF-8 text or not valid Python.
    """
    try:
        text = content.decode("utf-8").replace("\r\n", "\n")
        tree = ast.parse(text, str(file))
    except UnicodeDecodeError as error:
        raise ConfigError(f"{file}: is not UTF-8 text", "task") from error
    except SyntaxError as error:
        raise ConfigError(f"{file}, line {error.lineno}: {error.msg}", "task") from error
    except (ValueError, RecursionError) as error:  # null bytes, or deeply nested brackets
        raise ConfigError(f"{file}: is not valid Python: {error}", "task") from error
    return text, [node.name for node in tree.body if isinstance(node, ast.ClassDef)]
