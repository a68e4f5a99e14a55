"""Files that are written completely or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from evolve.store.regular_files import created, folder, require_regular, sync_folder

UNFINISHED = ".unfinished"
POLICIES, TRAININGS = "policies", "trainings"  # folders of a run


def sweep(folder: Path) -> None:
    """Remove unfinished files of killed processes; files of living processes, such as a replay, stay."""
    for path in folder.glob(f".*{UNFINISHED}"):
        if not _lives(path.name.removesuffix(UNFINISHED).rpartition(".")[2]):
            path.unlink(missing_ok=True)


def _lives(process: str) -> bool:
    """Return whether a process with this number exists, other than this one."""
    if not process.isdecimal() or int(process) == os.getpid():
        return False
    try:
        os.kill(int(process), 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass
    return True


def write_whole(path: Path, content: bytes) -> None:
    """Write a file atomically: readers, also after a crash of the machine, find either the old or the new content.

    A run's folder of policies or trainings is created if it is missing, but not the run directory, so that a deleted
    run is not created again.

    Raises:
        StrangeFileError: the path is a link, FIFO, device or directory.
        OSError: the file cannot be written; the error names `path`.
    """
    with unfinished(path) as neighbour, neighbour.open("r+b") as file:
        file.write(content)


def require_file_name(path: Path) -> None:
    """Check that a path can be written as a file: it is neither "." nor "/", nor the path of another kind of entry.

    Raises:
        StrangeFileError: the path is a link, FIFO, device or directory.
    """
    require_regular(path if path.name else path.resolve())


@contextmanager
def unfinished(path: Path) -> Iterator[Path]:
    """Create an empty file next to `path` for writing; at the end it is synchronised and renamed to `path`.

    Raises:
        StrangeFileError: the path is a link, FIFO, device or directory.
        OSError: the file cannot be written; the error names `path`.
    """
    require_file_name(path)
    neighbour = path.with_name(f".{path.name}.{os.getpid()}{UNFINISHED}")
    try:
        if path.parent.name in (POLICIES, TRAININGS) and not path.parent.is_dir():
            folder(path.parent)
        created(neighbour).close()
        yield neighbour
        with neighbour.open("rb") as file:
            os.fsync(file.fileno())
        neighbour.replace(path)
        sync_folder(path.parent)
    except BaseException as error:
        with contextlib.suppress(OSError):  # the first error is the one that is reported
            neighbour.unlink(missing_ok=True)
        if isinstance(error, OSError):
            # Some libraries raise an OSError without an error number.
            number, said = (error.errno, error.strerror) if error.errno is not None else (errno.EIO, str(error))
            raise type(error)(number, said, str(path)) from error
        raise
