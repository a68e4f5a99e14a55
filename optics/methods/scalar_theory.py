"""An upper bound of the error of scalar theory that is known before the PSF is computed.

Two rays whose unit vectors differ by Δs interfere with the contrast e·e' of their fields. To second order this is 1 -
Δs²/4 in unpolarised light, 1 - (Δs·p)²/2 in light polarised along p, and 1 in scalar theory. The error of scalar theory
therefore depends on the square of the steepest sine. It also depends on the mean square distance between the points of
the pupil whose light meets. For a round pupil in focus, Richards and Wolf's integrals give the error to all orders.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from optics.apertures.aperture import Aperture, Nodes
from optics.elements.pupil import Pupil
from optics.numerics.precision import precision

__all__ = ["IN_FOCUS", "ROUND", "light_spread", "scalar_theory_error", "steepest_sine"]

# Relative L2 error of scalar theory in the focus of a round flat pupil and linearly polarised light, divided by the
# squared sine of the steepest ray: (sine, error / sine²). In unpolarised light it is 0.82 to 0.94 of that.
# test_scalar_theory.py computes these numbers from Richards and Wolf's integrals.
IN_FOCUS = (
    (0.0, 0.2562),
    (0.2, 0.2609),
    (0.4, 0.2765),
    (0.5, 0.2900),
    (0.6, 0.3092),
    (0.7, 0.3371),
    (0.8, 0.3805),
    (0.85, 0.4129),
    (0.9, 0.4594),
    (0.95, 0.5371),
    (0.98, 0.6288),
    (0.99, 0.6866),
    (0.999, 0.8100),
)
ROUND = 0.25  # mean square of x over a disk, in R²
# Choice, relative to the error in focus: covers aberrations and small windows, see test_scalar_theory.py.
MARGIN = 1.6
CYCLES, DIGITS = 0.5, 2.0  # choice: quadrature of sums over the pupil
LEVEL = 1e-2  # choice: neglected level of a mask's spectrum


def steepest_sine(radius: float, distance: float, leaving: float) -> float:
    """Return the largest sine of rays that meet in a point of a window.

    It is at most that of the ray from the rim to the axis, and at most that of light that leaves the pupil, including
    some diffraction at its edge.

    leaving: largest sine from the slopes of the wavefront, plus a wavelength divided by the radius.
    """
    return min(radius / math.hypot(radius, distance), leaving)


def scalar_theory_error(sine: float, spread: float = ROUND) -> float:
    """Return an upper bound of the relative L2 error of scalar theory's intensity if rays up to this sine meet.

    It is valid for light of any polarisation, over windows that contain the brightest point of the light and a few
    samples around it. spread: see `light_spread`.
    """
    sines, errors = zip(*IN_FOCUS, strict=True)
    return MARGIN * spread / ROUND * float(np.interp(sine, sines, errors)) * min(sine, 1.0) ** 2


def light_spread(pupil: Pupil) -> float:
    """Return the mean square distance [R²] from the axis of the points that light comes from.

    It is taken along the direction in which it is largest: a quarter for a disk, a half for a thin ring, 1 for two
    pinholes at the rim.
    """
    if pupil.mask is None:
        return _open_spread(pupil.aperture)
    types = precision("float64")
    nodes = pupil.aperture.nodes(CYCLES + pupil.mask.bandwidth(LEVEL, pupil.radius) * pupil.radius, DIGITS)
    passed = pupil.amplitude(types.Float64(nodes.x), types.Float64(nodes.y), types)
    return _spread(nodes, nodes.weight * np.abs(passed.numpy()))


@lru_cache(maxsize=128)
def _open_spread(aperture: Aperture) -> float:
    nodes = aperture.nodes(CYCLES, DIGITS)
    return _spread(nodes, nodes.weight)


def _spread(nodes: Nodes, weight: np.ndarray) -> float:
    xx, yy, xy = (float(weight @ part) for part in (nodes.x**2, nodes.y**2, nodes.x * nodes.y))
    total = float(weight.sum())  # 0 behind a dark mask
    return float(np.linalg.eigvalsh([[xx, xy], [xy, yy]])[-1]) / total if total else 0.0
