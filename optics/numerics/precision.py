"""Dr.Jit's types for one dtype, on the selected device."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from optics.numerics.arguments import shown
from optics.numerics.autodiff import Array, Scalar, is_differentiable
from optics.numerics.device import Device, make_ready

__all__ = ["PACKET", "Precision", "aligned", "opaque", "padded_for_packets", "precision"]

PACKET = 128  # largest number of bytes that a processor reads at once: sixteen float64 numbers (AVX-512)


@dataclass(frozen=True)
class Precision:
    """Dr.Jit types. Float is the type of fields, Float64 the type of optical paths.

    Whole waves of a path are subtracted before the conversion to Float.
    """

    dtype: str
    Float: Any
    Tensor: Any
    Float64: Any
    Tensor64: Any
    Index: Any
    complex_dtype: type[np.complexfloating]


def precision(dtype: str = "float32") -> Precision:
    """Return the types for "float32" or "float64".

    Raises:
        ValueError: the dtype is not supported.
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
    """
    if not isinstance(dtype, str) or dtype not in ("float32", "float64"):
        raise ValueError(f"dtype = {shown(dtype)}: must be 'float32' or 'float64'")
    return _precision(dtype, make_ready())


@lru_cache(maxsize=4)
def _precision(dtype: str, place: Device) -> Precision:
    types = import_module("drjit.llvm.ad" if place == "cpu" else "drjit.cuda.ad")
    if dtype == "float32":
        return Precision(
            dtype, types.Float, types.TensorXf, types.Float64, types.TensorXf64, types.UInt32, np.complex64
        )
    return Precision(
        dtype, types.Float64, types.TensorXf64, types.Float64, types.TensorXf64, types.UInt32, np.complex128
    )


def aligned(count: int, dtype: Any) -> np.ndarray:
    """Return a flat array of zeros that starts at a multiple of PACKET bytes and can be read beyond its end.

    Dr.Jit compiles a kernel again if the alignment of an input changes. The alignment of NumPy's own memory is a matter
    of chance.
    """
    size = count * np.dtype(dtype).itemsize
    room = np.zeros(size + 2 * PACKET, np.uint8)
    first = -room.ctypes.data % PACKET
    return room[first : first + size].view(dtype)


def padded_for_packets(values: np.ndarray) -> np.ndarray:
    """Return a flat copy of an array, in aligned memory that can be read beyond the end of the copy.

    Dr.Jit uses NumPy's memory without a copy. Its kernels read whole packets of numbers, sixteen with AVX-512, and
    ignore the numbers beyond the array's end. If these lie in a memory page that is not mapped, reading them crashes
    the process. This can happen with arrays of some megabytes (observed with Dr.Jit 1.5 and 2087 x 2087 numbers).
    """
    flat = aligned(values.size, values.dtype)
    flat.reshape(values.shape)[...] = values
    return flat


def opaque(types: Precision, value: Scalar) -> Array:
    """Return a float64 scalar that Dr.Jit treats as data. A kernel is then not compiled again for another value.

    A Dr.Jit array of one element is returned with its derivative.
    """
    import drjit as dr

    if is_differentiable(value):
        return types.Float64(dr.ravel(value))
    return dr.opaque(types.Float64, value)
