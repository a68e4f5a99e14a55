"""Telling who waits what is being made."""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["Doing", "in_silence"]

Doing = Callable[[str, float], None]  # what is being made, and what share of the whole has been, [0, 1]


def in_silence(what: str, share: float) -> None:
    """Nobody is told."""
