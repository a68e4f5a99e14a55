"""The run that ships with rhabdom: the record of a run with the preset `quick`, and the policy of its best animal."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path

from evolve.store.atomic_files import write_whole
from evolve.store.directory import Run
from evolve.store.record import RunError
from evolve.store.regular_files import read

__all__ = ["copy_shipped_run"]

FOLDER = "demo"  # run directory within evolve/


def copy_shipped_run(directory: Path) -> Run:
    """Add the missing files of the shipped run to a directory, and return the run in this directory.

    Raises:
        RunError: the directory contains a file of the run with another content, or it contains files, but none of the
            run's.
        OSError: the directory cannot be written, or one of its files cannot be read.
    """
    files = dict(_files(resources.files("evolve") / FOLDER))
    there = [name for name in files if (directory / name).exists()]
    same = all(_same(directory / name, files[name]) for name in there)
    if not same or (not there and directory.exists() and any(directory.iterdir())):
        raise RunError(f"{directory} contains other files: choose another directory with --out")
    directory.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        if name not in there:
            write_whole(directory / name, content)
    return Run.open(directory)


def _same(path: Path, content: bytes) -> bool:
    return path.stat().st_size == len(content) and read(path) == content


def _files(folder: Traversable, within: str = "") -> Iterator[tuple[str, bytes]]:
    """Yield the relative path and the content of each file below a folder."""
    for entry in folder.iterdir():
        if entry.is_dir():
            yield from _files(entry, f"{within}{entry.name}/")
        else:
            yield f"{within}{entry.name}", entry.read_bytes()
