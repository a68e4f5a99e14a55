"""Read-only arrays. Several results may share the same stored array, so it must not change.

An array that a function computes and does not store belongs to the caller, who may write into it.
"""

from __future__ import annotations

from dataclasses import fields
from functools import cache
from typing import Any

import numpy as np

from optics.numerics.number_types import full_precision

__all__ = ["ReadOnlyArrays", "read_only"]

FULL_PRECISION = frozenset("?bhilqBHILQfdgFDG")  # NumPy's characters of logical, whole, real and complex numbers


def read_only(array: np.ndarray) -> np.ndarray:
    """Return a view of an array that cannot be written into. The array itself remains as it is."""
    view = array.view()
    view.flags.writeable = False
    return view


class ReadOnlyArrays:
    """Mixin for frozen dataclasses: the NumPy arrays in their fields are read-only; `array.copy()` is writable."""

    def __post_init__(self: Any) -> None:
        fields_of_self = vars(self)
        for name in _names(self.__class__):
            value = fields_of_self.get(name)
            if isinstance(value, np.ndarray):
                # A simulation makes such a dataclass in every step, so common types take a short path.
                if type(value) is not np.ndarray or value.dtype.char not in FULL_PRECISION:
                    value = full_precision(name, value)
                if value.flags.writeable:
                    fields_of_self[name] = read_only(value)


@cache
def _names(kind: Any) -> tuple[str, ...]:
    """Return the names of the fields of a dataclass, cached because every step of a simulation needs them."""
    return tuple(field.name for field in fields(kind))
