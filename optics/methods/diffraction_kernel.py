"""The kernel z/(λD²) (1/(kD) - i) e^{ikD} of the first Rayleigh-Sommerfeld integral: modulus and phase, in NumPy.

D is the distance between a point of the pupil and a point of the window, and k the wave number. The term 1/(kD) belongs
to the near field. It matters if the window is a few wavelengths behind the pupil.
"""

from __future__ import annotations

import numpy as np

__all__ = ["FAR", "diffraction_kernel", "near_field"]

FAR = 1 / 300  # choice: largest 1/(kD) at which the modulus of the near-field factor is rounded to 1


def near_field(wavelength: float | np.ndarray, distance: np.ndarray) -> tuple[np.ndarray | float, np.ndarray]:
    """Return modulus and phase [waves] of the factor 1 + i/(kD), with the wave number k.

    wavelength: wavelength in the medium [m].
    distance: distances D [m].
    """
    near = wavelength / (2 * np.pi * distance)
    if near.max() < FAR:
        return 1.0, near / (2 * np.pi)
    return np.sqrt(1 + near * near), np.arctan(near) / (2 * np.pi)


def diffraction_kernel(
    wavelength: float | np.ndarray,
    distance: float | np.ndarray,
    pupil: tuple[np.ndarray, np.ndarray],
    place: tuple[float | np.ndarray, float | np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Return modulus [1/m²] and phase [waves] of i times the kernel, without the spherical phase e^{ikρ}.

    The kernel is z/(λD²) (1/(kD) - i) e^{ikD}. D is the distance of a point of the window from a point of the pupil,
    and ρ is the distance of the same point of the window from the pupil's centre. z is the distance of the window's
    plane, and k the wave number. All arrays are broadcast.

    wavelength: wavelength in the medium [m].
    distance: distance of the window's plane [m].
    pupil: points of the pupil (x, y) [m].
    place: points of the window's plane (x, y) [m].
    """
    (xi, eta), (x, y), z2 = pupil, place, distance * distance
    far2 = np.square(x - xi) + (np.square(y - eta) + z2)
    far = np.sqrt(far2)
    size, waves = near_field(wavelength, far)
    waves += (far - np.sqrt(x * x + y * y + z2)) / wavelength
    return distance / wavelength / far2 * size, waves
