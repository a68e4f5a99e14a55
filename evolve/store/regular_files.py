"""Access to the files of a run. Only regular files are opened.

A run directory may come from an untrusted source. If it contained a link to some other file of the user, writing
through the link would overwrite that file. Opening a FIFO could block forever.
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO, Literal

__all__ = [
    "StrangeFileError",
    "created",
    "folder",
    "folders",
    "opened",
    "read",
    "require_folder",
    "require_regular",
    "require_size",
    "sync_folder",
]

_KINDS = (
    (stat.S_ISLNK, "a symbolic link"),
    (stat.S_ISFIFO, "a FIFO"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISDIR, "a directory"),
    (stat.S_ISREG, "a file"),
)
LARGEST = 2**30  # maximum size of files that are read at once, such as policies [bytes]
_FLAGS = {"rb": os.O_RDONLY, "r+b": os.O_RDWR, "ab": os.O_WRONLY | os.O_APPEND}


class StrangeFileError(OSError):
    """A path is not the regular file or folder that it must be, or a file is too large or has several hard links.

    `strerror` and `filename` give details.
    """


def opened(path: Path, mode: Literal["rb", "r+b", "ab"] = "rb", create: bool = False) -> BinaryIO:
    """Open a run's file in the mode "rb", "r+b" or "ab". None of these modes truncates the file.

    create: True to create the file if it is missing

    Raises:
        StrangeFileError: the path is not a regular file, or a file opened for writing has several hard links.
        OSError: the file cannot be opened, or does not exist and `create` is False.
    """
    require_regular(path)
    flags = _FLAGS[mode] | (os.O_CREAT if create else 0)
    return os.fdopen(_descriptor(path, flags, alone=mode != "rb"), mode)


def read(path: Path, most: int = LARGEST) -> bytes:
    """Return the content of a run's file, whose size is checked before it is read.

    most: maximum size [bytes]

    Raises:
        StrangeFileError: the path is not a regular file, or the file is too large.
        OSError: the file does not exist or cannot be read.
    """
    with opened(path) as file:
        require_size(file, path, most)
        return file.read(most)


def require_size(file: BinaryIO, path: Path, most: int) -> None:
    """Check the size of an open file before it is read.

    Raises:
        StrangeFileError: the file has more than `most` bytes.
    """
    size = os.fstat(file.fileno()).st_size
    if size > most:
        raise _strange(path, f"has {size:,} bytes: must have at most {most:,}")


def created(path: Path) -> BinaryIO:
    """Create a file, and open it for writing. An existing file or link at this path is removed first, not overwritten.

    Raises:
        OSError: the file cannot be created.
    """
    path.unlink(missing_ok=True)
    return os.fdopen(_descriptor(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL), "wb")


def folder(path: Path) -> Path:
    """Create a run's folder if it is missing, and return its path. The parent folder must exist.

    Raises:
        StrangeFileError: the path is a link to a folder.
        OSError: the folder cannot be created, for example because a file has this path.
    """
    path.mkdir(exist_ok=True)
    require_folder(path)
    return path


def folders(path: Path, exist_ok: bool = True) -> None:
    """Create a folder and its missing parents, so that they survive a power failure.

    The new entries are synchronised with the disk, except in a parent folder that this process has no right to read.

    exist_ok: False to refuse a path that exists

    Raises:
        OSError: a folder cannot be created, or the path exists and `exist_ok` is False.
    """
    missing = [place for place in (path, *path.parents) if not place.exists()]
    path.mkdir(parents=True, exist_ok=exist_ok)
    for place in missing:
        with contextlib.suppress(PermissionError):  # a folder that may be written, but not read, cannot be synchronised
            sync_folder(place.parent)


def require_regular(path: Path) -> None:
    """Check that a path is a regular file or does not exist.

    Code that passes a path to another library calls this function first. Other code uses `opened`, which also checks.

    Raises:
        StrangeFileError: the path exists, but is not a regular file.
    """
    mode = _mode(path)
    if mode is not None and not stat.S_ISREG(mode):
        raise _strange(path, f"is {_kind(mode)}: must be a regular file")


def require_folder(path: Path) -> None:
    """Check that a path is a folder or does not exist.

    Raises:
        StrangeFileError: the path exists, but is not a folder.
    """
    mode = _mode(path)
    if mode is not None and not stat.S_ISDIR(mode):
        raise _strange(path, f"is {_kind(mode)}: must be a directory")


def sync_folder(path: Path) -> None:
    """Synchronise a folder with the disk, so that new and renamed files survive a power failure.

    Raises:
        OSError: the folder cannot be opened, or the disk reports an error. It is no error if the file system cannot
            synchronise folders.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # an error other than the lack of this operation
            raise
    finally:
        os.close(descriptor)


def _descriptor(path: Path, flags: int, alone: bool = False) -> int:
    """Open a file, check it, and return its descriptor.

    The open file is checked, because a file at this path could be replaced between a check and the opening.

    alone: True to refuse a file with several hard links

    Raises:
        StrangeFileError: the opened file is not a regular file, or has several hard links and `alone` is True.
        OSError: the file cannot be opened, for example because the path is a link.
    """
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
    """Return the mode (kind and permissions) of a path, without following links; None if it does not exist."""
    try:
        return path.lstat().st_mode
    except FileNotFoundError:
        return None


def _kind(mode: int) -> str:
    return next((name for is_one, name in _KINDS if is_one(mode)), "a device")


def _strange(path: Path, what: str) -> StrangeFileError:
    return StrangeFileError(errno.EINVAL, what, str(path))
