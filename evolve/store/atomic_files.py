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
    """Remove what writers left that were killed in the middle; nobody else may be writing there."""
    for path in folder.glob(f".*{UNFINISHED}"):
        path.unlink(missing_ok=True)


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


@contextmanager
def unfinished(path: Path) -> Iterator[Path]:
    """A neighbour of `path` to write to, empty at first; afterwards it is on the disk, under the name of `path`.

    Raises:
        StrangeFileError: a link, FIFO, device or directory bears its name.
        OSError: it cannot be written; names `path`.
    """
    neighbour = path.with_name(f".{path.name}.{os.getpid()}{UNFINISHED}")
    try:
        require_regular(path)
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
