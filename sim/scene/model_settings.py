"""Most fields of a model (and of its `opt` and `stat`) as bytes, to detect changes at every step and to undo them.

Names, texts, large fields (such as textures, meshes, skins and heights) and the fields of `vis` are not included:
changes of these are neither detected nor undone.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

_LEFT_OUT = ("tex", "mesh", "hfield", "skin", "bvh", "oct", "name", "text", "path")
_STRUCTS = ("opt", "stat")


class ModelSettings:
    """Current settings of a MuJoCo model: the values of its fields, except names, texts and large fields (meshes)."""

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
        self._every: list[Any] = list(self._arrays.values())  # views of the model's memory

    def to_bytes(self) -> bytes:
        """Return all settings as bytes. Their length is the same for models compiled from the same source."""
        scalars: Any = np.array([getattr(owner, name) for owner, name in self._scalars.values()], float)
        return b"".join([*self._every, scalars])

    def restore(self, held: bytes) -> None:
        """Restore the settings that `to_bytes` returned."""
        start = 0
        for array in self._every:
            array[...] = np.frombuffer(held, array.dtype, array.size, start).reshape(array.shape)
            start += array.nbytes
        values = np.frombuffer(held, float, len(self._scalars), start)
        for (owner, name), value in zip(self._scalars.values(), values, strict=True):
            setattr(owner, name, type(getattr(owner, name))(value))

    def differing(self, before: bytes) -> str:
        """Return the name of the first field that has changed; "" if none has."""
        start, now = 0, self.to_bytes()
        sizes = {name: array.nbytes for name, array in self._arrays.items()} | dict.fromkeys(self._scalars, 8)
        for name, size in sizes.items():
            if before[start : start + size] != now[start : start + size]:
                return name
            start += size
        return ""


def _is_number(held: object) -> bool:
    return isinstance(held, int | float) and not isinstance(held, bool)
