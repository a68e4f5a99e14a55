"""Access to the files of a run, which opens only regular files in the run directory.

A run directory may come from an untrusted source. A link in it could point to any file of the user, which would then be
overwritten, and opening a FIFO could block forever.
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
    """A run's file or folder is another kind of entry; `strerror` and `filename` describe it."""


def opened(path: Path, mode: Literal["rb", "r+b", "ab"] = "rb", create: bool = False) -> BinaryIO:
    """Open a run's file in the mode "rb", "r+b" or "ab"; no mode truncates it, and only `create` makes a missing file.

    Raises:
        StrangeFileError: the path is not a regular file, or a file opened for writing has several hard links.
        OSError: the file does not exist or cannot be opened.
    """
    require_regular(path)
    flags = _FLAGS[mode] | (os.O_CREAT if create else 0)
    return os.fdopen(_descriptor(path, flags, alone=mode != "rb"), mode)


def read(path: Path) -> bytes:
    """Return the content of a run's file.

    Raises:
        StrangeFileError: the path is not a regular file.
        OSError: the file does not exist or cannot be read.
    """
    with opened(path) as file:
        return file.read()


def created(path: Path) -> BinaryIO:
    """Create a file and open it for writing; an existing entry of this name is removed and never written to.

    Raises:
        OSError: the file cannot be created.
    """
    path.unlink(missing_ok=True)
    return os.fdopen(_descriptor(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL), "wb")


def folder(path: Path) -> Path:
    """Return a run's folder, created if it is missing; its parent must exist.

    Raises:
        StrangeFileError: the path is another kind of entry.
        OSError: the folder cannot be created.
    """
    path.mkdir(exist_ok=True)
    require_folder(path)
    return path


def require_regular(path: Path) -> None:
    """Check that a path is a regular file or does not exist, before other code opens it by name.

    Raises:
        StrangeFileError: the path is another kind of entry.
    """
    mode = _mode(path)
    if mode is not None and not stat.S_ISREG(mode):
        raise _strange(path, f"is {_kind(mode)}: must be a regular file")


def require_folder(path: Path) -> None:
    """Check that a path is a folder or does not exist.

    Raises:
        StrangeFileError: the path is another kind of entry.
    """
    mode = _mode(path)
    if mode is not None and not stat.S_ISDIR(mode):
        raise _strange(path, f"is {_kind(mode)}: must be a directory")


def sync_folder(path: Path) -> None:
    """Synchronise a folder's entries with the disk, so that new names of files survive a power failure.

    Raises:
        OSError: the disk reports an error.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # file systems without this operation
            raise
    finally:
        os.close(descriptor)


def _descriptor(path: Path, flags: int, alone: bool = False) -> int:
    """Return the descriptor of an opened file; it is checked after opening, so that it cannot be exchanged between."""
    descriptor = os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o644)
    found = os.fstat(descriptor)
    if stat.S_ISREG(found.st_mode) and (not alone or found.st_nlink == 1):
        return descriptor
    os.close(descriptor)
    if stat.S_ISREG(found.st_mode):
        names = f"{found.st_nlink} names (hard links)"
        raise _strange(path, f"has {names}: must have one, because writing would change all; copy it")
    raise _strange(path, f"is {_kind(found.st_mode)}: must be a regular file")


def _mode(path: Path) -> int | None:
    """Return the mode of a directory entry without following links; None if it does not exist."""
    try:
        return path.lstat().st_mode
    except FileNotFoundError:
        return None


def _kind(mode: int) -> str:
    return next((name for is_one, name in _KINDS if is_one(mode)), "a device")


def _strange(path: Path, what: str) -> StrangeFileError:
    return StrangeFileError(errno.EINVAL, what, str(path))
