"""The exact diffraction integral of a circular pupil with an ideal lens, by quadrature."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev

__all__ = ["ideal_lens_field", "ideal_lens_profile"]

# Nodes beyond the phase's own band: 37 nepers of float64, and as a margin the same again for the amplitude.
DIGITS = 37.0


def ideal_lens_field(
    r: np.ndarray,
    wavelength: float,
    radius: float,
    focal_length: float = math.inf,
    distance: float | None = None,
    *,
    source_distance: float = math.inf,
    nodes: tuple[int, int] | None = None,
) -> np.ndarray:
    """Return the field of an ideal lens exp(-ik(√(ρ² + f²) - f)) in a unit wave at radii r of the plane z = distance.

    The wave is plane, or exp(ik(√(ρ² + s²) - s)) of a point source at s = source_distance. An infinite focal length is
    the bare aperture. The field is the first Rayleigh-Sommerfeld integral (Goodman §3.5), where D is the distance from
    a point of the aperture:

        U = ∫∫ P z/(2πD²) (1/D - ik) e^{ik(D - z)} ρ dρ dφ

    The quadrature is Gauss-Legendre's in ρ and the trapezoid rule in φ, over half the circle by symmetry.

    nodes: numbers of nodes (radial, angular). None: enough for float64, from the gradient of the phase of lens and
        path.

    Raises:
        ValueError: the distance is not finite.
    """
    z = focal_length if distance is None else distance
    if not math.isfinite(z):
        raise ValueError(f"distance = {z}: must be finite without a lens")
    k = 2 * np.pi / wavelength
    r = np.asarray(r, dtype=np.float64)
    field = np.empty(r.shape, dtype=np.complex128)
    for index, at in np.ndenumerate(r):
        n, m = nodes or _nodes(float(abs(at)), k, radius, focal_length, z, source_distance)
        rho, weight = (radius * values for values in _gauss_legendre(n))
        pupil = _phase(rho, source_distance) - _phase(rho, focal_length)
        d2 = rho[:, None] ** 2 + at**2 - 2 * rho[:, None] * at * np.cos(np.pi * (np.arange(m) + 0.5) / m)
        d = np.sqrt(d2 + z**2)
        wave = np.exp(1j * k * (d2 / (d + z) + pupil[:, None]))
        kernel = z / d**2 * (1 / d - 1j * k) * wave
        field[index] = (weight * rho) @ kernel.sum(axis=1) / m
    return field


def ideal_lens_profile(
    r_max: float, wavelength: float, radius: float, focal_length: float = math.inf, distance: float | None = None
) -> Callable[[np.ndarray], np.ndarray]:
    """Return `ideal_lens_field` as a function of r in [0, r_max], interpolated with an error of 1e-11 of the peak.

    The function is a Chebyshev series in r², because the field is even and analytic in r, and band-limited by the
    steepest ray (Trefethen, Approximation Theory and Approximation Practice, ch. 8). It saves time for windows with
    more than a few hundred radii. It raises ValueError if r exceeds r_max.
    """
    z = focal_length if distance is None else distance
    steepest = (radius + r_max) / math.hypot(radius + r_max, z)
    degree = int(0.6 * 2 * np.pi / wavelength * r_max * steepest + 40)

    nodes = chebyshev.chebpts1(degree + 1)
    field = ideal_lens_field(r_max * np.sqrt((nodes + 1) / 2), wavelength, radius, focal_length, distance)
    coefficients = field @ chebyshev.chebvander(nodes, degree) * 2 / (degree + 1)
    coefficients[0] /= 2

    def profile(r: np.ndarray) -> np.ndarray:
        if np.max(r) > r_max * (1 + 1e-12):
            raise ValueError(f"r = {np.max(r):g} m: must lie in [0, {r_max:g}] m")
        return chebyshev.chebval(2 * (np.asarray(r) / r_max) ** 2 - 1, coefficients)

    return profile


def _phase(rho: np.ndarray, distance: float) -> np.ndarray:
    """Return √(ρ² + d²) - d."""
    return rho**2 / (np.hypot(rho, distance) + distance)


def _nodes(r: float, k: float, radius: float, focal_length: float, z: float, source: float) -> tuple[int, int]:
    """Return the numbers of radial and angular nodes.

    They follow from the largest gradient of the phase, and from the nearest complex singularity of the kernel. n
    Gauss-Legendre nodes integrate exp(iωx) on [-1, 1] as soon as 2n exceeds ω. A singularity on the Bernstein ellipse
    with the parameter ρ adds an error of ρ^-2n. 2m points around the circle integrate harmonics below 2m, and a
    singularity at φ = i s adds an error of e^{-2ms}.
    """
    rho = np.linspace(0, radius, 33)[:, None]
    angle = np.linspace(0, np.pi, 17)
    d = np.sqrt(rho**2 + r**2 - 2 * rho * r * np.cos(angle) + z**2)
    slope = (rho - r * np.cos(angle)) / d + rho / np.hypot(rho, source) - rho / np.hypot(rho, focal_length)
    omega = 1.05 * k * radius / 2 * float(np.abs(slope).max())
    turn = k * float((rho * r / d).max())
    nearest = min(z, abs(focal_length), source)
    n = 0.75 * omega + DIGITS / (2 * math.asinh(2 * nearest / radius)) + DIGITS
    strip = math.acosh((radius**2 + r**2 + z**2) / max(2 * radius * r, 1e-300))
    m = 0.6 * turn + DIGITS / (2 * strip) + DIGITS / 2
    return 16 * math.ceil(n / 16), 8 * math.ceil(m / 8)


@lru_cache(maxsize=256)
def _gauss_legendre(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(n)
    return (nodes + 1) / 2, weights / 2
