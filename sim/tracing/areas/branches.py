"""Branches for work that few areas need, skipped by packets of the wavefront in which no area needs it."""

from __future__ import annotations

from collections.abc import Callable

import drjit as dr
import mitsuba as mi

from optics.numerics.autodiff import Array


def only_where(needed: Array, values: Callable[[], list[Array]], otherwise: list[float]) -> list[Array]:
    """Return the values where they are needed, and the alternatives otherwise. This is a branch of the kernel: packets
    of lanes skip it if none of their lanes needs the values."""
    found: list[Array] = dr.if_stmt((), needed, values, lambda: [mi.Float(value) for value in otherwise])
    return found
