"""NumPy's numbers where kernels read them, aligned.

Dr.Jit compiles a kernel anew for every alignment of its inputs, and records a frozen one anew for the alignment of
every shape that exists, in whichever scene it is.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array

ALIGNMENT = 64  # [bytes]
# [bytes] that a kernel takes at once, at most: it may read past an array's end
# (`optics.numerics.precision.padded_for_packets`)
PACKET = 128


def aligned(n: int, dtype: type) -> np.ndarray:
    """n zeros that start on 64 bytes."""
    size = np.dtype(dtype).itemsize
    raw = np.zeros(n * size + ALIGNMENT + PACKET, np.uint8)
    first = -raw.ctypes.data % ALIGNMENT
    return raw[first : first + n * size].view(dtype)


class SharedBuffer:
    """Numbers of NumPy's that kernels read where they are. LLVM's kernels get them once: to hand them over at every
    launch takes longer than to render a small world. A GPU has memory of its own, and gets a copy whenever it is asked
    for.

    values: flat; to be written only while no kernel that reads them is under way
    """

    def __init__(self, n: int, kind: Any = None) -> None:
        kind = mi.Float if kind is None else kind
        dtypes = {dr.VarType.Float32: np.float32, dr.VarType.UInt32: np.uint32, dr.VarType.UInt64: np.uint64}
        self.values = aligned(n, dtypes[dr.type_v(kind)])
        self._kind, self._array = kind, kind(self.values)

    @property
    def array(self) -> Array:
        """The same, on the device."""
        return self._array if dr.backend_v(self._kind) == dr.JitBackend.LLVM else self._kind(self.values)


def floats(values: np.ndarray) -> Array:
    """A copy of them, flat, float32."""
    return mi.Float(as_floats(values))


def as_floats(values: np.ndarray) -> np.ndarray:
    """The same, still NumPy's."""
    found = aligned(np.size(values), np.float32)
    found[:] = np.ravel(values)
    return found


def whole_numbers(values: Any) -> Array:
    """The same as uint32."""
    return mi.UInt32(as_whole_numbers(values))


def as_whole_numbers(values: Any) -> np.ndarray:
    """The same, still NumPy's."""
    found = aligned(np.size(values), np.uint32)
    found[:] = np.ravel(values)
    return found


def counted(n: int) -> Array:
    """0 ... n - 1, in memory of its own: a frozen kernel that reads it lane by lane replays at this width. Reading
    tables alone, Dr.Jit 1.5 took its width from one that changes with what else the process has loaded: 126 lanes
    replayed out of 128, the last receptors silently dark (tests/test_parameters.py runs each life twice and has met
    it)."""
    found = dr.arange(mi.UInt32, n)
    dr.eval(found)
    return found


def in_fours(vectors: np.ndarray, fourth: np.ndarray | float) -> np.ndarray:
    """Vectors (..., 3) flat, each followed by a fourth number: four aligned floats are gathered at once."""
    rows = np.empty((*vectors.shape[:-1], 4), np.float32)
    rows[..., :3], rows[..., 3] = vectors, fourth
    return rows.ravel()


def three(fours: Array, row: Array) -> Array:
    """The first three of a row of four floats; aligned, they are gathered at once."""
    x, y, z, _ = dr.gather(mi.Vector4f, fours, row)
    return mi.Vector3f(x, y, z)
