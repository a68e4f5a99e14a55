"""The largest acceptable error of a signal, derived from the receptors' noise and their signal for a white surface."""

from __future__ import annotations

from optics.numerics.arguments import LARGEST, shown
from optics.numerics.number_types import is_number
from sim.eyes.compound_eye import WorldEye

# Independent errors add in quadrature. An error of half the noise increases the total to √(1 + 1/4) = 1.12 times the
# noise.
SHARE_OF_NOISE = 0.5
# Chosen: lower limit of the allowed error, relative to the signal of a white surface. It applies if half of the noise
# is smaller.
LEAST_TOLERANCE = 5e-3


def allowed_error(eye: WorldEye, tolerance: float | None) -> float:
    """Return the allowed root mean square error of a signal, in the unit of signals.

    tolerance: the allowed error. If it is None, the allowed error is half of the eye's `noise_sigma` (shot noise is
        not included), but at least 0.005 times `throughput`, the eye's signal of a white surface.

    Raises:
        ValueError: the tolerance is not positive or is above 10¹⁵.
    """
    if tolerance is None:
        return max(SHARE_OF_NOISE * float(eye.noise_sigma), LEAST_TOLERANCE * float(eye.throughput))
    if not (is_number(tolerance) and 0 < tolerance <= LARGEST):
        raise ValueError(f"tolerance = {shown(tolerance)}: must be positive and at most {LARGEST:g}")
    return float(tolerance)
