"""A cache on disk of tables of reflected light, which take seconds to bake and are the same for the same world."""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from sim.tracing.areas.light_baking import Baking

VERSION = 2  # version of the tables, to be increased when the same ingredients give other tables
KEPT = 200  # largest number of files; the oldest are deleted first


def cache_folder() -> Path:
    """Return the folder of the cache."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "rhabdom" / "light"


def stored(baking: Baking) -> dict[str, np.ndarray]:
    """Return the tables, from disk if they are stored there. Without a writable disk, they are baked every time."""
    path = cache_folder() / f"{_digest(baking.ingredients)}.npz"
    # If a file is missing, truncated or foreign, the tables are baked again.
    with contextlib.suppress(OSError, ValueError, zipfile.BadZipFile, EOFError), np.load(path) as file:
        return {name: file[name] for name in file.files}
    tables = baking.tables()
    with contextlib.suppress(OSError):
        _write(path, tables)
    return tables


def _digest(ingredients: list[np.ndarray]) -> str:
    digest = hashlib.sha256(str(VERSION).encode())
    for array in ingredients:
        digest.update(str(array.shape).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _write(path: Path, tables: dict[str, Any]) -> None:
    """Write the file completely or not at all, even if other processes write it at the same time."""
    path.parent.mkdir(parents=True, exist_ok=True)
    for old in sorted(path.parent.glob("*.npz"), key=lambda p: p.stat().st_mtime)[: -(KEPT - 1)]:
        old.unlink(missing_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, suffix=".part")
    with os.fdopen(handle, "wb") as file:
        np.savez(file, **tables)
    os.replace(name, path)
