"""The vector field behind a plane pupil, exactly: Smythe's integral, from fields that scalar methods propagate.

W. R. Smythe, Phys. Rev. 72, 1066 (1947): of the field E in the pupil's plane Maxwell's equations make

    E(r) = 1/2π ∇ × ∫ (ẑ × E) e^{ikR}/R dξ.

Its x and y are Rayleigh-Sommerfeld's first integrals of Ex and Ey, and its z is that of -(E·(r - ξ))/z, of which
r and ξ can be told apart: three fields, each behind a mask, for each of two planes of polarisation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from optics.elements.beam import Beam
from optics.elements.ray_field import RayField
from optics.numerics.autodiff import number
from optics.numerics.grid import Grid

__all__ = ["ALONG_X", "smythe"]

# Of 1, Ex, ξEx/R, Ey, ηEy/R: see `RayField`.
ALONG_X, ALONG_Y = (0.0, 1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0, 0.0)
MOMENT = (0.0, 0.0, 1.0, 0.0, 1.0)


def smythe(beam: Beam, window: Grid, propagated: Callable[[Beam], np.ndarray]) -> np.ndarray:
    """Ex, Ey, Ez of light that is polarised along x before the pupil, and the same of y, (6, y, x).

    propagated: a beam's field over the window, (y, x), by scalar theory.
    """
    x, y = window.x[None, :], window.y[:, None]
    radius, z = beam.pupil.radius, number(beam.distance)
    found = []
    for axis in (0, 1):
        masks = (RayField(beam, axis, weights) for weights in (ALONG_X, ALONG_Y, MOMENT))
        ex, ey, moment = (propagated(replace(beam, pupil=mask.pupil)) for mask in masks)
        found += [ex, ey, (radius * moment - x * ex - y * ey) / z]
    return np.array(found)
