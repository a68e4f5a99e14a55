"""Checks of numbers and arrays from the user.

They recognise Booleans, and refuse half precision and masked elements. PyTorch's tensors that are only marked as
conjugate or negative are converted to ordinary tensors.
"""

from __future__ import annotations

import math
from numbers import Real
from typing import Any

import numpy as np

__all__ = ["all_finite", "as_array", "full_precision", "is_boolean", "is_number", "readable", "real_array"]

HALF = "float16", "bfloat16", "complex32", "float8", "float6_", "float4_"  # starts of names of types
DRJIT_HALF = "Float16", "f16"  # ends of names of Dr.Jit's types


def is_boolean(value: Any) -> bool:
    """Return whether `value` is True or False. Python would calculate with them as with 1 and 0."""
    return isinstance(value, (bool, np.bool_))


def is_number(value: Any) -> bool:
    """Return whether `value` is a single real number, and no Boolean."""
    return isinstance(value, Real) and not is_boolean(value)


def readable(name: str, value: Any) -> Any:
    """Return `value`, with PyTorch's lazy conjugation and negation carried out; errors are about the argument `name`.

    NumPy cannot read tensors that are marked as conjugate or negative, such as `tensor.conj()` and its imaginary part,
    or that are on a GPU. Tensors are returned on the CPU, unless they require a gradient. Masked elements (numpy.ma)
    are refused, because NumPy would use them as data. Entries of lists and tuples are treated in the same way.

    Raises:
        ValueError: elements are masked, or a tensor is on the device "meta", which contains no numbers.
    """
    if type(value) is np.ndarray:
        return value
    if isinstance(value, (list, tuple)):
        entries = [readable(name, entry) for entry in value]
        return value if all(old is new for old, new in zip(value, entries, strict=True)) else entries
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise ValueError(f"{name} has masked elements: must be without them, so fill or remove them (numpy.ma)")
    if not hasattr(value, "resolve_conj"):
        return value
    if value.device.type == "meta":
        raise ValueError(f"{name} is a tensor on the device 'meta', which has no numbers: must be on cpu or cuda")
    value = value.resolve_conj().resolve_neg() if value.is_conj() or value.is_neg() else value
    return value if value.requires_grad else value.cpu()


def full_precision(name: str, value: Any) -> Any:
    """Return `value`, converted by `readable`; ValueError if it, or an entry of it, is less precise than float32.

    `readable` converts tensors of PyTorch that NumPy cannot read. Less precise types are too coarse for optics: near
    1 µm, successive numbers of float16 are 60 nm apart, a tenth of a wavelength.
    """
    kind = _half(value)
    if kind:
        raise ValueError(f"{name}: must be float32 or float64, not {kind}, whose steps near 1 µm are at least 60 nm")
    return readable(name, value)


def as_array(name: str, values: Any) -> np.ndarray:
    """Return `values` as an array, or an array that contains only None if NumPy cannot convert them.

    See `full_precision`.
    """
    values = full_precision(name, values)
    try:
        given = np.asarray(values)
    except (TypeError, ValueError):
        return np.asarray(None)
    full_precision(name, given)  # other containers, such as buffers and data frames
    return given


def real_array(name: str, value: Any) -> np.ndarray | None:
    """Return `value` as an array of real numbers of any precision, or of Booleans; None if it is something else.

    See `readable`.
    """
    value = readable(name, value)
    try:
        given = np.asarray(value)
    except (TypeError, ValueError):
        return None
    return given if given.dtype.kind in "biuf" else None


def all_finite(array: np.ndarray) -> bool:
    """Return True if every number in the array is finite.

    The sum of their squares is tested first, because NaN and infinity propagate through it, and it takes a fifth of
    the time of a test of each number. If this sum is not finite, each number is tested, because a sum of squares of
    finite numbers may overflow.
    """
    flat = array.ravel()  # copied once, if at all; np.vdot would copy both arguments
    return math.isfinite(np.vdot(flat, flat)) or bool(np.isfinite(flat).all())


def _half(value: Any) -> str:
    """Return the name of a half-precision type in `value`, or an empty string."""
    if type(value) in (float, int, str):
        return ""  # fast path: planning calls this thousands of times
    if isinstance(value, (list, tuple)):
        return next(filter(None, map(_half, value)), "")
    if isinstance(value, (np.ndarray, np.generic)):
        if value.dtype.isbuiltin == 1:  # NumPy takes microseconds to compute a name
            return "float16" if value.dtype.char == "e" else ""
        kind = value.dtype.name
    elif type(value).__module__.startswith("drjit"):
        return type(value).__name__ if type(value).__name__.endswith(DRJIT_HALF) else ""
    else:
        kind = str(getattr(value, "dtype", "")).removeprefix("torch.")
    return kind if kind.startswith(HALF) else ""
