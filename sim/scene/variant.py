"""Mitsuba's variant, set during a call and restored afterwards."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import drjit as dr
import mitsuba as mi

from optics.numerics import backend
from optics.numerics.device import device

# Mitsuba's types exist only after a variant is set, so type checkers cannot see them. These aliases of `Any` document
# the intended type. Mitsuba's objects made of arrays (rays, points, interactions) have the type
# `optics.numerics.autodiff.Array`.
MitsubaObject = Any  # a scene, shape, BSDF, sensor, sampler, integrator, texture or transform
Description = dict[str, Any]  # description of one of them, for mi.load_dict

DEFAULT_VARIANT = "llvm_ad_spectral"
ON_GPU = "cuda_ad_spectral"


def default_variant() -> str:
    """Return Mitsuba's spectral variant for the requested device.

    Raises:
        optics.BackendError: the device is not available.
    """
    return ON_GPU if device() == "cuda" else DEFAULT_VARIANT


def on_gpu() -> bool:
    """Return whether Mitsuba's active variant computes on a GPU."""
    return (mi.variant() or "").startswith("cuda")


def computed(*values: Any) -> None:
    """Compute these values now, in a separate kernel, if the device is a GPU.

    A kernel must contain only one scene, because OptiX ignores further scenes and reports them only by a line on
    stderr. On the CPU, everything is computed in one kernel.
    """
    if on_gpu():
        dr.eval(values)


@contextmanager
def variant(name: str | None = None) -> Iterator[None]:
    """Set Mitsuba's variant inside the block, and restore the previous one, if any, afterwards.

    Mitsuba's own `mi.variant_context` fails if no variant was set before.

    name: the variant; None: the spectral variant for the requested device (CPU or GPU)

    Raises:
        optics.BackendError: LLVM is requested and cannot run, or `name` is None and the device is not available.
        ImportError: Mitsuba lacks the variant.
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
