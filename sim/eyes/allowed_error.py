"""What may be wrong of a receptor's signal before an animal could tell."""

from __future__ import annotations

import math

import optics

# Errors beside noise add up as squares: half of it makes √(1 + 1/4) = 1.12 of it.
SHARE_OF_NOISE = 0.5
# Chosen: errors of less than this share of white's signal never cost rays, however little noise there is.
LEAST_TOLERANCE = 5e-3


def allowed_error(eye: optics.Eye, tolerance: float | None) -> float:
    """Of a signal (root mean square), where None is asked for: half of the receptors' noise, but no less than
    LEAST_TOLERANCE of what white is worth behind the eye's pupil.

    Raises:
        ValueError: a tolerance that is not positive.
    """
    if tolerance is None:
        return max(SHARE_OF_NOISE * float(eye.noise_sigma), LEAST_TOLERANCE * float(eye.throughput))
    if not 0 < tolerance < math.inf:
        raise ValueError(f"tolerance = {tolerance!r}: must be positive")
    return tolerance
