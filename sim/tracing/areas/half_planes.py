"""The fraction of a unit square that lies on one side of a straight line, for two descriptions of the line.

The square stands for a rectangle of the visual field or for a patch of a surface. `share_above` takes the coefficients
of the line's equation. `mean_clamped` takes the line's heights at the left and the right side of the square.
"""

from __future__ import annotations

import drjit as dr

from optics.numerics.autodiff import Array

# Smallest ratio of a line's slopes along the two sides. Smaller ratios are within float32's rounding error of 1.2e-7.
PARALLEL = 1e-9
# If the two values differ by less than this, their clamped mean replaces the mean of the clamped line. The error is at
# most an eighth of the difference.
LEVEL = 1e-2


def share_above(s: Array, p: Array, q: Array) -> Array:
    """Return the fraction of the unit square, |a| and |b| up to 1/2, in which s + p a + q b > 0."""
    p, q = dr.abs(p), dr.abs(q)
    longer = dr.maximum(dr.maximum(p, q), PARALLEL)
    shorter = dr.maximum(dr.minimum(p, q), PARALLEL * longer)
    below = dr.abs(s)  # the smaller part is a trapezium or, if the line cuts off a corner, a triangle
    reach = dr.maximum((longer + shorter) / 2 - below, 0)
    triangle = dr.minimum(reach * reach / (2 * longer * shorter), 0.5)
    trapezium = 0.5 - below / longer
    smaller = dr.select(below <= (longer - shorter) / 2, trapezium, triangle)
    return dr.select(s > 0, 1 - smaller, smaller)


def mean_clamped(first: Array, last: Array) -> Array:
    """Return the mean of max(0, min(x, 1)) for x that is uniform between `first` and `last`."""
    gap = last - first
    flat = (dr.abs(gap) < LEVEL) | (dr.minimum(first, last) >= 1) | (dr.maximum(first, last) <= 0)
    mean = (_antiderivative(last) - _antiderivative(first)) / dr.select(flat, 1, gap)
    return dr.select(flat, dr.clip((first + last) / 2, 0, 1), mean)


def _antiderivative(x: Array) -> Array:
    within = dr.clip(x, 0, 1)
    return within * within / 2 + dr.maximum(x - 1, 0)
