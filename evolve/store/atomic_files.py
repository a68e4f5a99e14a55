"""Files that are written completely or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from evolve.store.regular_files import created, folder, require_regular, sync_folder

UNFINISHED = ".unfinished"  # ending of temporary files
POLICIES, TRAININGS = "policies", "trainings"  # folders of a run


def sweep(folder: Path) -> None:
    """Remove unfinished files from a folder. Processes that were killed while writing have left these files.

    A file is kept if its name contains the id of another running process, which may still be writing it.

    Raises:
        OSError: a file cannot be removed.
    """
    for path in folder.glob(f".*{UNFINISHED}"):
        if not _lives(path.name.removesuffix(UNFINISHED).rpartition(".")[2]):
            path.unlink(missing_ok=True)


def _lives(process: str) -> bool:
    """Return whether a text is the id of a process that is running, and that is not this process."""
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
    """Write a file atomically. Readers find either the old or the new content, even after a crash of the machine.

    If the folder `policies` or `trainings` of a run is missing, it is created. The run directory itself is not created,
    because a run that was deleted meanwhile must not reappear.

    Raises:
        StrangeFileError: the path is a link, FIFO, device or directory.
        OSError: the file cannot be written; the error names `path`.
    """
    with unfinished(path) as neighbour, neighbour.open("r+b") as file:
        file.write(content)


def require_file_name(path: Path) -> None:
    """Check that a path has a file name, and that it is a regular file or does not exist.

    Raises:
        StrangeFileError: the path is a link, FIFO, device or directory.
    """
    require_regular(path if path.name else path.resolve())


@contextmanager
def unfinished(path: Path) -> Iterator[Path]:
    """Create an empty file next to `path`, and yield the path of the new file; the caller writes the content.

    At the end of the context, the new file is synchronised with the disk and renamed to `path`. If an exception leaves
    the context, the new file is removed.

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
        with contextlib.suppress(OSError):  # the original error is reported instead
            neighbour.unlink(missing_ok=True)
        if isinstance(error, OSError):
            # Some libraries raise an OSError without an error number.
            number, said = (error.errno, error.strerror) if error.errno is not None else (errno.EIO, str(error))
            raise type(error)(number, said, str(path)) from error
        raise
