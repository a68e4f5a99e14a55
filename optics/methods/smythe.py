"""The exact vector field behind a plane pupil: Smythe's integral, computed with scalar methods.

W. R. Smythe, Phys. Rev. 72, 1066 (1947), derived the field at the point r behind the pupil from the field E in its
plane:

    E(r) = 1/2π ∇ × ∫ (ẑ × E) e^{ikR}/R dξ.

ξ is a point of the pupil, and R the distance from ξ to r. The x and y components are the first Rayleigh-Sommerfeld
integrals of Ex and Ey. The z component is the same integral of -E·(r - ξ)/z. Since r is constant in the integral, only
the integrals of Ex, Ey and E·ξ are needed. Scalar methods compute each of them as the field behind a mask with this
amplitude, for both planes of polarisation of the light in front of the pupil.
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

# Weights of 1, Ex, ξEx/R, Ey, ηEy/R: see `RayField`.
ALONG_X, ALONG_Y = (0.0, 1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0, 0.0)
MOMENT = (0.0, 0.0, 1.0, 0.0, 1.0)


def smythe(beam: Beam, window: Grid, propagated: Callable[[Beam], np.ndarray]) -> np.ndarray:
    """Return the field Ex, Ey, Ez over the window for light polarised along x, and then along y, (6, y, x), complex.

    The polarisation is that of the light in front of the pupil.

    propagated: function that returns the scalar field of a beam over the window, (y, x).
    """
    x, y = window.x[None, :], window.y[:, None]
    radius, z = beam.pupil.radius, number(beam.distance)
    found = []
    for axis in (0, 1):
        masks = (RayField(beam, axis, weights) for weights in (ALONG_X, ALONG_Y, MOMENT))
        ex, ey, moment = (propagated(replace(beam, pupil=mask.pupil)) for mask in masks)
        found += [ex, ey, (radius * moment - x * ex - y * ey) / z]
    return np.array(found)
