"""What rhabdom's own modules warn of, each thing said once and in one line, as commands speak."""

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
    """For the length of a command; other packages' warnings are shown as Python shows them.

    One command builds the same world several times, for a film, for vision, for lessons: each warns from its own line.
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
