"""Checksums of a run's files: SHA-256 of whole files, and the list of checksums of the EXR files in a folder."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from pathlib import Path

from evolve.store.atomic_files import write_whole
from evolve.store.regular_files import read

__all__ = ["digest", "harmed", "list_checksums"]

LISTED = "SHA256SUMS"  # name of the list, whose form is that of sha256sum: "checksum  name"
LARGEST_LIST = 2**24  # maximum size of a list [bytes], for 150,000 files
MOST_BYTES = 2**32  # maximum size of all files whose checksums are compared at once [bytes]
ENTRY = re.compile(r"([0-9a-f]{64})  ([^/\n]+\.exr)")
SHOWN = 5  # maximum number of names in a message


def digest(path: Path) -> str | None:
    """Return the SHA-256 of a file; None if the file is missing.

    Raises:
        OSError: the file exists but cannot be read, has more than 1 GiB, or is not a regular file.
    """
    try:
        return hashlib.sha256(read(path)).hexdigest()
    except FileNotFoundError:
        return None


def list_checksums(folder: Path, files: Iterable[Path]) -> None:
    """Add the checksums of EXR files to the file SHA256SUMS in their folder. Entries of other files are kept.

    Raises:
        OSError: a file cannot be read, or the list cannot be written.
    """
    new = [f"{digest(path)}  {path.name}" for path in files]
    names = {line.partition("  ")[2] for line in new}
    kept = [line for line in _lines(folder) if line.partition("  ")[2] not in names]
    write_whole(folder / LISTED, "".join(f"{line}\n" for line in [*kept, *new]).encode())


def harmed(folder: Path) -> str | None:
    """Return a message about the EXR files in a folder that do not match their checksums; None if all match.

    The checksums are those in the folder's list, the file SHA256SUMS. Deleted files are not reported, because they can
    be exported again. If an EXR file or the list cannot be read, or if the EXR files are larger than 4 GiB together,
    the message says so instead.
    """
    try:
        known = {match[2]: match[1] for line in _lines(folder) if (match := ENTRY.fullmatch(line))}
        files = {name: path for name in known if (path := folder / name).exists()}
        if (size := sum(path.stat().st_size for path in files.values())) > MOST_BYTES:
            return f"{folder}: EXR files have {size:,} bytes: checksums are compared only up to {MOST_BYTES:,} bytes"
        wrong = [name for name, path in files.items() if digest(path) not in (None, known[name])]
    except OSError as error:
        return f"{error.filename}: cannot be read: {error.strerror}"
    if not wrong:
        return None
    names = ", ".join(wrong[:SHOWN]) + (", ..." if len(wrong) > SHOWN else "")
    return f"{folder}: {len(wrong)} EXR files do not match their checksums ({names}): export them again"


def _lines(folder: Path) -> list[str]:
    """Return the lines of a folder's list of checksums; [] if the folder has no list."""
    try:
        return read(folder / LISTED, LARGEST_LIST).decode(errors="replace").splitlines()
    except FileNotFoundError:
        return []
