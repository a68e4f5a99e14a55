"""The device that Dr.Jit computes on: the processor, through LLVM, unless the environment selects a GPU.

RHABDOM_DEVICE=cpu    the processor (default)
RHABDOM_DEVICE=cuda   an NVIDIA GPU, for PSFs, eyes and rays
RHABDOM_DEVICE=auto   a GPU if Dr.Jit finds one, else the processor

The physics of `sim` and the learner of `evolve` always run on the processor.
"""

from __future__ import annotations

import os
from typing import Literal

from optics.numerics.backend import BackendError, require

__all__ = ["VARIABLE", "device", "make_ready"]

Device = Literal["cpu", "cuda"]
VARIABLE = "RHABDOM_DEVICE"
CHOICES = ("auto", "cpu", "cuda")


def device() -> Device:
    """Return the selected device.

    Raises:
        BackendError: RHABDOM_DEVICE has an invalid value, or selects a GPU and Dr.Jit finds none.
    """
    asked = os.environ.get(VARIABLE, "cpu")
    if asked not in CHOICES:
        raise BackendError(f"{VARIABLE} = {asked!r}: must be one of {', '.join(CHOICES)}")
    if asked == "cpu":
        return "cpu"
    if has_gpu():
        return "cuda"
    if asked == "cuda":
        raise BackendError(f"{VARIABLE} = 'cuda': Dr.Jit finds no NVIDIA GPU here; must be cpu or auto")
    return "cpu"


def make_ready() -> Device:
    """Prepare Dr.Jit for the selected device and return the device. Call this function before any use of Dr.Jit.

    Raises:
        BackendError: Dr.Jit cannot use the device. The message is one line with the remedy.
    """
    chosen = device()
    if chosen == "cpu":
        require()
    return chosen


def has_gpu() -> bool:
    """Return whether Dr.Jit finds an NVIDIA GPU."""
    import drjit

    return bool(drjit.has_backend(drjit.JitBackend.CUDA))
