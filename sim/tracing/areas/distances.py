"""Lengths of the light's paths through water or air, from surfaces in an area of the visual field to the eye.

A medium's transmission is averaged over an area by Gauss-Legendre quadrature, with two nodes for each wall and for each
horizontal band of the floor. The two nodes of a wall lie side by side, at the middle height of its visible part. The
two nodes of a band lie one above the other, in its middle column.
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
    """Return the distances [m] from the pupil to two quadrature nodes that lie side by side on a wall.

    piece: part of the wall's face that is visible in the area
    patch: parallelogram that approximates this part; both nodes are at the height of the parallelogram's middle
    """
    found, height = [], patch.point.z - area.origin.z
    for node in NODES:
        across = piece.place(area, dr.fma(piece.end - piece.start, node, piece.middle)) - area.origin.xy
        found.append(dr.norm(mi.Vector3f(across.x, across.y, height)))
    return found


def distances_to_floor(area: Area, a: Array, dip: Array, height: Array, above: Array) -> list[Array]:
    """Return the distances [m] from the pupil to the floor at the two quadrature nodes of a band.

    The band is a horizontal strip of the area. The nodes lie one above the other.

    a: horizontal position of the band's middle in the area, from -1/2 to 1/2, see `Area`
    dip: distance of the band's middle below the horizon on the eye's tangent plane, which is at distance 1
    height: height of the band on this plane
    above: height of the pupil above the floor [m]
    """
    level, found = area.level(a), []
    for node in NODES:
        slope = dr.maximum(dr.fma(height, node, dip), LEAST_DIP)
        found.append(dr.norm(mi.Vector3f(level.x, level.y, slope)) * above / slope)
    return found
