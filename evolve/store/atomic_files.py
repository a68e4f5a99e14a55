"""Files that are written whole or not at all."""

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
    """Remove what writers left that were killed in the middle. A replay may be written there meanwhile: what a process
    writes that lives stays."""
    for path in folder.glob(f".*{UNFINISHED}"):
        if not _lives(path.name.removesuffix(UNFINISHED).rpartition(".")[2]):
            path.unlink(missing_ok=True)


def _lives(process: str) -> bool:
    """Whether there is a process of this number, other than this one."""
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
    """Write a file so that a reader, or a machine that dies meanwhile, sees the old one or all of the new one. A run's
    folder of policies or trainings is made if it is missing, but not what that stands in: a run that was deleted stays
    so.

    Raises:
        StrangeFileError: a link, FIFO, device or directory bears its name.
        OSError: it cannot be written; names `path`.
    """
    with unfinished(path) as neighbour, neighbour.open("r+b") as file:
        file.write(content)


def require_file_name(path: Path) -> None:
    """What a file may be written under: neither "." nor "/", nor the name of what is no file.

    Raises:
        StrangeFileError: a link, FIFO, device or directory bears the name.
    """
    require_regular(path if path.name else path.resolve())


@contextmanager
def unfinished(path: Path) -> Iterator[Path]:
    """A neighbour of `path` to write to, empty at first; afterwards it is on the disk, under the name of `path`.

    Raises:
        StrangeFileError: a link, FIFO, device or directory bears its name.
        OSError: it cannot be written; names `path`.
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
        with contextlib.suppress(OSError):  # what went wrong first is what is told
            neighbour.unlink(missing_ok=True)
        if isinstance(error, OSError):
            # Libraries raise OSErrors that have a message alone.
            number, said = (error.errno, error.strerror) if error.errno is not None else (errno.EIO, str(error))
            raise type(error)(number, said, str(path)) from error
        raise
