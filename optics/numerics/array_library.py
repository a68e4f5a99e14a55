"""Operations on arrays of NumPy, PyTorch or Dr.Jit whose names or forms differ between these libraries.

Optical elements compute with the operators of the arrays that they receive, so the same code works with all three
libraries. Plans use NumPy, graphs of PyTorch use its tensors, and compiled kernels use Dr.Jit. No function imports
PyTorch: a caller who passes a tensor has imported it.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from optics.numerics.autodiff import Array, carries_derivative, is_differentiable, plain
from optics.numerics.kept_values import KeptValues
from optics.numerics.precision import padded_for_packets

__all__ = [
    "beside",
    "fma",
    "gather",
    "indices",
    "library",
    "like",
    "matrix_like",
    "on_host",
    "on_processor",
    "sparse_product",
    "to_double",
    "turned",
]

MOST_BYTES = 256e6  # choice, limited by memory: sparse matrices that are kept on other devices than the processor
_ENTRIES = KeptValues(MOST_BYTES, lambda kept: sum(part.numel() * part.element_size() for part in kept[1:]))


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

    A Dr.Jit result is flat. Its numbers are not compiled into kernels as constants, so that other numbers need no new
    kernel.

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
        tensor = value if isinstance(value, own.Tensor) else own.tensor(value, dtype=x.dtype)
        return tensor.to(x.device, x.dtype)
    if is_differentiable(value):
        return type(x)(own.ravel(value))
    return type(x)(padded_for_packets(value)) if isinstance(value, np.ndarray) else own.opaque(type(x), value)


def beside(x: Array, values: np.ndarray) -> Array:
    """Return a NumPy array as an array of the library of `x`, NumPy or PyTorch, on the device of `x`.

    Unlike `like`, it keeps the element type of `values`.
    """
    own = library(x)
    return values if own is np else own.from_numpy(values).to(x.device)


def on_processor(x: Array) -> np.ndarray:
    """Return an array of NumPy or PyTorch as a NumPy array of the same type, without derivatives.

    The program waits until other devices have computed it.
    """
    return np.asarray(x if library(x) is np else x.detach().cpu().resolve_conj().resolve_neg())


def to_double(x: Array) -> Array:
    """Return an array of NumPy or PyTorch in double precision. An array that is already double is not copied."""
    return x.astype(np.float64, copy=False) if library(x) is np else x.double()


def matrix_like(x: Array, value: Any) -> Array:
    """Return the matrix `value` in the library, precision and device of `x`, see `like`.

    For Dr.Jit, the result is a tensor with the shape of the matrix, because arrays of Dr.Jit are flat.
    """
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
    """Return one element of `values`, or several. Elements are counted row by row, as in a flat array.

    at: index of the element, or an array of indices in the type that the function `indices` of this module returns.
    """
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


def sparse_product(matrix: Any, values: Array) -> Array:
    """Return the product of a sparse matrix of SciPy and a vector of NumPy or PyTorch.

    SciPy multiplies tensors on the processor. PyTorch multiplies those on another device, so that no number leaves the
    device. PyTorch can differentiate the product: the gradient with respect to `values` is the transposed matrix times
    the gradient with respect to the result.
    """
    own = library(values)
    if own is np:
        return matrix @ values
    if on_host(values):
        return _operations(own).sparse_product.apply(values, matrix)
    return _sum_of_products(values, matrix)


def on_host(x: Array) -> bool:
    """Return whether an array of NumPy or PyTorch lies in the memory of the processor.

    NumPy and PyTorch can both compute with such an array without a copy.
    """
    return library(x) is np or bool(x.device.type == "cpu")


def _sum_of_products(values: Array, matrix: Any) -> Array:
    """Return the product of a sparse matrix and a vector `values` of PyTorch, on the device of the vector.

    Each entry of the matrix is multiplied by the element of the vector whose index is the column of the entry. The
    products are then added row by row.
    """
    own, key = library(values), (id(matrix), str(values.device), str(values.dtype))
    # The matrix is kept with its entries, so that no other matrix has its id.
    _, places, weight = _ENTRIES.get(key, lambda: (matrix, *_entries(values, matrix)))
    return (own.index_select(values, 0, places).reshape(weight.shape) * weight).sum(1)


def _entries(values: Array, matrix: Any) -> tuple[Array, Array]:
    """Return the column indices of the entries of a sparse matrix, and the entries, on the device of `values`.

    The entries have the shape (row, entry of the row). Rows with fewer entries than others are filled up with zeros.
    The column indices are a flat array. Its order is that of the entries, one row after the other.
    """
    counts = np.diff(matrix.indptr)
    column = np.arange(max(int(counts.max(initial=0)), 1)) < counts[:, None]
    places, weight = np.zeros(column.shape, np.int32), np.zeros(column.shape)
    places[column], weight[column] = matrix.indices, matrix.data
    return beside(values, places.ravel()), beside(values, weight).to(values.dtype)


def turned(size: Any, waves: Array, dtype: str) -> Array:
    """Return size · e^{2πi waves} as a complex array of NumPy or PyTorch.

    size: real number or array that broadcasts with `waves`.
    waves: float64 array of phases in waves. Whole waves are subtracted before the phases are rounded to `dtype`.
    dtype: "float32" or "float64", the type of the real and imaginary parts.
    """
    own = library(waves)
    if own is np:
        return _turned(size, waves, dtype)
    if on_host(waves):
        found = _operations(own).turned.apply(waves, dtype)
    else:
        angle = ((waves - own.round(waves)) * (2 * np.pi)).to(getattr(own, dtype))
        found = own.complex(own.cos(angle), own.sin(angle))
    if isinstance(size, float) and size == 1.0:
        return found
    return found * (size.to(getattr(own, dtype)) if hasattr(size, "to") else size)


def _turned(size: Any, waves: np.ndarray, dtype: str) -> np.ndarray:
    angle = ((waves - np.round(waves)) * (2 * np.pi)).astype(dtype)
    found = np.empty(angle.shape, np.result_type(dtype, np.complex64))
    np.multiply(np.cos(angle), size, out=found.real)
    np.multiply(np.sin(angle), size, out=found.imag)
    return found


@dataclass(frozen=True)
class _Operations:
    """Operations that NumPy and SciPy compute on tensors in the memory of the processor, with their derivatives."""

    sparse_product: Any
    turned: Any


@lru_cache(maxsize=1)
def _operations(torch: Any) -> _Operations:
    class SparseProduct(torch.autograd.Function):
        @staticmethod
        def forward(ctx: Any, values: Array, matrix: Any) -> Array:
            ctx.matrix = matrix
            return torch.from_numpy(matrix @ values.detach().numpy())

        @staticmethod
        def backward(ctx: Any, *gradients: Array) -> tuple[Array, None]:
            return torch.from_numpy(ctx.matrix.T @ gradients[0].detach().numpy()), None

    class Turned(torch.autograd.Function):
        @staticmethod
        def forward(ctx: Any, waves: Array, dtype: str) -> Array:
            ctx.found = _turned(1.0, waves.detach().numpy(), dtype)
            return torch.from_numpy(ctx.found)

        @staticmethod
        def backward(ctx: Any, *gradients: Array) -> tuple[Array, None]:
            own = gradients[0].detach().resolve_conj().resolve_neg().numpy()
            slope = ctx.found.real * own.imag - ctx.found.imag * own.real
            return torch.from_numpy(slope * np.float64(2 * np.pi)), None

    return _Operations(SparseProduct, Turned)


def _refuse_mixture(value: Any) -> None:
    if carries_derivative(value):
        owner, remedy = ("PyTorch", ": call optics.torch.psf") if library(value).__name__ == "torch" else ("Dr.Jit", "")
        raise ValueError(f"a number of the pupil requires a derivative of {owner}, which would be lost here{remedy}")
