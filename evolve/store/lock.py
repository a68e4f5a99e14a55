"""Lock of a run, which only one process at a time can hold. A process must hold it to write to the run."""

from __future__ import annotations

import fcntl
import os
import time
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from evolve.store.regular_files import StrangeFileError, opened

__all__ = ["LockedError", "RunLock", "holder"]

PATIENCE_S = 0.5  # [s] time to wait for the lock, because `holder` in another process takes it for an instant
LONGEST = 400  # [bytes] maximum length of the text in a lock file, which names a process and its machine


class LockedError(ValueError):
    """A run cannot be locked: another process works on it, or its lock cannot be written. The message is one line."""


class RunLock:
    """Lock of a run: the operating system's lock on the file `lock`, held within a `with` block.

    The operating system releases the lock when the process ends, even if the process is killed.

    run: run directory

    Raises:
        LockedError: on entry, another process holds the lock, or the file cannot be opened.
    """

    NAME = "lock"

    def __init__(self, run: Path) -> None:
        self._path = run / self.NAME
        self._file: BinaryIO | None = None

    def __enter__(self) -> RunLock:
        try:
            file = opened(self._path, "r+b", create=True)
        except OSError as error:
            raise LockedError(f"{self._path.parent} cannot be written: {_message(error, self._path)}") from error
        deadline = time.monotonic() + PATIENCE_S
        while not _taken(file, fcntl.LOCK_EX):
            if time.monotonic() > deadline:
                by = _written(file)
                file.close()
                raise LockedError(f"{self._path.parent} is in use by process {by}; wait for it or stop it")
            time.sleep(0.05)
        file.truncate(0)
        file.write(f"{os.getpid()} on {os.uname().nodename}\n".encode())
        file.flush()
        self._file = file
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._file is not None:
            self._file.truncate(0)
            self._file.close()
            self._file = None

    @property
    def stands(self) -> bool:
        """True if this process holds the lock, and the locked file is still the file `lock` in the run directory.

        It is False if the run directory has been deleted, or deleted and created again.
        """
        if self._file is None:
            return False
        try:
            return os.path.samestat(os.fstat(self._file.fileno()), self._path.lstat())
        except OSError:
            return False


def holder(run: Path) -> str | None:
    """Return the process that is working on a run, such as "1234 on host"; None if there is none.

    The result is "unknown" if the lock file does not name the process.

    Raises:
        OSError: the lock cannot be read.
    """
    try:
        with opened(run / RunLock.NAME) as file:
            return None if _taken(file, fcntl.LOCK_SH) else _written(file)
    except FileNotFoundError:
        return None


def _taken(file: BinaryIO, kind: int) -> bool:
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _written(file: BinaryIO) -> str:
    file.seek(0)
    return file.read(LONGEST).decode(errors="replace").strip() or "unknown"


def _message(error: OSError, path: Path) -> str:
    return f"{path.name} {error.strerror}" if isinstance(error, StrangeFileError) else str(error.strerror)
