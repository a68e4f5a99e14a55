"""Wavefront aberrations of an eye or other optics, added to an ideal lens, in the convention of aberrometers.

A value is positive if the wavefront that leaves the eye is ahead of the ideal wavefront, as in reports on human eyes. A
myope therefore has a positive defocus. The optical path of light that enters the eye is shorter by this value.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from optics.elements.relief import HeightMap
from optics.elements.square_samples import map_samples
from optics.elements.zernike_modes import mode, norm, weighted_modes
from optics.elements.zernike_order import HIGHEST, fringe_mode, modes_of_vector, noll_mode, numbered
from optics.numerics.arguments import finite, positive, reals, shown
from optics.numerics.array_library import gather, library, like, on_host, on_processor
from optics.numerics.autodiff import Array, carries_derivative, is_differentiable

__all__ = ["HIGHEST", "Aberration", "WavefrontMap", "Zernike", "mode"]

UM = 1e-6


class Aberration(ABC):
    """A wavefront aberration over a circle or square: the length [m] by which the wavefront is ahead of an ideal one.

    radius: radius of the circle or half side of the square [m]. None: equal to the pupil's radius.

    scatters: True if fine detail may scatter light away from the rays, the normals of the wavefront.
    """

    scatters: ClassVar[bool] = True
    radius: float | None

    @abstractmethod
    def ahead(self, x: Array, y: Array) -> Array:
        """Return the aberration [m] at (x, y), in units of its radius; x and y are arrays as in `Relief.height`."""

    @abstractmethod
    def bandwidth(self, level: float) -> float:
        """Return the frequency [cycles per radius] above which the wavefront's components are below `level` [m]."""

    def detail(self, level: float, part: float = 1.0) -> float:
        """Return the frequency [cycles per radius] above which the wavefront's detail has an rms below `level` [m].

        The frequency is along x and y. Fine detail scatters light away from the rays, the normals of the wavefront.

        part: radius of the pupil divided by that of the wavefront.
        """
        return self.bandwidth(level)

    @property
    @abstractmethod
    def knots(self) -> int:
        """Number of polynomial pieces across the wavefront. The grid for `Pupil.slopes` must resolve these pieces."""

    @property
    @abstractmethod
    def span(self) -> float:
        """Largest minus smallest value of the wavefront [m], or an upper bound on this difference."""

    @property
    def rotationally_symmetric(self) -> bool:
        """True if the wavefront and the derivatives that it carries depend only on the distance from the axis."""
        return False

    def _check_radius(self) -> None:
        if self.radius is not None:
            object.__setattr__(self, "radius", positive("radius", self.radius))


@dataclass(frozen=True, eq=False)
class Zernike(Aberration):
    """Zernike polynomials, W = Σ c_n^m Z_n^m(x, y), with the order, sign and normalisation of OSA and ANSI:

        Z_n^m = √((2 - δ_m0)(n + 1)) R_n^|m|(ρ) {cos mθ, m >= 0; sin |m|θ, m < 0},   x = ρ cos θ, y = ρ sin θ

    Each polynomial except the piston has a variance of 1 over the circle. Source: Thibos, Applegate, Schwiegerling &
    Webb, J. Refract. Surg. 18, S652, 2002.

    coefficients_um: {(n, m): [µm]}, or a vector [µm] by the index j = (n(n + 2) + m)/2, piston first.
    radius: radius [m] of the circle to which the coefficients refer, at least the pupil's radius. None: the pupil's
        radius.

    Dr.Jit or PyTorch numbers, in a vector or as the values of a dictionary, may carry derivatives.

    Raises:
        ValueError: a mode is unknown, its order is above 30, a coefficient is not a finite number, a vector does not
            have 1 to 496 entries, or the radius is not positive.
    """

    # A mode has n/2 cycles; its slopes, which grow with n² at the rim, cover higher frequencies.
    scatters: ClassVar[bool] = False
    coefficients_um: Any
    radius: float | None = None
    modes: dict[tuple[int, int], float] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._check_radius()
        given = self.coefficients_um
        if isinstance(given, Mapping):
            for key in given:
                _check_mode(key)
            modes = {(int(n), int(m)): c for (n, m), c in given.items()}
            named = {(n, m): finite(f"coefficients_um[{n}, {m}]", c, carried=True) for (n, m), c in modes.items()}
            object.__setattr__(self, "coefficients_um", modes)
        else:
            named = modes_of_vector(given)
        object.__setattr__(self, "modes", named)

    @classmethod
    def from_noll(cls, coefficients_um: Any, radius: float | None = None) -> Zernike:
        """Return the wavefront whose coefficients are numbered after Noll.

        coefficients_um: {number: [µm]}, or a row [µm] that starts with number 1 (piston).
        radius: radius [m] of the circle. None: the pupil's radius.

        Noll's polynomials, used in astronomy and by poppy, have the normalisation of OSA, a variance of 1.
        A row that is a Dr.Jit array is not accepted.

        Raises:
            ValueError: a number is outside 1 to 496, or a coefficient is invalid, see `Zernike`.
        """
        return cls(numbered(coefficients_um, noll_mode), radius)

    @classmethod
    def from_fringe(cls, coefficients_um: Any, radius: float | None = None) -> Zernike:
        """Return the wavefront whose coefficients are given by their Fringe numbers.

        coefficients_um: {number: [µm]}, or a row [µm] that starts with number 1 (piston).
        radius: radius [m] of the circle. None: the pupil's radius.

        Fringe polynomials, R_n^|m|(ρ) cos mθ and R_n^|m|(ρ) sin |m|θ, have the amplitude 1 at the rim. Each
        coefficient is divided by √((2 - δ_m0)(n + 1)), as the normalisation of `Zernike` requires. Many
        interferometers and lens design programs use Fringe polynomials. A row that is a Dr.Jit array is not accepted.

        Raises:
            ValueError: a number is outside 1 to 36, or a coefficient is invalid, see `Zernike`.
        """
        named = numbered(coefficients_um, fringe_mode)
        return cls({key: value / norm(*key) for key, value in named.items()}, radius)

    def ahead(self, x: Array, y: Array) -> Array:
        if library(x).__name__ != "drjit" and on_host(x) and not carries_derivative(x):
            return self.ahead_at(on_processor(x), on_processor(y), x)
        total = like(x, 0.0)
        for n, m in self._named:
            total = total + self._coefficient(n, m, x) * mode(n, m, x, y)
        return total

    def ahead_at(self, x: np.ndarray, y: np.ndarray, like_array: Array) -> Array:
        """Return the result of `ahead` at (x, y) [radii], from cached values of the polynomials at these positions.

        like_array: array of NumPy or PyTorch, which determines the library and the device of the result.
        """
        named = self._named
        if not named:
            return like(like_array, 0.0)
        return weighted_modes(self._coefficients(named, like_array), tuple(named), x, y)

    @property
    def _named(self) -> list[tuple[int, int]]:
        """Modes whose coefficients are not 0, or carry derivatives."""
        return [key for key, value in self.modes.items() if value != 0 or self.asks]

    def at(self, x: Any, y: Any) -> np.ndarray:
        """Return the wavefront [m] at positions in units of the radius. The polynomials continue beyond 1.

        Raises:
            ValueError: a position is not a real number, or the shapes of x and y do not broadcast.
        """
        x, y = np.broadcast_arrays(reals("x", x), reals("y", y))
        total = np.zeros(x.shape)
        for (n, m), value in self.modes.items():
            total += UM * value * mode(n, m, x, y)
        return total

    @property
    def rms(self) -> float:
        """Root mean square of the wavefront [m] over the whole circle, without piston."""
        return UM * math.sqrt(sum(value**2 for key, value in self.modes.items() if key != (0, 0)))

    def bandwidth(self, level: float) -> float:
        return max(1.0, self.order / 2) if self.span > level or self.asks else 0.0

    def detail(self, level: float, part: float = 1.0) -> float:
        """Return 0, because a Zernike polynomial has no fine detail that scatters light away from the rays.

        A polynomial of order n has only n/2 cycles across the circle. Its slopes, which grow with n² at the rim,
        deflect light farther than these cycles would scatter it.
        """
        return 0.0

    @property
    def knots(self) -> int:
        return max(1, self.order)

    @property
    def span(self) -> float:
        return 2 * UM * sum(abs(value) * norm(*key) for key, value in self.modes.items() if key != (0, 0))

    @property
    def rotationally_symmetric(self) -> bool:
        return all(m == 0 for (_, m), value in self.modes.items() if value != 0 or self.asks)

    @cached_property
    def asks(self) -> bool:
        """True if a coefficient carries a derivative."""
        given = self.coefficients_um
        return any(map(is_differentiable, given.values())) if isinstance(given, dict) else is_differentiable(given)

    @property
    def order(self) -> int:
        """Highest radial order."""
        return max((n for (n, _), value in self.modes.items() if value != 0 or self.asks), default=0)

    def _coefficients(self, named: list[tuple[int, int]], x: Array) -> Array:
        """Return the coefficients [m] of these modes, (mode,), in the array type of `x`."""
        if library(x) is np:
            return UM * np.array([self.modes[key] for key in named])
        return library(x).stack([self._coefficient(n, m, x) for n, m in named])

    def _coefficient(self, n: int, m: int, x: Array) -> Array:
        """Return the coefficient [m] of the mode (n, m), converted to the array type of `x`."""
        given = self.coefficients_um
        if not isinstance(given, dict) and is_differentiable(given):
            return gather(like(x, given), (n * (n + 2) + m) // 2) * UM
        return like(x, given[n, m] if isinstance(given, dict) else self.modes[n, m]) * UM


@dataclass(frozen=True, eq=False)
class WavefrontMap(Aberration):
    """A wavefront W [m], sampled at cell centres over the square [-radius, radius]² and interpolated by cubic splines.

    samples: W, (row, column); rows ascend with y, columns with x. Values are positive if the wavefront is ahead, as in
        Zernike: they are the negative of an optical path difference. They must be unwrapped, and finite and smooth
        outside the pupil, too.
    radius: half side [m] of the square, at least the pupil's radius. None: the pupil's radius.

    A Dr.Jit or PyTorch tensor may carry derivatives.

    Raises:
        ValueError: the array is not two-dimensional, is empty, is of half precision, or contains anything other than
            finite real numbers, or the radius is not positive.
    """

    samples: np.ndarray | Array
    radius: float | None = None
    _map: HeightMap = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._check_radius()
        values = map_samples(self.samples, "samples", "[m], also outside the pupil")
        if not is_differentiable(self.samples):
            object.__setattr__(self, "samples", values)
        object.__setattr__(self, "_map", HeightMap(self.samples))

    def ahead(self, x: Array, y: Array) -> Array:
        return self._map.height(x, y)

    def weighted(self, weights: Any, like_array: Array) -> Array:
        """Return the wavefront W [m] at fixed points, see `HeightMap.weighted`."""
        return self._map.weighted(weights, like_array)

    def bandwidth(self, level: float) -> float:
        return self._map.bandwidth(level)

    def detail(self, level: float, part: float = 1.0) -> float:
        return self._map.detail(level, part) / min(part, 1.0)

    @property
    def knots(self) -> int:
        return self._map.knots

    @property
    def span(self) -> float:
        return self._map.span

    @property
    def rotationally_symmetric(self) -> bool:
        return self._map.rotationally_symmetric


def _check_mode(key: Any) -> None:
    try:
        n, m = key
        fits = n == int(n) and m == int(m) and abs(m) <= n <= HIGHEST and (n - m) % 2 == 0
    except (TypeError, ValueError, OverflowError):
        fits = False
    if not fits:
        raise ValueError(
            f"coefficients_um has {shown(key)}: must be modes (n, m) with n up to {HIGHEST}, |m| <= n and n - m even"
        )
