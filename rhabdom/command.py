"""The command `evolve`, wherever the packages are: importing this has put them on Python's path."""

from __future__ import annotations

import sys
from importlib import import_module

__all__ = ["run_command"]


def run_command() -> int:
    """Run one command; returns the exit code."""
    try:
        return int(import_module("evolve.cli.main").main())
    except KeyboardInterrupt:  # while it was being loaded
        return _interrupted()
    except RuntimeError as error:
        if isinstance(error.__cause__, KeyboardInterrupt):  # Python 3.11 hides one that meets a class being made
            return _interrupted()
        raise


def _interrupted() -> int:
    print("evolve: interrupted", file=sys.stderr)
    return 130
