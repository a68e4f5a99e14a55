"""Deprecated names and calls that keep working for one version."""

from __future__ import annotations

import warnings
from typing import Any

__all__ = ["renamed", "warn_once", "warn_renamed"]

_warned: set[str] = set()


def warn_renamed(old: str, new: str, stacklevel: int = 3) -> None:
    """Warn once per process that a name has changed."""
    warn_once(old, f"{old} is now called {new}; the old name will be removed in version 0.3", stacklevel + 1)


def warn_once(subject: str, message: str, stacklevel: int = 4) -> None:
    """Warn that a name changes, or that a function must be called in another form.

    The warning is issued once per process for each subject.

    subject: the old name, or a text that identifies the call, such as "heights of optics.torch".
    """
    if subject not in _warned:
        _warned.add(subject)
        warnings.warn(message, FutureWarning, stacklevel)


def renamed(new: str) -> Any:
    """Return a class attribute for an old name. Reading it warns once and returns the attribute `new`."""
    return _Renamed(new)


class _Renamed:
    """Python descriptor for an old name: it warns once, and returns the attribute with the new name."""

    def __init__(self, new: str) -> None:
        self._new, self._old = new, ""

    def __set_name__(self, owner: type, name: str) -> None:
        self._old = f"{owner.__name__}.{name}"

    def __get__(self, instance: object, owner: type) -> Any:
        warn_renamed(self._old, self._new)
        return getattr(owner if instance is None else instance, self._new)
