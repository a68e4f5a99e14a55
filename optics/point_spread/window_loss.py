"""Errors of a PSF's contrast at each spatial frequency, due to light outside the window.

The contrast at the frequency f is the modulus of ∫ PSF(x) exp(-2πi f·x) dx, divided by the value at f = 0. Light
outside the window is missing in this integral. Near f = 0, the error is the sum of this light. At other frequencies,
light from different places outside the window mostly cancels, and most of the error arises because the samples end
abruptly at the sides of the window. This error disappears if the samples are multiplied by weights that fall smoothly
to 0 towards the sides. It is therefore estimated as the difference between the spectra of the samples without and with
such weights. At some frequencies, such as the frequency of the rings in the PSF of an annular aperture, light outside
the window does not cancel. Its contribution is estimated from the light in the outer parts of the window.
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
    """Errors of the contrasts in a PSF's MTF, split by cause, as fractions of all light that arrives, (wavelength,).

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
        """Return the same errors for only the first `count` wavelengths."""
        return ErrorCauses(self.lost[:count], self.light[:count], self.rest[:count])


def spectrum_of_loss(image: np.ndarray, lost: float) -> np.ndarray:
    """Return the error of the contrast at each frequency, (fy, fx), if light outside the window is missing.

    The frequencies are those of `MTF.fx`, along both axes.

    The estimate of the error may be 0 at a single frequency although the error is not. Each result is therefore the
    largest of the estimates at a frequency and its eight neighbours.

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
    """Return an estimate of the contrast that is due to light outside the window, at each frequency, (fy, fx).

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
    """Return the Fourier transform of an image, padded with zeros to n x n samples. Frequency 0 has the index n//2."""
    from scipy import fft

    side = max(image.shape)
    return np.asarray(fft.fftshift(fft.fft2(image, (side, side))))


def _fade(n: int, start: float) -> np.ndarray:
    """Return weights of a row of n samples that are 1 in its middle and fall to 0 towards its ends.

    start: distance from the middle at which the weights begin to fall, in half widths of the row.
    """
    away = np.abs(np.arange(n) - n // 2) / max(n / 2, 1.0)
    return np.asarray(np.square(np.cos(np.pi / 2 * np.clip((away - start) / (1 - start), 0, 1))))
