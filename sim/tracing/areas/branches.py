"""Conditional computations, which are skipped for areas of the visual field that do not need the results.

For example, only an area in which a sphere may be visible needs the light from this sphere.
"""

from __future__ import annotations

from collections.abc import Callable

import drjit as dr
import mitsuba as mi

from optics.numerics.autodiff import Array


def only_where(needed: Array, values: Callable[[], list[Array]], otherwise: list[float]) -> list[Array]:
    """Return the values in lanes that need them, and the alternatives in all others.

    Packets of lanes skip the computation if none of their lanes needs the values.

    needed: mask of the lanes that need the values
    values: function that computes the values
    otherwise: alternatives, one for each value
    """
    found: list[Array] = dr.if_stmt((), needed, values, lambda: [mi.Float(value) for value in otherwise])
    return found
