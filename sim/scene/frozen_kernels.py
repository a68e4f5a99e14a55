"""What has to hold while Dr.Jit records a frozen function or replays one."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def garbage_kept() -> Iterator[None]:
    """Hold off Python's garbage collection: if it frees another renderer's kernels or scene while this one's kernel is
    being recorded, Dr.Jit aborts the process."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
