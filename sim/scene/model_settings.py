"""What physics goes by of a model, as bytes: so that a change of it is noticed at every step, and can be undone.

Left out is what is large: textures, meshes and heights, of which a change stays; and names.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

_LEFT_OUT = ("tex", "mesh", "hfield", "skin", "bvh", "oct", "name", "text", "path")
_STRUCTS = ("opt", "stat")


class ModelSettings:
    """Of one model, as it is whenever it is asked."""

    def __init__(self, model: mujoco.MjModel) -> None:
        fields = [("", model), *((f"{name}.", getattr(model, name)) for name in _STRUCTS)]
        known = [
            (f"{prefix}{name}", owner, name, getattr(owner, name))
            for prefix, owner in fields
            for name in dir(owner)
            if not name.startswith(("_", *_LEFT_OUT))
        ]
        self._arrays = {full: held for full, _, _, held in known if isinstance(held, np.ndarray) and held.size}
        self._scalars = {full: (owner, name) for full, owner, name, held in known if "." in full and _is_number(held)}
        self._every: list[Any] = list(self._arrays.values())  # views: what they show is the model's memory

    def held(self) -> bytes:
        """Everything, in one piece; of models of one making as long as each other's."""
        scalars: Any = np.array([getattr(owner, name) for owner, name in self._scalars.values()], float)
        return b"".join([*self._every, scalars])

    def hold(self, held: bytes) -> None:
        """Inverse of `held`: the model is as this says."""
        start = 0
        for array in self._every:
            array[...] = np.frombuffer(held, array.dtype, array.size, start).reshape(array.shape)
            start += array.nbytes
        values = np.frombuffer(held, float, len(self._scalars), start)
        for (owner, name), value in zip(self._scalars.values(), values, strict=True):
            setattr(owner, name, type(getattr(owner, name))(value))

    def differing(self, before: bytes) -> str:
        """Name of the first field that is not as it was; "" if all are."""
        start, now = 0, self.held()
        sizes = {name: array.nbytes for name, array in self._arrays.items()} | dict.fromkeys(self._scalars, 8)
        for name, size in sizes.items():
            if before[start : start + size] != now[start : start + size]:
                return name
            start += size
        return ""


def _is_number(held: object) -> bool:
    return isinstance(held, int | float) and not isinstance(held, bool)
