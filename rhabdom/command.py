"""The command `evolve`, wherever the packages are: importing this has put them on Python's path."""

from __future__ import annotations

from importlib import import_module

__all__ = ["run_command"]


def run_command() -> int:
    """Run one command; returns the exit code."""
    try:
        return int(import_module("evolve.cli.main").main())
    except KeyboardInterrupt:  # while it was being loaded
        print("\nevolve: interrupted")
        return 130
