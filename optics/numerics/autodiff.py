"""Parameters that derivatives are asked for: plain numbers to the planner, Dr.Jit arrays to the physics."""

from __future__ import annotations

from typing import Any

import numpy as np

from optics.numerics.backend import BackendError
from optics.numerics.device import VARIABLE, device

__all__ = ["Array", "Scalar", "is_differentiable", "number", "plain", "to_user"]

# Dr.Jit makes its types when it is first asked for a backend, so that no checker can see them: these names say what an
# `Any` is meant to be.
Array = Any  # a Dr.Jit array or tensor
Scalar = Any  # a number, or a Dr.Jit array of one element that carries a derivative


def is_differentiable(value: Any) -> bool:
    """Whether value is a Dr.Jit array (or tensor), not a Python or NumPy number."""
    return type(value) is not float and type(value).__module__.startswith("drjit")


def number(value: Any) -> float:
    """value as a float; a Dr.Jit array of one element gives its entry, without derivative.

    Raises:
        TypeError: of a type that is no number's.
        ValueError: an array of more than one element.
        BackendError: an array of another device than the one that is asked for.
    """
    if type(value) is float:
        return value  # asked for thousands of times in planning
    if is_differentiable(value):
        return float(plain(value).reshape(()))
    return float(value)


def plain(value: Any) -> np.ndarray:
    """value as a NumPy array, without derivative.

    Raises:
        BackendError: a Dr.Jit array of another device than the one that is asked for.
    """
    if is_differentiable(value):
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
            f"{VARIABLE} chooses"
        )


def to_user(tensor: Array) -> np.ndarray | Array:
    """What a user gets: a NumPy array, or the Dr.Jit tensor itself where it carries derivatives."""
    import drjit as dr

    return tensor if dr.grad_enabled(tensor) else np.asarray(tensor.numpy())
