"""A claim of another source, and the slow systems to which most claims refer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import optics

__all__ = ["FOCAL", "RADIUS", "UNIT", "WAVE", "Case", "across", "amplitude_across", "lens", "strehl_at_centre"]

# f/100: closed forms here are paraxial, and the exact integral differs from them by the square of NA 0.005.
RADIUS, FOCAL, WAVE = 0.5e-3, 0.1, 0.55e-6
UNIT = WAVE * FOCAL / (2 * RADIUS)  # λ f/D [m]
ASKED: dict[str, Any] = {"tolerance": 1e-7, "dtype": "float64"}


@dataclass(frozen=True)
class Case:
    """A claim.

    source: repository and test, or book and equation.
    says: the claim in our words.
    theirs, ours: the number in the source, and a function that computes ours.
    bound: largest allowed difference, the source's own if it states one.
    """

    source: str
    says: str
    theirs: float
    ours: Callable[[], float]
    bound: float


def lens(**more: Any) -> optics.Pupil:
    return optics.Pupil(RADIUS, thin_lens_focal_length=FOCAL, **more)


def across(pupil: optics.Pupil, at: np.ndarray) -> np.ndarray:
    """Return the PSF in the focus at evenly spaced positions [λ f/D] along x.

    It is relative to the peak of the same aperture without aberrations.
    """
    dx = float(at[1] - at[0]) * UNIT
    n = 2 * round(float(at[-1]) * UNIT / dx) + 1
    found = optics.psf(pupil, [WAVE], FOCAL, dx=dx, shape=(1, n), **ASKED).psf[0, 0]
    peak = pupil.area / (WAVE * FOCAL) ** 2
    first = n // 2 + round(float(at[0]) * UNIT / dx)
    return np.asarray(found[first : first + len(at)] / peak, dtype=np.float64)


def amplitude_across(pupil: optics.Pupil, at: np.ndarray) -> np.ndarray:
    """Return the amplitude |U| in the focus at positions [λ f/D] along x, relative to the centre."""
    n = 2 * (len(at) - 1) + 1
    dx = float(at[1] - at[0]) * UNIT
    result = optics.psf(pupil, [WAVE], FOCAL, dx=dx, shape=(1, n), field=True, **ASKED)
    assert result.field is not None
    u = result.field[0, 0]
    # Without the phase e^{ikx²/2f} of the converging wave on a flat screen.
    sphere = np.exp(1j * np.pi * result.x**2 / (WAVE * FOCAL))
    return np.asarray((u / u[n // 2] / sphere)[n // 2 :].real)


def strehl_at_centre(pupil: optics.Pupil) -> float:
    """Return the light on the axis relative to that of a perfect wave through the same aperture."""
    return float(across(pupil, np.array([0.0, 0.1]))[0])
