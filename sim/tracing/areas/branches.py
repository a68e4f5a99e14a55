"""Work that few areas ask for, left out where none of its neighbours in the wavefront does."""

from __future__ import annotations

from collections.abc import Callable

import drjit as dr
import mitsuba as mi

from optics.numerics.autodiff import Array


def only_where(needed: Array, values: Callable[[], list[Array]], otherwise: list[float]) -> list[Array]:
    """The values where they are needed, and elsewhere the others. A branch of the kernel: packets of lanes of which
    none needs the values pass it by."""
    found: list[Array] = dr.if_stmt((), needed, values, lambda: [mi.Float(value) for value in otherwise])
    return found
