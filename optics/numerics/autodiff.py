"""Parameters that may carry derivatives: their types, and the conversion to plain numbers.

The choice of a method for a PSF uses the plain numbers. The PSF itself is computed from the parameters as arrays, so
that it carries derivatives.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from optics.numerics.backend import BackendError
from optics.numerics.device import VARIABLE, device

__all__ = [
    "Array",
    "Scalar",
    "carries_derivative",
    "entries",
    "grad_enabled",
    "holds_arrays",
    "is_differentiable",
    "is_known",
    "keep_copy",
    "number",
    "of_torch",
    "plain",
    "to_user",
]

COPY = "numbers_on_host"  # attribute of tensors of PyTorch
DEEPEST = 20  # choice: levels of objects within objects

# Dr.Jit creates its types when a backend is first loaded, so type checkers cannot see them. These names are aliases of
# `Any` that document the intended type.
Array = Any  # a Dr.Jit array or tensor
Scalar = Any  # a number, or a Dr.Jit array of one element that carries a derivative


def is_differentiable(value: Any) -> bool:
    """Return whether `value` is an array of Dr.Jit, or a tensor of PyTorch that requires a gradient.

    Python's and NumPy's numbers carry no derivatives. A tensor that requires no gradient is treated like them.
    """
    return type(value) is not float and (type(value).__module__.startswith("drjit") or of_torch(value))


def of_torch(value: Any) -> bool:
    """Return whether `value` is a tensor of PyTorch that requires a gradient."""
    return bool(getattr(value, "requires_grad", False))


def holds_arrays(value: Any, depth: int = 0) -> bool:
    """Return whether `value` is a Dr.Jit array or may contain one, in its elements, fields or attributes.

    The result is True for objects that are nested more than DEEPEST times, such as those that contain themselves.
    """
    if isinstance(value, np.ndarray | str | bytes | int | float | None):
        return False
    if is_differentiable(value) or depth > DEEPEST:
        return True
    if is_dataclass(value):
        parts: Iterable[Any] = (getattr(value, field.name) for field in fields(value))
    elif isinstance(value, tuple | list):
        parts = value
    else:
        parts = (value if isinstance(value, Mapping) else getattr(value, "__dict__", {})).values()
    return any(holds_arrays(part, depth + 1) for part in parts)


def grad_enabled(value: Array) -> bool:
    """Return whether a Dr.Jit array carries a derivative."""
    import drjit as dr

    return bool(dr.grad_enabled(value))


def carries_derivative(value: Any) -> bool:
    """Return whether the gradient of `value`, an array of Dr.Jit or a tensor of PyTorch, is enabled."""
    if type(value) is float:
        return False  # fast path: planning calls this thousands of times
    return of_torch(value) or (is_differentiable(value) and grad_enabled(value))


def entries(row: Any) -> Any:
    """Return `row`, or a tuple of its entries if it is a tensor of PyTorch that requires a gradient.

    Each entry of the tuple is a tensor of its own, through which gradients flow back to the row. The values of all
    entries are copied to the host together.
    """
    if not of_torch(row) or row.ndim == 0:
        return row
    found = tuple(row)
    for entry, value in zip(found, plain(row), strict=True):
        keep_copy(entry, value)
    return found


def is_known(tensor: Array) -> bool:
    """Return whether a tensor has a copy of its numbers on the host, which `keep_copy` attached."""
    return hasattr(tensor, COPY)


def keep_copy(tensor: Array, numbers: np.ndarray) -> None:
    """Attach to a tensor of PyTorch a copy of the tensor's numbers in the memory of the processor.

    The function `plain` then need not copy the numbers from the tensor's device.

    tensor: a tensor that only this package can reach. Users may change the numbers of their tensors, which
        would make the copy wrong.
    numbers: the numbers of the tensor, in the memory of the processor.
    """
    setattr(tensor, COPY, numbers)


def number(value: Any) -> float:
    """Return `value` as a float without derivative. An array must have one element.

    Raises:
        TypeError: the type of `value` is not numeric, or a NumPy array does not have one element.
        ValueError: an array of Dr.Jit, or a tensor that requires a gradient, does not have one element; or `value` is a
            text that is no number.
        BackendError: the array is on a device other than the selected one.
    """
    if type(value) is float:
        return value  # fast path: planning calls this thousands of times
    if is_differentiable(value):
        return float(plain(value).reshape(()))
    return float(value)


def plain(value: Any) -> np.ndarray:
    """Return `value` as a NumPy array without derivative.

    Raises:
        BackendError: a Dr.Jit array is on a device other than the selected one.
    """
    if of_torch(value):
        known = getattr(value, COPY, None)
        value = value.detach().cpu().resolve_neg() if known is None else known
    elif is_differentiable(value):
        import drjit as dr

        _on_the_device(value)
        return np.array(dr.detach(value).numpy(), dtype=np.float64)
    return np.asarray(value, dtype=np.float64)


def _on_the_device(value: Array) -> None:
    given, place = type(value).__module__, device()
    wanted, where = ("drjit.llvm", "the processor") if place == "cpu" else ("drjit.cuda", "a GPU")
    if given.startswith(("drjit.llvm", "drjit.cuda")) and not given.startswith(wanted):
        raise BackendError(
            f"an array of {given}.{type(value).__name__}: must be of {wanted}.ad, because optics computes on {where}; "
            f"{VARIABLE} selects the device"
        )


def to_user(tensor: Array) -> np.ndarray | Array:
    """Return the tensor unchanged if it carries derivatives, else as a NumPy array."""
    import drjit as dr

    return tensor if dr.grad_enabled(tensor) else np.asarray(tensor.numpy())
