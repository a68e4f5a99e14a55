"""Propagation to distant or shifted windows by matrix products; the kernel is a sum of products f(x) g(y).

The field is the sum over samples of Rayleigh and Sommerfeld's kernel (Goodman, §3.5),

    U(x) = Σ_j u[j] A(ρ) exp(ikD(ρ)) dx²,   D(ρ) = √(z² + ρ²),   A(ρ) = |z| / (2πD²) (1/D - ik),   ρ = x - ξ_j.

For backward propagation (z < 0), the kernel is the conjugate. Let c be the centre of the window. D is the sum of a
function of ρx, a function of ρy, and a coupling e, which vanishes if ρx = cx or ρy = cy:

    D(ρ) = D(ρx, cy) + D(cx, ρy) - D(c) + e(ρ).

In a distant window, A exp(ike) varies so slowly that a few terms a_k(ρx) b_k(ρy) approximate it. The functions a_k and
b_k follow from the singular value decomposition of the values of A exp(ike) at Chebyshev nodes. Each term is then one
matrix product along x and one along y. Fresnel's kernel exp(ikρ²/2z) needs a single term, without an approximation.

A sum over samples contains the light of all replicas of the spectrum. If light at the Nyquist frequency misses the
window, none of the replicas' light reaches it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev

from optics.numerics.accuracy import FLOAT_NOISE, MOST_SAMPLES
from optics.numerics.array_sum_cost import products_seconds
from optics.numerics.cost import PASSAGE_CALL, SEPARABLE_ENTRY, SERIES_TERM
from optics.numerics.grid import Grid
from optics.numerics.precision import Precision
from optics.propagation.spectrum_filter import PropagatedPlane, ScaledPlane
from optics.propagation.transfer_function import Passage
from optics.propagation.transform_sampling import kept_light

__all__ = ["SeparableSampling", "separable"]

TERM_MARGIN = 2.0  # choice: predicted error divided by that of the kernel's largest error; faint light may exceed it
MOST_TERMS = 8  # choice: nearer windows need more terms, and a transform is then faster
NODES = (8, 16, 32)  # choice: numbers of Chebyshev nodes to try
CHECKED = 37  # choice: points along each axis at which the approximation is compared with the kernel

Range = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Terms:
    """The slowly varying part A exp(ike) of a kernel, as a sum of products of a polynomial in ρx and one in ρy.

    ρx and ρy are the offsets between a point of the source and a point of the window.

    A is the amplitude of the kernel, k the wave number, and e the part of the distance that couples ρx and ρy.

    along_x, along_y: Chebyshev coefficients (degree, term) of the polynomials over the ranges of ρx and ρy [m].
    error: largest error of the sum, relative to A exp(ike).
    """

    along_x: np.ndarray
    along_y: np.ndarray
    range_x: Range
    range_y: Range
    error: float

    @property
    def count(self) -> int:
        return int(self.along_x.shape[1])


@dataclass(frozen=True)
class SeparableSampling:
    """Sampling of a separable kernel between two planes."""

    passage: Passage
    source: Grid
    window: Grid
    terms: Terms = field(repr=False)

    @property
    def method(self) -> str:
        return "fresnel" if self.passage.paraxial else "separable_kernel"

    @property
    def samples(self) -> tuple[int, int]:
        return self.source.shape

    @property
    def period(self) -> int:
        return max(self.source.shape)

    def seconds(self, real: str, planes: int = 1) -> float:
        """Return the predicted time [s] to compute the matrices and to propagate the fields of a number of planes.

        real: type of real and imaginary parts, "float32" or "float64".
        """
        (ny, nx), (my, mx), (degree, terms) = self.source.shape, self.window.shape, self.terms.along_x.shape
        products = products_seconds((nx, ny), (mx, my), real, terms)
        entries = (my * ny + mx * nx) * (SEPARABLE_ENTRY + terms * degree * SERIES_TERM)
        return PASSAGE_CALL["separable_kernel"] + planes * products + entries

    @property
    def why(self) -> str:
        """Reason why this sampling was chosen, as text for the `Plan` of a propagation."""
        paraxial = "; paraxial, as requested" if self.passage.paraxial else ""
        return f"distant window: the kernel is a sum of {self.terms.count} products of functions of x and y{paraxial}"

    def propagated(self, plane: np.ndarray, types: Precision) -> PropagatedPlane:
        """Return the field in the window, propagated from the field `plane` (y, x) on the samples of the source."""
        scaled = ScaledPlane.from_plane(plane, types)
        along_x, along_y = _matrices(self, types)
        (ny, nx), (my, mx) = self.source.shape, self.window.shape
        over_x = (along_x.reshape(-1, nx) @ scaled.u.T).reshape(-1, mx, ny)  # (term, x, η)
        result = along_y.reshape(my, -1) @ over_x.transpose(0, 2, 1).reshape(-1, mx)
        arrived = float(np.vdot(result, result).real)
        if not arrived:
            return PropagatedPlane(result, 0.0 if not scaled.power else math.inf, 0.0)
        # Rounding errors of the summands are independent, so they spread evenly over the window.
        nearest = abs(_amplitude(self.passage, 0.0, 0.0)) * self.source.dx**2
        noise = float(nearest) * math.sqrt(scaled.power * result.size / arrived)
        error = 2 * TERM_MARGIN * self.terms.error + FLOAT_NOISE[types.dtype] * (1 + noise)
        return PropagatedPlane(scaled.restored(result), error, 0.0)


@lru_cache(maxsize=64)
def separable(passage: Passage, source: Grid, window: Grid, allowed: float) -> SeparableSampling | None:
    """Return a sampling for propagation by a separable kernel, with a predicted error of at most `allowed`.

    The error is that of the intensity. The kernel is the field of a point source, written as a sum of products of
    functions of x and y. The result is None if the passage requires Fourier transforms (`by_transforms`), its distance
    z is 0, a plane has more than MOST_SAMPLES samples along a side, or more than MOST_TERMS products are necessary. It
    is also None if light at the Nyquist frequency of the source reaches the window, or if the passage has a `limit`, a
    band of frequencies beyond which light must be removed.
    """
    largest = max(*source.shape, *window.shape)
    if passage.z == 0 or passage.by_transforms or passage.limit is not None or largest > MOST_SAMPLES:
        return None
    if not kept_light(passage, source, window).band.fade:
        return None
    range_x, range_y = (
        (float(w[0] - s[-1]), float(w[-1] - s[0])) for w, s in ((window.x, source.x), (window.y, source.y))
    )
    if passage.paraxial:
        one = np.ones((1, 1))
        only = Terms(one * _amplitude(passage, 0.0, 0.0), one, range_x, range_y, 0.0)
        return SeparableSampling(passage, source, window, only)
    terms = _terms(passage, range_x, range_y, allowed / (2 * TERM_MARGIN))
    return None if terms is None else SeparableSampling(passage, source, window, terms)


def _terms(passage: Passage, range_x: Range, range_y: Range, allowed: float) -> Terms | None:
    """Return the slowly varying part of the kernel as a sum of products of a polynomial in x and one in y.

    The sum has as few products as possible for a largest relative error of at most `allowed`. The result is None if
    more than MOST_TERMS products are necessary.
    """
    x, y = (np.linspace(*span, CHECKED) for span in (range_x, range_y))
    exact = _slow_part(passage, x[None, :], y[:, None])
    for nodes in NODES:
        at = np.cos(np.pi * (np.arange(nodes) + 0.5) / nodes)
        node_x, node_y = ((span[1] + span[0] + at * (span[1] - span[0])) / 2 for span in (range_x, range_y))
        series = np.linalg.inv(chebyshev.chebvander(at, nodes - 1))
        values = series @ _slow_part(passage, node_x[None, :], node_y[:, None]) @ series.T
        left, sizes, right = np.linalg.svd(values)
        for count in range(1, min(MOST_TERMS, nodes) + 1):
            along_x, along_y = right[:count].T, left[:, :count] * sizes[:count]
            found = np.einsum("ky,kx->yx", _series(along_y, range_y, y), _series(along_x, range_x, x))
            error = float((np.abs(found - exact) / np.abs(exact)).max())
            if error <= allowed:
                return Terms(along_x, along_y, range_x, range_y, error)
    return None


def _series(coefficients: np.ndarray, span: Range, at: np.ndarray) -> np.ndarray:
    """Return Chebyshev series over the range `span` at positions `at` [m], (term, ...)."""
    width = span[1] - span[0]
    scaled = (2 * at - span[1] - span[0]) / width if width else 0 * at
    found: np.ndarray = chebyshev.chebval(scaled, coefficients)
    return found


@lru_cache(maxsize=2)
def _matrices(how: SeparableSampling, types: Precision) -> tuple[np.ndarray, np.ndarray]:
    """Return the factors of the kernel along x, (term, x, ξ), and along y, (y, term, η).

    The kernel is a sum of terms, and each term is a factor along x times a factor along y.

    (x, y) are positions in the window, and (ξ, η) are positions in the source. The factors along x include the area dx²
    of a sample of the source and the carrier exp(ikz).
    """
    passage, (cx, cy), terms = how.passage, how.passage.centre, how.terms
    x, y = np.subtract.outer(how.window.x, how.source.x), np.subtract.outer(how.window.y, how.source.y)
    carrier = _phasor(passage, math.fmod(abs(passage.z), passage.wavelength) + _sag(passage, cx, cy))
    fast_x = _phasor(passage, _longer(passage, x, cx, cy)) * (carrier * how.source.dx**2)
    along_x = fast_x * _series(terms.along_x, terms.range_x, x)
    along_y = _phasor(passage, _longer(passage, y, cy, cx)) * _series(terms.along_y, terms.range_y, y)
    dtype = types.complex_dtype
    return along_x.astype(dtype), np.ascontiguousarray(along_y.transpose(1, 0, 2), dtype)


def _distance(passage: Passage, x: np.ndarray | float, y: np.ndarray | float) -> np.ndarray:
    found: np.ndarray = np.hypot(passage.z, np.hypot(x, y))
    return found


def _sag(passage: Passage, x: np.ndarray | float, y: np.ndarray | float) -> np.ndarray:
    """Return D(x, y) - |z| without a difference of nearly equal numbers; paraxially, (x² + y²) / 2|z|.

    D(x, y) is the distance between points that are (x, y, z) apart.
    """
    z = abs(passage.z)
    square = np.square(x) + np.square(y)
    found: np.ndarray = square / (2 * z if passage.paraxial else _distance(passage, x, y) + z)
    return found


def _longer(passage: Passage, along: np.ndarray, middle: float, other: float) -> np.ndarray:
    """Return D(along, other) - D(middle, other), without a difference of nearly equal numbers.

    D is the distance [m] between a point of the source and a point of the window. Its arguments are the offsets [m]
    between the points along the two lateral axes: `along` or `middle` along one axis, and `other` along the other one.
    In the paraxial case, D is replaced by Fresnel's approximation.
    """
    more, z = np.square(along) - middle**2, abs(passage.z)
    if passage.paraxial:
        return more / (2 * z)
    found: np.ndarray = more / (_distance(passage, along, other) + _distance(passage, middle, other))
    return found


def _phasor(passage: Passage, path: np.ndarray | float) -> np.ndarray:
    """Return exp(ik path), for backward propagation its conjugate. `path` is a length [m], and k = 2π/wavelength."""
    waves = np.asarray(path) / passage.wavelength
    angle = 2 * np.pi * (waves - np.round(waves))
    found: np.ndarray = np.cos(angle) + 1j * math.copysign(1, passage.z) * np.sin(angle)
    return found


def _amplitude(passage: Passage, x: np.ndarray | float, y: np.ndarray | float) -> np.ndarray:
    """Return the amplitude A of the kernel A exp(ikD) for two points with the lateral offsets x and y [m].

    D is the distance between the points, and k the wave number. In the paraxial case, A is 1/(iλz), where λ is the
    wavelength and z the distance between the points' planes.
    """
    k, z = 2 * np.pi / passage.wavelength, abs(passage.z)
    if passage.paraxial:
        return np.asarray(-1j * k / (2 * np.pi * passage.z))
    distance = _distance(passage, x, y)
    found: np.ndarray = z / (2 * np.pi * distance**2) * (1 / distance - 1j * math.copysign(1, passage.z) * k)
    return found


def _slow_part(passage: Passage, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the part of the kernel that varies slowly, A(x, y) exp(ik e(x, y)), for points that are (x, y) apart [m].

    A is the amplitude of the kernel. e is the part of the distance between the points that is not a sum of a function
    of x and a function of y.
    """
    cx, cy = passage.centre
    # e = [D(x, y) - D(x, cy)] - [D(cx, y) - D(c)]; both differences have the numerator y² - cy².
    far = _distance(passage, x, y) + _distance(passage, x, cy)
    near = _distance(passage, cx, y) + _distance(passage, cx, cy)
    coupling = (np.square(y) - cy**2) * (near - far) / (near * far)
    return _amplitude(passage, x, y) * _phasor(passage, coupling)
