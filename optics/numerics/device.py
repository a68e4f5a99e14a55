"""Where Dr.Jit computes: on the processor, through LLVM, unless the environment asks for a GPU.

RHABDOM_DEVICE=cpu    the processor; the default: sim's physics and evolve's learner work there too
RHABDOM_DEVICE=cuda   an NVIDIA GPU, for PSFs, eyes and rays
RHABDOM_DEVICE=auto   a GPU where Dr.Jit finds one, else the processor
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
    """The device that is asked for.

    Raises:
        BackendError: RHABDOM_DEVICE names none, or a GPU that Dr.Jit does not find.
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
    """The same, once Dr.Jit can compute there; call it before anything does.

    Raises:
        BackendError: it cannot; one line that says what to do.
    """
    chosen = device()
    if chosen == "cpu":
        require()
    return chosen


def has_gpu() -> bool:
    """Whether Dr.Jit finds an NVIDIA GPU."""
    import drjit

    return bool(drjit.has_backend(drjit.JitBackend.CUDA))
