"""Mitsuba's variant, chosen for the span of a call and given back."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import drjit as dr
import mitsuba as mi

from optics.numerics import backend
from optics.numerics.device import device

# Types of Mitsuba exist once a variant is set, so that no checker can see them: these names say what an `Any` is. What
# Mitsuba makes of arrays (rays, points, interactions) is an `optics.numerics.autodiff.Array`.
MitsubaObject = Any  # a scene, shape, BSDF, sensor, sampler, integrator, texture or transform
Description = dict[str, Any]  # of one of them, for mi.load_dict

DEFAULT_VARIANT = "llvm_ad_spectral"
ON_GPU = "cuda_ad_spectral"


def default_variant() -> str:
    """Mitsuba's spectral variant for the device that is asked for.

    Raises:
        optics.BackendError: there is no such device.
    """
    return ON_GPU if device() == "cuda" else DEFAULT_VARIANT


def on_gpu() -> bool:
    """Whether Mitsuba's variant in force computes on a GPU."""
    return (mi.variant() or "").startswith("cuda")


def computed(*values: Any) -> None:
    """Have a GPU compute these now: OptiX meets one scene per kernel, and leaves others out with a line on stderr. On
    the processor all go into one kernel."""
    if on_gpu():
        dr.eval(values)


@contextmanager
def variant(name: str | None = None) -> Iterator[None]:
    """Mitsuba's variant inside the block, the device's if None; afterwards the caller's own is in force again, if
    there was one.

    (`mi.variant_context` fails where none was set before.)

    Raises:
        optics.BackendError: LLVM is wanted and cannot run.
    """
    name = name or default_variant()
    before = mi.variant()
    if before == name:
        yield
        return
    if name.startswith("llvm"):
        backend.require()
    mi.set_variant(name)
    try:
        yield
    finally:
        if before is not None:
            mi.set_variant(before)
