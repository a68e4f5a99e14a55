"""A disk cache for tables of reflected light, because the computation of a world's tables takes seconds.

A file is used only if its tables have the expected names, shapes and number types, if all numbers are finite, and if
the checksum of the tables and of their world is correct. Otherwise the tables are computed again.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import tempfile
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from sim.tracing.areas.light_baking import Baking

VERSION = 3  # version of the tables; to be increased with every change of the method or of the file format
KEPT = 200  # largest number of files; the oldest are deleted first
CHECKSUM = "sha256"  # name of the table that contains the checksum
ENTRY = 1024  # largest number of bytes that an archive adds to each table


def cache_folder() -> Path:
    """Return the folder of the cache."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "rhabdom" / "light"


def write_error() -> str | None:
    """Return the system's message if a temporary file cannot be written to the folder of the cache, else None."""
    try:
        cache_folder().mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=cache_folder()) as file:
            file.write(b"0")
    except OSError as error:
        return error.strerror or str(error)
    return None


def stored(baking: Baking) -> dict[str, np.ndarray]:
    """Return a world's tables of reflected light, from the cache if possible.

    Tables that are not in the cache are computed and stored there. If nothing can be written to the cache, the tables
    are computed at every call.
    """
    world = _digest(baking.ingredients)
    path = cache_folder() / f"{world}.npz"
    found = _read(path, baking.layout, world)
    if found is None:
        found = baking.tables()
        with contextlib.suppress(OSError):
            _write(path, found, world)
    return found


def _digest(ingredients: list[np.ndarray]) -> str:
    digest = hashlib.sha256(str(VERSION).encode())
    for array in ingredients:
        digest.update(str(array.shape).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _checksum(tables: dict[str, np.ndarray], world: str) -> np.ndarray:
    """Return the SHA-256 checksum of a world's tables, (32,) uint8."""
    digest = hashlib.sha256(world.encode())
    for name in sorted(tables):
        digest.update(f"{name} {tables[name].size} ".encode())
        digest.update(tables[name].tobytes())
    return np.frombuffer(digest.digest(), np.uint8)


def _read(path: Path, layout: dict[str, int], world: str) -> dict[str, np.ndarray] | None:
    """Return the tables in a file, or None if the file is missing, damaged, or of another layout or world.

    layout: expected number of values in each table, by the table's name
    world: digest of the walls, surfaces, lights and settings from which the tables are computed
    """
    sizes: dict[str, tuple[np.dtype, int]] = {name: (np.dtype(np.float32), size) for name, size in layout.items()}
    sizes[CHECKSUM] = (np.dtype(np.uint8), hashlib.sha256().digest_size)
    most = sum(dtype.itemsize * size + ENTRY for dtype, size in sizes.values())
    try:
        if not path.is_file() or path.stat().st_size > most:
            return None
        with path.open("rb") as file:
            archive = zipfile.ZipFile(io.BytesIO(file.read(most)))
        if sorted(archive.namelist()) != sorted(f"{name}.npy" for name in sizes):
            return None
        tables = {name: _table(archive, name, dtype, size) for name, (dtype, size) in sizes.items()}
    except Exception:  # zipfile raises errors of many kinds when an archive is damaged
        return None
    checksum = tables.pop(CHECKSUM)
    sound = np.array_equal(checksum, _checksum(tables, world)) and all(np.isfinite(t).all() for t in tables.values())
    return tables if sound else None


def _table(archive: zipfile.ZipFile, name: str, dtype: np.dtype, size: int) -> np.ndarray:
    """Return a flat table of an archive.

    Memory is allocated for the expected size, not for the size that the table's header states.

    Raises:
        ValueError: the table does not have the number type `dtype` and the size `size`.
    """
    header = io.BytesIO()
    written = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": (size,)}
    np.lib.format.write_array_header_1_0(header, written)
    expected = header.getvalue()
    with archive.open(f"{name}.npy") as file:
        content = file.read(len(expected) + dtype.itemsize * size + 1)
    if not content.startswith(expected) or len(content) != len(expected) + dtype.itemsize * size:
        raise ValueError(f"{name}: must be {size} numbers of type {dtype}")
    return np.frombuffer(content, dtype, offset=len(expected)).copy()


def _write(path: Path, tables: dict[str, np.ndarray], world: str) -> None:
    """Write the tables to a file, completely or not at all, even if other processes write it at the same time.

    Of the files in the cache, only the newest 200 remain.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    for old in sorted(path.parent.glob("*.npz"), key=lambda p: p.stat().st_mtime)[: -(KEPT - 1)]:
        old.unlink(missing_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, **tables, **{CHECKSUM: _checksum(tables, world)})  # type: ignore[arg-type]
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
