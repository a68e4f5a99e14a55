"""Operations on arrays of NumPy, PyTorch or Dr.Jit whose names or forms differ between these libraries.

Optical elements compute with the operators of the arrays that they receive, so they evaluate on all three. Plans use
NumPy, graphs of PyTorch use its tensors, and compiled kernels use Dr.Jit. No function imports PyTorch: a caller who
passes a tensor has imported it.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from optics.numerics.autodiff import Array, carries_derivative, is_differentiable, plain
from optics.numerics.precision import padded_for_packets

__all__ = ["fma", "gather", "indices", "library", "like", "matrix_like", "turned"]


def library(x: Array) -> Any:
    """Return the module (numpy, torch or drjit) with functions for arrays such as `x`, among them sqrt and floor."""
    for kind in type(x).__mro__:
        name = kind.__module__.partition(".")[0]
        if name in ("drjit", "torch"):
            return sys.modules[name]
    return np


def like(x: Array, value: Any) -> Array:
    """Return `value` as an array of the type, precision and device of `x`.

    value: number or array. Derivatives are kept if `value` and `x` belong to the same library, PyTorch or Dr.Jit, and
        dropped if `x` is a NumPy array.

    A Dr.Jit result is flat and is treated as data, so that other values do not need a new kernel.

    Raises:
        ValueError: `value` carries a derivative of Dr.Jit and `x` is a tensor of PyTorch, or the reverse.
    """
    own = library(x)
    if own is np:
        return np.asarray(plain(value), dtype=x.dtype)
    if is_differentiable(value) and library(value) is not own:
        _refuse_mixture(value)
        value = plain(value)
    if own.__name__ == "torch":
        tensor = value if is_differentiable(value) else own.tensor(value, dtype=x.dtype)
        return tensor.to(x.device, x.dtype)
    if is_differentiable(value):
        return type(x)(own.ravel(value))
    return type(x)(padded_for_packets(value)) if isinstance(value, np.ndarray) else own.opaque(type(x), value)


def matrix_like(x: Array, value: Any) -> Array:
    """Return the matrix `value` as an array, or as a tensor of Dr.Jit, of the type of `x`. See `like`."""
    flat = like(x, value)
    own = library(x)
    return own.tensor_t(type(x))(flat, value.shape) if own.__name__ == "drjit" else flat


def indices(x: Array) -> Array:
    """Return whole numbers, given as floats, as an array that `gather` accepts."""
    own = library(x)
    if own.__name__ == "drjit":
        return own.uint32_array_t(type(x))(x)
    return x.long() if own.__name__ == "torch" else x.astype(np.intp)


def gather(values: Array, at: Any) -> Array:
    """Return the elements of `values`, counted row by row, at an index or an array of `indices`."""
    own = library(values)
    if own is np:
        return values.take(at)
    if own.__name__ == "drjit":
        return own.gather(type(values), values, at)
    flat = values.reshape(-1)
    # The gradient of a selection is several times as fast as that of an index.
    return flat[at] if isinstance(at, int) else own.index_select(flat, 0, at.reshape(-1)).reshape(at.shape)


def fma(a: Array, b: Array, c: Array) -> Array:
    """Return ab + c; Dr.Jit rounds it once."""
    own = library(a)
    return own.fma(a, b, c) if own.__name__ == "drjit" else a * b + c


def turned(size: Any, waves: Array, dtype: str) -> Array:
    """Return size · e^{2πi waves} as a complex array of NumPy or PyTorch.

    size: real number or array that broadcasts with `waves`.
    waves: float64 array. Whole waves are subtracted before it is rounded.
    dtype: "float32" or "float64", the type of the real and imaginary parts.
    """
    own = library(waves)
    angle = (waves - own.round(waves)) * (2 * np.pi)
    if own is np:
        angle = angle.astype(dtype)
        found = np.empty(angle.shape, np.result_type(dtype, np.complex64))
        np.multiply(np.cos(angle), size, out=found.real)
        np.multiply(np.sin(angle), size, out=found.imag)
        return found
    kind = getattr(own, dtype)
    angle, size = angle.to(kind), size.to(kind) if hasattr(size, "to") else size
    return own.complex(own.cos(angle) * size, own.sin(angle) * size)


def _refuse_mixture(value: Any) -> None:
    if carries_derivative(value):
        owner, remedy = ("PyTorch", ": call optics.torch.psf") if library(value).__name__ == "torch" else ("Dr.Jit", "")
        raise ValueError(f"a number of the pupil requires a derivative of {owner}, which would be lost here{remedy}")
