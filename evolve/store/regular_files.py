"""The one door to the files of a run: behind each name is a regular file of that run, or nothing is opened.

A run directory may come from a stranger. A link in it leads to any file of whoever reads it, and would have it
overwritten; a FIFO keeps waiting for ever whoever opens it.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO, Literal

__all__ = [
    "StrangeFileError",
    "created",
    "folder",
    "opened",
    "read",
    "require_folder",
    "require_regular",
    "sync_folder",
]

_KINDS = (
    (stat.S_ISLNK, "a symbolic link"),
    (stat.S_ISFIFO, "a FIFO"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISDIR, "a directory"),
    (stat.S_ISREG, "a file"),
)
_FLAGS = {"rb": os.O_RDONLY, "r+b": os.O_RDWR, "ab": os.O_WRONLY | os.O_APPEND}


class StrangeFileError(OSError):
    """Something else stands where a run has a file or a folder of its own; `strerror` and `filename` say what."""


def opened(path: Path, mode: Literal["rb", "r+b", "ab"] = "rb", create: bool = False) -> BinaryIO:
    """A run's file, opened: "rb", "r+b" or "ab". None of them truncates, and only `create` makes one that is missing.

    Raises:
        StrangeFileError: no regular file, or, where it is to be written, one that has other names as well.
        OSError: there is none, or it may not be opened.
    """
    require_regular(path)
    flags = _FLAGS[mode] | (os.O_CREAT if create else 0)
    return os.fdopen(_descriptor(path, flags, alone=mode != "rb"), mode)


def read(path: Path) -> bytes:
    """All of a run's file.

    Raises:
        StrangeFileError: no regular file.
        OSError: there is none, or it may not be read.
    """
    with opened(path) as file:
        return file.read()


def created(path: Path) -> BinaryIO:
    """A new file, opened for writing; whatever bore its name is removed, and not written to.

    Raises:
        OSError: it cannot be made.
    """
    path.unlink(missing_ok=True)
    return os.fdopen(_descriptor(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL), "wb")


def folder(path: Path) -> Path:
    """A run's folder, made if it is missing; what it stands in must be there.

    Raises:
        StrangeFileError: something else stands there.
        OSError: it cannot be made.
    """
    path.mkdir(exist_ok=True)
    require_folder(path)
    return path


def require_regular(path: Path) -> None:
    """What others open by name must be a regular file, or not be there.

    Raises:
        StrangeFileError: something else is there.
    """
    mode = _mode(path)
    if mode is not None and not stat.S_ISREG(mode):
        raise _strange(path, f"is {_kind(mode)}: must be a regular file")


def require_folder(path: Path) -> None:
    """A run's folder must be one, or not be there.

    Raises:
        StrangeFileError: something else is there.
    """
    mode = _mode(path)
    if mode is not None and not stat.S_ISDIR(mode):
        raise _strange(path, f"is {_kind(mode)}: must be a directory")


def sync_folder(path: Path) -> None:
    """Write to the disk which names a folder holds: a file that has just got one loses it with the power otherwise.

    Raises:
        OSError: the disk refuses.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # file systems that know no such thing
            raise
    finally:
        os.close(descriptor)


def _descriptor(path: Path, flags: int, alone: bool = False) -> int:
    """Opened, and only then looked at: nobody can put something else there in between."""
    descriptor = os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o644)
    found = os.fstat(descriptor)
    if stat.S_ISREG(found.st_mode) and (not alone or found.st_nlink == 1):
        return descriptor
    os.close(descriptor)
    if stat.S_ISREG(found.st_mode):
        raise _strange(path, f"has {found.st_nlink} names (hard links): must have one, or all would change; copy it")
    raise _strange(path, f"is {_kind(found.st_mode)}: must be a regular file")


def _mode(path: Path) -> int | None:
    """Kind of what bears a name, links not followed; None if nothing does."""
    try:
        return path.lstat().st_mode
    except FileNotFoundError:
        return None


def _kind(mode: int) -> str:
    return next((name for is_one, name in _KINDS if is_one(mode)), "a device")


def _strange(path: Path, what: str) -> StrangeFileError:
    return StrangeFileError(errno.EINVAL, what, str(path))
