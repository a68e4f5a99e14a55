"""Progress messages while files are written."""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["Doing", "in_silence"]

Doing = Callable[[str, float], None]  # (current step, completed fraction of the work in [0, 1])


def in_silence(what: str, share: float) -> None:
    """Ignore a progress message."""
