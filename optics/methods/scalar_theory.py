"""An upper bound on the error of scalar theory. It is computed before the PSF.

Let the unit vectors of two rays differ by Δs. The contrast of their interference is the product e·e' of their fields'
directions. To second order in Δs it is 1 - Δs²/4 in unpolarised light, 1 - (Δs·p)²/2 in light polarised along p, and 1
in scalar theory. For small angles, the error of scalar theory is therefore proportional to the square of the steepest
ray's sine, and to the mean square distance between the axis and the points of the pupil from which the light comes. For
a round pupil in focus, the integrals of Richards and Wolf give the error to all orders.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from optics.apertures.aperture import Aperture, Nodes
from optics.elements.pupil import Pupil

__all__ = ["IN_FOCUS", "ROUND", "light_spread", "scalar_theory_error", "steepest_sine"]

# Pairs (sine of the steepest ray, error / sine²). The error is the relative L2 error of scalar theory in the focus of a
# round flat pupil, for linearly polarised light. The error in unpolarised light is 0.82 to 0.94 times as large.
# test_scalar_theory.py computes these numbers from the integrals of Richards and Wolf.
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
_TABLE = np.array(IN_FOCUS).T
ROUND = 0.25  # mean of x² over a disk of radius R, in R²
# Choice: safety factor on the error in focus. It covers aberrations and small windows, see test_scalar_theory.py.
MARGIN = 1.6
CYCLES, DIGITS = 0.5, 2.0  # choice: cycles per radius and digits of the quadrature over the pupil
LEVEL = 1e-2  # choice: neglected level of a mask's spectrum


def steepest_sine(radius: float, distance: float, leaving: float) -> float:
    """Return the largest sine of the rays that meet in a point of a window.

    The result is the smaller of two bounds: the sine of the ray from the pupil's rim to the image on the axis, and the
    largest sine of the light that leaves the pupil, including diffraction at the edge.

    leaving: largest sine that follows from the slopes of the wavefront, plus the wavelength divided by the radius.
    """
    return min(radius / math.hypot(radius, distance), leaving)


def scalar_theory_error(sine: float, spread: float = ROUND) -> float:
    """Return an upper bound on the relative L2 error of the scalar intensity for rays with sines up to `sine`.

    The bound is valid for light of any polarisation. The intensity must be compared in a window that contains the
    brightest point of the light and a few samples around it.

    spread: mean square distance between the axis and the points of the pupil from which the light comes, in squared
        radii. The distance is measured along the direction for which the result is largest (see `light_spread`).
    """
    return MARGIN * spread / ROUND * float(np.interp(sine, *_TABLE)) * min(sine, 1.0) ** 2


def light_spread(pupil: Pupil) -> float:
    """Return the mean square distance between the axis and the points of the pupil, weighted by the amplitude there.

    Its unit is the squared radius. Distances are measured along one direction, the one with the largest result. The
    result is a quarter for a disk, a half for a thin ring, and 1 for two pinholes on opposite sides of the rim.
    """
    if pupil.mask is None:
        return _open_spread(pupil.aperture)
    nodes = pupil.aperture.nodes(CYCLES + pupil.mask.bandwidth(LEVEL, pupil.radius) * pupil.radius, DIGITS)
    return _spread(nodes, nodes.weight * np.abs(pupil.amplitude(nodes.x, nodes.y)))


@lru_cache(maxsize=128)
def _open_spread(aperture: Aperture) -> float:
    nodes = aperture.nodes(CYCLES, DIGITS)
    return _spread(nodes, nodes.weight)


def _spread(nodes: Nodes, weight: np.ndarray) -> float:
    xx, yy, xy = (float(weight @ part) for part in (nodes.x**2, nodes.y**2, nodes.x * nodes.y))
    total = float(weight.sum())  # the weights sum to 0 behind a mask that transmits no light
    return float(np.linalg.eigvalsh([[xx, xy], [xy, yy]])[-1]) / total if total else 0.0
