"""Display of warnings from rhabdom's modules: each is shown once, in one line."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO

__all__ = ["notes"]

OWN = ("optics", "sim", "evolve")


@contextmanager
def notes() -> Iterator[None]:
    """Print rhabdom's warnings as notes within the context. Warnings of other packages keep Python's format.

    Each text is printed once. A command may build the same world several times, for example for training and for a
    replay, and each time a different line of code may issue the same warning. Python's own filter does not suppress
    these repetitions.
    """
    python, said = warnings.showwarning, set[str]()

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        text = " ".join(str(message).split())
        if category.__module__.split(".")[0] not in OWN:
            python(message, category, filename, lineno, file, line)
        elif text not in said:
            said.add(text)
            print(f"note: {text}", file=sys.stderr)

    warnings.showwarning = show
    try:
        yield
    finally:
        warnings.showwarning = python
