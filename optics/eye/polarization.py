"""Polarisation-sensitive receptors: microvilli over a retina, and polarised scenes.

If rays are nearly parallel to the axis, light has the same polarisation on the retina as at the pupil. Consider light
of radiance I with a degree of polarisation p and an angle ψ. Microvilli with the azimuth φ and the dichroic ratio d
then absorb as much as in unpolarised light of the same radiance, times

    1 + p (d - 1)/(d + 1) cos 2(ψ - φ),

where α = ψ - φ is the angle between the two. If p = 1, this factor is 2(d cos²α + sin²α)/(d + 1). The absorbed light is
linear in the Stokes parameters I, Q = I p cos 2ψ and U = I p sin 2ψ. The optics blur Q and U in the same way as the
radiance I.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from optics.elements.pupil import Pupil
from optics.methods.scalar_theory import ROUND, light_spread
from optics.numerics.accuracy import AccuracyError
from optics.numerics.arguments import reals, shown
from optics.point_spread.microvilli import Microvilli

__all__ = ["check_rays", "microvilli_of", "polarised_error", "taken_by"]

Tile = tuple[tuple[Microvilli, ...], ...]

# Choice: upper bound on the integrated difference between the vector focus and this model, relative to the signal of a
# white surface and to the squared sine of the steepest ray. The difference of a round pupil in focus is 0.54 to 0.59 up
# to NA 0.5; see tests/optics/eye/test_polarization.py.
STEEP = 0.62


def microvilli_of(given: Any) -> Tile | None:
    """Return microvilli as a tuple of rows, each a tuple of `Microvilli`; None remains None.

    given: one `Microvilli`, which all receptors share, or rows of several `Microvilli`, or None.

    Raises:
        ValueError: `given` is none of these, or rows are empty or have different lengths.
    """
    if given is None:
        return None
    try:
        tile = ((given,),) if isinstance(given, Microvilli) else tuple(tuple(row) for row in given)
    except TypeError:
        tile = ()
    plain = all(isinstance(cell, Microvilli) for row in tile for cell in row)
    if not tile or not plain or len({len(row) for row in tile}) != 1 or not tile[0]:
        raise ValueError(
            f"microvilli = {shown(given)}: must be Microvilli(azimuth_deg), or rows of them, equally long, or None"
        )
    return tile


def polarised_error(pupil: Pupil, distance: float) -> float:
    """Return an upper bound on the error in polarised signals due to oblique rays.

    It is relative to the signal of a white surface.

    distance: distance [m] of the retina from the pupil.
    """
    squared_sine = pupil.radius**2 / (pupil.radius**2 + distance**2)
    return STEEP * light_spread(pupil) / ROUND * squared_sine


def check_rays(pupil: Pupil | None, distance: float, tolerance: float) -> None:
    """Raise an AccuracyError if the upper bound that `polarised_error` returns exceeds the tolerance."""
    error = 0.0 if pupil is None else polarised_error(pupil, distance)
    if pupil is not None and error > tolerance:
        sine = pupil.radius / math.hypot(pupil.radius, distance)
        raise AccuracyError(
            f"microvilli behind a pupil of NA {sine:.2g}: steep rays change polarised signals by up to {error:.2g} of "
            f"the signal of white; tolerance = {tolerance:g} allows NA {sine * math.sqrt(tolerance / error):.2g}: "
            "increase it, narrow the pupil, or see Microvilli.signal(vector_focus(...))"
        )


def taken_by(
    tile: Tile | None, resolution: tuple[int, int], radiance: np.ndarray, polarization: Any
) -> list[tuple[np.ndarray, Any]]:
    """Return the radiance (band, Y, X) and, if it is polarised, Stokes parameters Q and U, each with its weight.

    The signals of the eye are the weighted sum of the signals for each of these one or three components. A weight is a
    number, or an array (h, w) with one entry per receptor.

    polarization: degree in [0, 1] and angle [degrees], each a number, (band,), (Y, X) or (band, Y, X); or None.

    Raises:
        ValueError: polarization is invalid, a degree is outside [0, 1], or the receptors have no microvilli.
    """
    if polarization is None:
        return [(radiance, 1.0)]
    if tile is None:
        raise ValueError("polarization: this eye has no microvilli; create it with microvilli=Microvilli(azimuth_deg)")
    try:
        degree, angle = polarization
    except (TypeError, ValueError):
        raise ValueError(f"polarization = {shown(polarization)}: must be (degree, angle_deg)") from None
    p, psi = _over("polarization's degree", degree, radiance), _over("polarization's angle", angle, radiance)
    if not ((p >= 0) & (p <= 1)).all():
        raise ValueError(f"polarization's degree = {shown(degree)}: must be in [0, 1]")
    linear = [radiance * p * turn(np.radians(2 * psi)) for turn in (np.cos, np.sin)]
    return [(radiance, 1.0), *zip(linear, _preferences(tile, resolution), strict=True)]


def _preferences(tile: Tile, resolution: tuple[int, int]) -> np.ndarray:
    """Return (d - 1)/(d + 1) times cos 2φ and sin 2φ for each receptor, (2, h, w).

    d is the dichroic ratio of the receptor's microvilli, and φ is their azimuth.
    """
    contrast = np.array([[_contrast(cell.dichroic_ratio) for cell in row] for row in tile])
    twice = np.radians([[2 * cell.azimuth_deg for cell in row] for row in tile])
    everywhere = np.ix_(*(np.arange(n) % m for n, m in zip(resolution, contrast.shape, strict=True)))
    return np.stack([part[everywhere] for part in (contrast * np.cos(twice), contrast * np.sin(twice))])


def _contrast(ratio: float) -> float:
    return 1.0 if math.isinf(ratio) else (ratio - 1) / (ratio + 1)


def _over(name: str, value: Any, radiance: np.ndarray) -> np.ndarray:
    found = reals(name, value)
    if not np.isfinite(found).all():
        raise ValueError(f"{name} holds NaN or infinity: must be finite")
    bands, height, width = radiance.shape
    if found.shape not in ((), (bands,), (height, width), radiance.shape):
        raise ValueError(
            f"{name} has shape {found.shape}: must be a number, ({bands},), ({height}, {width}) or {radiance.shape}"
        )
    return found[:, None, None] if found.ndim == 1 else found
