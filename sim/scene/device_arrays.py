"""NumPy arrays in aligned memory that kernels can read.

Dr.Jit compiles a kernel again for every alignment of its inputs. It also records a frozen kernel again if the arrays of
a Mitsuba shape have another alignment than when the kernel was recorded. This applies to all shapes in memory, even in
other scenes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from optics.numerics.precision import aligned


class SharedBuffer:
    """NumPy memory that kernels read directly.

    LLVM's kernels receive the memory once, because passing it at every launch would take longer than rendering a small
    world. A GPU has its own memory and receives a copy at every access.

    n: number of values
    kind: type of the array on the device (float32, uint32 or uint64); None: mi.Float
    values: attribute, the values (n,), which must not be changed while a kernel reads them
    """

    def __init__(self, n: int, kind: Any = None) -> None:
        kind = mi.Float if kind is None else kind
        dtypes = {dr.VarType.Float32: np.float32, dr.VarType.UInt32: np.uint32, dr.VarType.UInt64: np.uint64}
        self.values = aligned(n, dtypes[dr.type_v(kind)])
        self._kind, self._array = kind, kind(self.values)

    @property
    def array(self) -> Array:
        """The buffer's `values` as an array that kernels read: the same memory with LLVM, a new copy on a GPU."""
        return self._array if dr.backend_v(self._kind) == dr.JitBackend.LLVM else self._kind(self.values)


@dataclass(frozen=True)
class Divisor:
    """A whole number from 1 to 2³² - 1 by which a kernel divides; all fields are arrays of one element.

    Processors have no instruction that divides several whole numbers at once. If a kernel divided one number after
    another, divisions would take a seventh of its time when it renders a built-in world. `quotient` therefore
    multiplies and shifts (fig. 4.1 in Granlund and Montgomery 1994). The divisor is an input of kernels, so one kernel
    serves all divisors.

    number: the divisor
    factor, first_shift, second_shift: numbers from which quotients are computed
    """

    number: Array
    factor: Array
    first_shift: Array
    second_shift: Array

    @classmethod
    def from_number(cls, number: int) -> Divisor:
        """Return a divisor whose value is `number`, from 1 to 2³² - 1. Its fields are arrays on the device."""
        bits = (number - 1).bit_length()
        factor = (2**bits - number) * 2**32 // number + 1
        return cls(*map(one_number, (number, factor, min(bits, 1), max(bits - 1, 0))))

    def quotient(self, values: Array) -> Array:
        """Return values // number, exactly, for any uint32 values."""
        high = dr.mul_hi(values, self.factor)
        return (high + ((values - high) >> self.first_shift)) >> self.second_shift


def one_number(value: int) -> Array:
    """Return a uint32 array of one element, which is an input and not a constant of kernels that use it."""
    return dr.opaque(mi.UInt32, value)


def floats(values: np.ndarray) -> Array:
    """Return a flat float32 copy on the device."""
    return mi.Float(as_floats(values))


def as_floats(values: np.ndarray) -> np.ndarray:
    """Return a flat, aligned float32 copy in NumPy."""
    found = aligned(np.size(values), np.float32)
    found.reshape(np.shape(values))[...] = values  # without a copy in the former precision
    return found


def whole_numbers(values: Any) -> Array:
    """Return a flat uint32 copy on the device."""
    return mi.UInt32(as_whole_numbers(values))


def as_whole_numbers(values: Any) -> np.ndarray:
    """Return a flat, aligned uint32 copy in NumPy."""
    found = aligned(np.size(values), np.uint32)
    found[:] = np.ravel(values)
    return found


def counted(n: int) -> Array:
    """Return an array on the device with the numbers 0 ... n - 1, which gives n lanes to a kernel that reads it.

    A lane computes one element of a kernel's output. A frozen kernel in which each lane reads its element of this array
    has n lanes. If a kernel reads only tables, Dr.Jit 1.5 derives the number of lanes from one of them. Which table it
    uses depends on the state of the process. In one case, a kernel that renders receptors was replayed with 126 instead
    of 128 lanes, so that the last receptors stayed dark without a message. tests/test_parameters.py repeats each
    training run and detects this error.
    """
    found = dr.arange(mi.UInt32, n)
    dr.eval(found)
    return found


def in_fours(vectors: np.ndarray, fourth: np.ndarray | float) -> np.ndarray:
    """Return vectors (..., 3) as a flat array in which a fourth number follows each vector.

    Kernels gather four aligned floats in one operation.
    """
    rows = np.empty((*vectors.shape[:-1], 4), np.float32)
    rows[..., :3], rows[..., 3] = vectors, fourth
    return rows.ravel()


def three(fours: Array, row: Array) -> Array:
    """Return the first three of a row of four aligned floats, gathered in one operation."""
    x, y, z, _ = dr.gather(mi.Vector4f, fours, row)
    return mi.Vector3f(x, y, z)
