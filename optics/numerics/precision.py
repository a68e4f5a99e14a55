"""Dr.Jit's types for one dtype, on the device that is asked for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from optics.numerics.arguments import shown
from optics.numerics.autodiff import Array, Scalar, is_differentiable
from optics.numerics.device import Device, make_ready

__all__ = ["ROOM", "Precision", "opaque", "padded_for_packets", "precision"]

ROOM = 64  # choice, elements: more than any processor takes at once


@dataclass(frozen=True)
class Precision:
    """Float: type of fields; Float64: type of optical paths, which lose their whole waves before they become Float."""

    dtype: str
    Float: Any
    Tensor: Any
    Float64: Any
    Tensor64: Any
    Index: Any
    complex_dtype: type[np.complexfloating]


def precision(dtype: str = "float32") -> Precision:
    """The types for "float32" or "float64".

    Raises:
        ValueError: any other dtype.
        BackendError: no LLVM, or no GPU, that Dr.Jit can use.
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


def padded_for_packets(values: np.ndarray) -> np.ndarray:
    """The same numbers, flat, in memory that may be read some way past their end.

    Dr.Jit works on NumPy's memory itself, without a copy, and its kernels take whole packets of numbers, sixteen with
    AVX-512: those past the end go nowhere, but reading them ends the process where the page after it is not there,
    as happens to arrays of some megabytes (seen with Dr.Jit 1.5 and 2087 x 2087 numbers).
    """
    room = np.empty(values.size + ROOM, values.dtype)
    flat = room[: values.size]
    flat.reshape(values.shape)[...] = values
    return flat


def opaque(types: Precision, value: Scalar) -> Array:
    """A float64 scalar that Dr.Jit treats as data: another value does not compile another kernel.

    A Dr.Jit array of one element stays what it is, derivative included.
    """
    import drjit as dr

    if is_differentiable(value):
        return types.Float64(dr.ravel(value))
    return dr.opaque(types.Float64, value)
