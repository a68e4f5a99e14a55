"""Frozen kernels with typed inputs, and a context in which Dr.Jit can safely record or replay them."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any

import drjit as dr

from optics.numerics.autodiff import Array


class FrozenKernel:
    """A kernel that is recorded once and then replayed. Its inputs are dataclasses.

    Dr.Jit receives only the arrays in them, because it would otherwise traverse every dataclass at every launch.

    body: function (scenes, moving, fixed) -> arrays, with Mitsuba scenes, inputs that change at every launch, and
        inputs that rarely change
    """

    def __init__(self, body: Callable[[Any, Any, Any], Any]) -> None:
        self._body, self._moving, self._fixed = body, None, None
        self._arrays: list[Array] = []

        def recorded(scenes: Any, arrays: list[Array]) -> Any:
            rest = iter(arrays)
            moving = _with_arrays(self._moving, rest)
            return self._body(scenes, moving, _with_arrays(self._fixed, rest))

        self._frozen: Any = dr.freeze(recorded)

    def __call__(self, scenes: Any, moving: Any, fixed: Any) -> Any:
        """Launch the kernel, and return its output arrays; the first call records it."""
        if moving is not self._moving or fixed is not self._fixed:
            self._moving, self._fixed = moving, fixed
            self._arrays = _arrays_of(moving) + _arrays_of(fixed)
        return self._frozen(scenes, self._arrays)

    @property
    def n_recordings(self) -> int:
        """Number of recordings of the kernel."""
        return int(self._frozen.n_recordings)


@cache
def _names(kind: Any) -> tuple[str, ...]:
    """Return the names of a dataclass's fields; an empty tuple for another type."""
    return tuple(field.name for field in fields(kind)) if is_dataclass(kind) else ()


def _arrays_of(inputs: Any) -> list[Array]:
    """Return all arrays in the inputs of a kernel, in the order of fields and list entries.

    inputs: an array, None, or a dataclass or list that contains such inputs, nested to any depth
    """
    if names := _names(inputs.__class__):
        return [array for name in names for array in _arrays_of(getattr(inputs, name))]
    if isinstance(inputs, list):
        return [array for one in inputs for array in _arrays_of(one)]
    return [] if inputs is None else [inputs]


def _with_arrays(inputs: Any, arrays: Iterator[Array]) -> Any:
    """Return a copy of `inputs` in which each array is replaced by the next of `arrays` (order: `_arrays_of`)."""
    if names := _names(inputs.__class__):
        return type(inputs)(*(_with_arrays(getattr(inputs, name), arrays) for name in names))
    if isinstance(inputs, list):
        return [_with_arrays(one, arrays) for one in inputs]
    return None if inputs is None else next(arrays)


class GarbageKept:
    """Context that suspends Python's garbage collection.

    If the collection freed another renderer's kernels or scene while a kernel is recorded, Dr.Jit would abort the
    process.
    """

    def __enter__(self) -> None:
        self._was_enabled = gc.isenabled()
        gc.disable()

    def __exit__(self, *_: object) -> None:
        if self._was_enabled:
            gc.enable()
