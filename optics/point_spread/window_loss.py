"""Errors of contrasts at each spatial frequency.

Light outside the window is missing in the integral ∫ PSF(x) exp(-2πi f·x) dx. Near f = 0, the error is all of this
light. At other frequencies, contributions of different places cancel, and most of the error results from the sharp end
of the samples at the sides of the window. If the samples fade towards the sides, this error disappears. It is therefore
estimated as the difference between the spectra of sharp and fading samples. At some frequencies, such as those of the
rings around the focus of an annulus, the lost light itself has contrast. This contrast is estimated from the outer
parts of the window.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.numerics.read_only import ReadOnlyArrays

__all__ = ["ErrorCauses", "spectrum_of_loss"]

# Choices, see test_measure_bounds.py: positions where samples begin to fade, and sizes of inner windows, in half widths
# of the window; number of steps between frequencies below which all lost light may matter.
FADES = (0.5, 0.7)
INNER = (0.5, 0.7, 0.9)
NEAR_ZERO = 2.0


@dataclass(frozen=True, eq=False)
class ErrorCauses(ReadOnlyArrays):
    """Parts of the error of a PSF's contrasts, as fractions of all light that arrives, (wavelength,).

    lost: upper bound on the light outside the window. It includes the uncertainty `light`.
    light: uncertainty of the amount of light that arrives.
    rest: error of the PSF inside the window.
    """

    lost: np.ndarray
    light: np.ndarray
    rest: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """Largest error of the contrasts over all spatial frequencies, (wavelength,)."""
        found: np.ndarray = self.lost + self.rest
        return found

    def first(self, count: int) -> ErrorCauses:
        """Return the parts of the error for the first `count` wavelengths."""
        return ErrorCauses(self.lost[:count], self.light[:count], self.rest[:count])


def spectrum_of_loss(image: np.ndarray, lost: float) -> np.ndarray:
    """Return the error of the contrast at each frequency, (fy, fx), if light outside the window is missing.

    The frequencies are those of `MTF.fx`, along both axes.

    Spectra have zeros, so each result is the largest estimate of nine neighbouring frequencies.

    image: samples (y, x) of the PSF, as fractions of all light that arrives.
    lost: fraction of this light outside the window.
    """
    from scipy.ndimage import maximum_filter

    image, side = image.astype(np.float64), max(image.shape)
    early, late = (_spectrum(image * (1 - np.outer(*(_fade(n, start) for n in image.shape)))) for start in FADES)
    found = maximum_filter(np.abs(early) + np.abs(early - late) + _like_the_rest(image, lost), 3, mode="wrap")
    steps = np.arange(side) - side // 2
    near_zero = np.exp(-np.square(np.hypot.outer(steps, steps) / NEAR_ZERO))
    return np.minimum(found + lost * near_zero, lost)


def _like_the_rest(image: np.ndarray, lost: float) -> np.ndarray:
    """Return an estimate of what light outside the window contributes to the contrast at each frequency, (fy, fx).

    The estimate assumes that this light has the same contrasts as the light in the outer parts of the window.
    """
    squares, parts = np.zeros((max(image.shape),) * 2), 0
    for part in INNER:
        inner = tuple(slice(n // 2 - round(part * n / 2), n // 2 + round(part * n / 2) + 1) for n in image.shape)
        outer = image.copy()
        outer[inner] = 0
        light = float(outer.sum())
        if light > 0:
            squares += np.square(np.abs(_spectrum(outer)) / light)
            parts += 1
    return lost * np.sqrt(squares / max(parts, 1))


def _spectrum(image: np.ndarray) -> np.ndarray:
    """Return the spectrum on a square grid, zero frequency at n//2."""
    from scipy import fft

    side = max(image.shape)
    return np.asarray(fft.fftshift(fft.fft2(image, (side, side))))


def _fade(n: int, start: float) -> np.ndarray:
    """Return weights of a row of n samples that are 1 in its middle and fall to 0 towards its ends.

    start: distance from the middle at which the weights begin to fall, in half widths of the row.
    """
    away = np.abs(np.arange(n) - n // 2) / max(n / 2, 1.0)
    return np.asarray(np.square(np.cos(np.pi / 2 * np.clip((away - start) / (1 - start), 0, 1))))
