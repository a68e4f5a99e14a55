"""One process at a time may write to a run."""

from __future__ import annotations

import contextlib
import fcntl
import os
import time
from pathlib import Path
from types import TracebackType

__all__ = ["LockedError", "RunLock", "holder"]

PATIENCE_S = 0.5  # someone asking `holder` has the lock for an instant


class LockedError(ValueError):
    """Another process works on the run, or it cannot be written; the message is one line that says which."""


class RunLock:
    """The operating system's lock on the file `lock`: it ends with its process, however that dies."""

    NAME = "lock"

    def __init__(self, run: Path) -> None:
        self._path = run / self.NAME
        self._descriptor: int | None = None

    def __enter__(self) -> RunLock:
        try:
            self._descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as error:
            raise LockedError(f"{self._path.parent} cannot be written: {error.strerror}") from error
        deadline = time.monotonic() + PATIENCE_S
        while True:
            try:
                fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() > deadline:
                    os.close(self._descriptor)
                    raise LockedError(
                        f"{self._path.parent} is in use by process {_written(self._path)}; wait for it or stop it"
                    ) from None
                time.sleep(0.05)
        os.ftruncate(self._descriptor, 0)
        os.write(self._descriptor, f"{os.getpid()} on {os.uname().nodename}\n".encode())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._descriptor is not None:
            os.ftruncate(self._descriptor, 0)
            os.close(self._descriptor)
            self._descriptor = None


def holder(run: Path) -> str | None:
    """The process that works on a run ("1234 on host"), None if nobody does."""
    with contextlib.suppress(FileNotFoundError), (run / RunLock.NAME).open() as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return _written(run / RunLock.NAME)
    return None


def _written(path: Path) -> str:
    return path.read_text().strip() or "unknown"
