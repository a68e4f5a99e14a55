"""Lengths of the paths from an eye to the parts of surfaces in an area, through water or air.

The transmission of a medium is averaged over an area by Gauss-Legendre quadrature with two nodes per wall and per band
of the floor. Along the other axis of the area, the distance to its middle represents all distances.
"""

from __future__ import annotations

import math

import drjit as dr
import mitsuba as mi

from optics.numerics.autodiff import Array
from sim.tracing.areas.columns import Piece
from sim.tracing.areas.patch import Area, Patch

NODES = (-0.5 / math.sqrt(3), 0.5 / math.sqrt(3))  # in units of the interval, from its middle
LEAST_DIP = 1e-4  # smallest downward slope of directions that hit the floor


def distances_to_wall(area: Area, piece: Piece, patch: Patch) -> list[Array]:
    """Return the distances [m] to two columns of a wall's piece, at the middle height of its visible patch."""
    found, height = [], patch.point.z - area.origin.z
    for node in NODES:
        across = piece.place(area, dr.fma(piece.end - piece.start, node, piece.middle)) - area.origin.xy
        found.append(dr.norm(mi.Vector3f(across.x, across.y, height)))
    return found


def distances_to_floor(area: Area, a: Array, dip: Array, height: Array, above: Array) -> list[Array]:
    """Return the distances [m] from the pupil to the floor at the two quadrature nodes of a band.

    a: column of the band's middle, see `Area`
    dip: downward slope of the direction to the band's middle, on the eye's tangent plane
    height: height of the band, as a difference of slopes
    above: height of the pupil above the floor [m]
    """
    level, found = area.level(a), []
    for node in NODES:
        slope = dr.maximum(dr.fma(height, node, dip), LEAST_DIP)
        found.append(dr.norm(mi.Vector3f(level.x, level.y, slope)) * above / slope)
    return found
