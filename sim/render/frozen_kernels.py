"""What has to hold while Dr.Jit records a frozen function or replays one."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

ALIGNMENT = 64  # [bytes]
# [bytes] that a kernel takes at once, at most: it may read past an array's end
# (`optics.numerics.precision.padded_for_packets`)
PACKET = 128


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


def aligned(n: int, dtype: type) -> np.ndarray:
    """n zeros that start on 64 bytes: Dr.Jit records a frozen function anew for every alignment of its inputs."""
    size = np.dtype(dtype).itemsize
    raw = np.zeros(n * size + ALIGNMENT + PACKET, np.uint8)
    first = -raw.ctypes.data % ALIGNMENT
    return raw[first : first + n * size].view(dtype)
