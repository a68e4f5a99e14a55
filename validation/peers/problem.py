"""Cases for all codes, with their input and the exact result.

A code receives the field in the pupil, sampled on a square grid, and returns the intensity on 129 x 129 points. The
exact result is the first Rayleigh-Sommerfeld integral in float64 (`validation.reference`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from scipy.fft import next_fast_len

from validation.reference import ideal_lens_field, ideal_lens_profile, relative_l2

__all__ = ["CASES", "WAVELENGTH", "Case", "Peer", "Run", "SampleGrid", "error", "grids"]

WAVELENGTH = 550e-9
POINTS = 129  # across the window
FOCAL_LENGTH = 300e-6
FEWEST, MOST = 128, 1080  # samples across a grid; 1080 is the first fast length with 8 samples per output
MOST_WIDE = 640  # for wider grids; with 1080, only codes without a band limit gain (near field: 7e-3 instead of 1.3e-2)
PER_OUTPUT = (1 / 6, 1 / 4, 1 / 3, 1 / 2, 1, 2, 4, 8)  # samples per output pitch
CONVERGED = 1e-10


@dataclass(frozen=True)
class SampleGrid:
    """n x n samples at pitch dx [m], sample n//2 on the axis."""

    n: int
    dx: float

    @property
    def x(self) -> np.ndarray:
        return (np.arange(self.n) - self.n // 2) * self.dx

    @property
    def r(self) -> np.ndarray:
        return np.hypot(self.x[None, :], self.x[:, None])

    @property
    def width(self) -> float:
        return self.n * self.dx

    @property
    def padded(self) -> SampleGrid:
        """Grid of twice the width, for codes whose transforms wrap around."""
        return SampleGrid(2 * self.n, self.dx)

    @property
    def odd(self) -> SampleGrid:
        """This grid without the first row and column if their number is even, so that it has a centre sample."""
        return SampleGrid(self.n - 1 + self.n % 2, self.dx)


@dataclass(frozen=True)
class Case:
    """A circular pupil in a unit plane wave, behind it a lens (or none), and the window at `distance` [m]."""

    name: str
    radius: float
    distance: float
    half_window: float
    focal_length: float = math.inf

    @property
    def window(self) -> SampleGrid:
        return SampleGrid(POINTS, 2 * self.half_window / (POINTS - 1))

    @property
    def has_lens(self) -> bool:
        return math.isfinite(self.focal_length)

    def around_pupil(self, n: int) -> SampleGrid:
        """Return n x n samples on a grid just wider than the pupil, for codes that transform onto another pitch."""
        return SampleGrid(n, 2.04 * self.radius / n)

    def exact(self) -> np.ndarray:
        """Return |U|² of a unit wave on the window."""
        return _exact(self)

    def aperture(self, grid: SampleGrid) -> np.ndarray:
        return (grid.r <= self.radius).astype(np.float64)

    def lens(self, grid: SampleGrid, paraxial: bool = False) -> np.ndarray:
        """Return exp(-ik(√(r² + f²) - f)), or its paraxial form exp(-ikr²/2f) for codes that propagate paraxially."""
        if not self.has_lens:
            return np.ones((grid.n, grid.n), np.complex128)
        f, r2 = self.focal_length, grid.r**2
        path = r2 / (2 * f) if paraxial else r2 / (np.sqrt(r2 + f * f) + f)
        return np.exp(-2j * np.pi / WAVELENGTH * path)

    def pupil(self, grid: SampleGrid, paraxial: bool = False) -> np.ndarray:
        """Return the field behind pupil and lens, hard edge: a sample is inside or outside."""
        return self.aperture(grid) * self.lens(grid, paraxial)

    def resampled(self, field: np.ndarray, grid: SampleGrid) -> np.ndarray:
        """Return |field|² on the window by band-limited (sinc) interpolation.

        It is exact at outputs that coincide with a sample.
        """
        weights = np.sinc((self.window.x[:, None] - grid.x[None, :]) / grid.dx)
        return np.abs(weights @ np.asarray(field, np.complex128) @ weights.T) ** 2


CASES = (
    *(
        Case(f"f/{n:g}", FOCAL_LENGTH / (2 * n), FOCAL_LENGTH, 10 * WAVELENGTH * n, FOCAL_LENGTH)
        for n in (1.4, 2, 4, 8, 16)
    ),
    Case("near field", 50e-6, 200e-6, 60e-6),
)


@dataclass(frozen=True)
class Run:
    """A way to compute a case. `compute` is timed; `intensity` converts its result to the window, untimed.

    kind: "angular spectrum" (exact, from hard-edged samples), "exact" (any other) or "paraxial".
    grid: sampling of the pupil before padding.
    """

    method: str
    kind: str
    grid: SampleGrid
    dtype: str
    compute: Callable[[], Any]
    intensity: Callable[[Any], np.ndarray]
    detail: str = ""


@dataclass(frozen=True)
class Peer:
    """A library on PyPI with a function that computes a case from n x n samples in one of its precisions."""

    distribution: str
    package: str
    dtypes: tuple[str, ...]
    runs: Callable[[Case, SampleGrid, str], Iterator[Run]]


def grids(case: Case) -> list[SampleGrid]:
    """Return square grids just wide enough for pupil and window, and coarse grids of twice that width.

    They are sorted by their number of samples, which is even and has a fast Fourier transform. Outputs coincide with
    samples if the samples are fine enough. The wider grids are for codes whose error is light that wraps around the
    edges of a grid.
    """
    least = max(2.04 * case.radius, 2 * case.half_window)
    found = []
    for ratio in PER_OUTPUT:
        dx = case.window.dx / ratio
        n = 2 * next_fast_len(math.ceil((least / dx + 2) / 2), real=True)
        found += [SampleGrid(n, dx)] if FEWEST <= n <= MOST else []
        found += [SampleGrid(2 * n, dx)] if FEWEST <= 2 * n <= MOST_WIDE else []
    return sorted(found, key=lambda grid: (grid.n, grid.dx))


def error(case: Case, intensity: np.ndarray, fitted: bool) -> float:
    """Return the relative L2 error of an intensity over the window; infinite for a wrong shape or non-finite values.

    fitted: True to multiply the intensity first by the factor that minimises the error.
    """
    exact = case.exact()
    image = np.asarray(intensity, np.float64)
    if image.shape != exact.shape or not np.isfinite(image).all():
        return math.inf
    scale = np.sum(image * exact) / np.sum(image * image) if fitted else 1.0
    return relative_l2(scale * image, exact)


@cache
def _exact(case: Case) -> np.ndarray:
    """Return the exact result with the reference's own node counts, checked at some radii with many more nodes.

    Raises:
        ArithmeticError: the two results differ by more than CONVERGED.
    """
    r = np.hypot(case.window.x[None, :], case.window.x[:, None])
    profile = ideal_lens_profile(float(r.max()), WAVELENGTH, case.radius, case.focal_length, case.distance)
    some = np.linspace(0, float(r.max()), 23)
    many = int(128 + 4 * case.radius / WAVELENGTH)
    again = ideal_lens_field(some, WAVELENGTH, case.radius, case.focal_length, case.distance, nodes=(many, many))
    apart = relative_l2(np.abs(profile(some)) ** 2, np.abs(again) ** 2, weight=some)
    if not apart <= CONVERGED:
        raise ArithmeticError(f"{case.name}: two node counts differ by {apart:.1e}, must be within {CONVERGED:g}")
    return np.abs(profile(r)) ** 2
