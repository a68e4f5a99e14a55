"""Interpolation between samples (linear, Lagrange polynomials, cubic B-splines), and tabulated functions.

`lagrange_weights`, `cubic_bsplines` and `tensor_product` accept arrays of NumPy, PyTorch and Dr.Jit. `Interpolant.at`
requires Dr.Jit arrays. `linear_weights`, `lagrange_basis` and `chebyshev_basis` require NumPy arrays.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from math import pi

import numpy as np

from optics.numerics.array_library import fma
from optics.numerics.autodiff import Array
from optics.numerics.precision import Precision, opaque, padded_for_packets

__all__ = [
    "LAGRANGE_8",
    "TAPS",
    "Interpolant",
    "chebyshev_basis",
    "chebyshev_points",
    "cubic_bsplines",
    "lagrange_basis",
    "lagrange_weights",
    "linear_weights",
    "tensor_product",
]

# Choice: number of samples along an axis for interpolation onto a grid. The error falls with the eighth power of their
# distance. Tables of functions are interpolated from six samples, with an error that falls with the sixth power.
TAPS = 8
# Largest error of eight-point interpolation of e^{iφ}, divided by (radians per sample)⁸. It is |Π(t - x_j)| / 8!, which
# is (1·3·5·7)²/2⁸ / 8! halfway between the middle two samples.
LAGRANGE_8 = 1.07e-3
TABLE_TAPS = 6
MARGIN = TABLE_TAPS // 2 - 1  # number of samples beyond either end of a table that interpolation reads


@dataclass(frozen=True, eq=False)
class Interpolant:
    """Table of a function between two ends, with evenly spaced samples. Beyond the ends, the function is constant.

    first: position of the lower end.
    step: distance between samples.
    samples: values at the positions first + i step, i = -2 ... n + 1. The n samples from i = 0 to n - 1 reach from end
        to end. Beyond each end there are two more, which six-point interpolation needs.
    """

    first: float
    step: float
    samples: np.ndarray

    @classmethod
    def from_function(
        cls, function: Callable[[np.ndarray], np.ndarray], ends: tuple[float, float], cycles: float, error: float
    ) -> Interpolant:
        """Return a table of a function that varies only between two ends, with at most `cycles` cycles between them.

        The function is expensive, so it is evaluated only at Chebyshev nodes, from which the table is computed. With N
        samples per cycle, six-point interpolation of a unit wave has the error (225/64)/720 (2π/N)⁶. A twentieth of
        this error is assumed, because tabulated functions are smoothed steps, such as the edge of a soft aperture: most
        of their spectrum lies far below the highest frequency.

        ends: the positions beyond which the function is constant.
        error: permitted error of interpolated values.
        """
        per_cycle = 2 * pi * (2.4e-4 / error) ** (1 / 6)
        n = int(cycles * per_cycle + 64)  # choice: at least 64 samples
        # A wave with z = π · cycles has the Chebyshev coefficients 2 J_m(z), which fall fast beyond m = z. The margin
        # beyond m = z is a choice.
        degree = int(pi * cycles - 3 * np.log10(error) + 12)
        middle, half = (ends[0] + ends[1]) / 2, (ends[1] - ends[0]) / 2
        values = function(middle + half * np.cos(pi * (np.arange(degree) + 0.5) / degree))
        series = np.polynomial.Chebyshev(_cosine_sums(values) / degree * np.where(np.arange(degree) == 0, 0.5, 1))
        step = 2 / (n - 1)
        samples = series(np.clip(np.arange(-MARGIN, n + MARGIN) * step - 1, -1, 1))
        # Beyond the ends, where the function is constant, values are exact.
        samples[: MARGIN + 1], samples[-MARGIN - 1 :] = function(np.array(ends))
        return cls(ends[0], step * half, samples)

    def at(self, place: Array, types: Precision) -> Array:
        """Return the function's interpolated values at positions, as a flat array. The result is differentiable.

        place: positions, a flat Dr.Jit Float64 array.
        """
        import drjit as dr

        last = opaque(types, len(self.samples) - 2 * MARGIN - 1)
        t = dr.clip((place - opaque(types, self.first)) * opaque(types, 1 / self.step), 0, last)
        cell = dr.minimum(dr.floor(t), last - 1)
        samples, first = types.Float64(padded_for_packets(self.samples)), types.Index(cell)
        values = [dr.gather(types.Float64, samples, first + i) for i in range(TABLE_TAPS)]
        return sum(
            (w * v for w, v in zip(lagrange_weights(t - cell, TABLE_TAPS), values, strict=True)), types.Float64(0)
        )


def _cosine_sums(values: np.ndarray) -> np.ndarray:
    """Return 2 Σ_j v_j cos(πk(2j + 1)/2n) for every k, by one FFT.

    Source: Makhoul, IEEE Transactions on Acoustics, Speech, and Signal Processing 28 (1980) 27.
    """
    n = len(values)
    turned = np.fft.fft(np.concatenate([values[::2], values[1::2][::-1]]))
    found: np.ndarray = 2 * (turned * np.exp(-0.5j * pi * np.arange(n) / n)).real
    return found


def lagrange_weights(t: Array, taps: int) -> list[Array]:
    """Return the weights of Lagrange interpolation at t from an even number `taps` of samples, spaced 1 apart.

        L_i(t) = Π_{j≠i} (t - x_j) / (x_i - x_j),   x_i = i + 1 - taps/2,   i = 0 ... taps - 1.

    t in [0, 1] is the position between the middle two samples. Each numerator is computed as the product over the nodes
    before i times the product over the nodes after i. The denominator is (-1)^(taps-1-i) i! (taps-1-i)!.
    """
    last = taps - 1
    steps = [t + (taps // 2 - 1 - i) for i in range(taps)]
    before, after = [1.0], [1.0]
    for i in range(last):
        before.append(before[-1] * steps[i])
        after.append(after[-1] * steps[last - i])
    scale = [(-1) ** (last - i) / (math.factorial(i) * math.factorial(last - i)) for i in range(taps)]
    return [before[i] * after[last - i] * scale[i] for i in range(taps)]


def linear_weights(x: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Return the weights (node, *x.shape) of linear interpolation between ascending nodes, constant beyond the ends."""
    return np.stack([np.interp(x, nodes, row) for row in np.eye(len(nodes))])


def cubic_bsplines(t: Array) -> list[Array]:
    """Return the four uniform cubic B-splines that are nonzero in a knot interval, at t in [0, 1].

    Source: Piegl & Tiller, The NURBS Book, ch. 2.
    """
    s = 1 - t
    return [s * s * s / 6, (3 * t * t * t - 6 * t * t + 4) / 6, (3 * s * s * s - 6 * s * s + 4) / 6, t * t * t / 6]


def tensor_product(value: Callable[[int, int], Array], across: list[Array], along: list[Array]) -> Array:
    """Return Σ_ij a_i b_j value(i, j), a sum over the samples in rows i and columns j.

    The weights a_i of the rows are in the list `along`, and the weights b_j of the columns in the list `across`.
    """
    total = 0.0
    for i, down in enumerate(along):
        line = 0.0
        for j, right in enumerate(across):
            line = fma(right, value(i, j), line)
        total = fma(down, line, total)
    return total


def chebyshev_points(n: int) -> np.ndarray:
    """Return the n Chebyshev points of the first kind on [-1, 1]."""
    return np.cos(np.pi * (np.arange(n) + 0.5) / n)


def lagrange_basis(x: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Return the values at x of the Lagrange polynomials of arbitrary nodes, (node, *x.shape)."""
    basis = np.ones((len(nodes), *np.shape(x)))
    for i, node in enumerate(nodes):
        for j, other in enumerate(nodes):
            if j != i:
                basis[i] *= (x - other) / (node - other)
    return basis


def chebyshev_basis(x: np.ndarray, n: int) -> np.ndarray:
    """Return the weights (*x.shape, node) of polynomial interpolation from `chebyshev_points(n)` to x in [-1, 1].

    Source of the barycentric formula: Berrut & Trefethen, SIAM Review 46, 501, 2004, eq. 4.2.
    """
    nodes, angle = chebyshev_points(n), np.pi * (np.arange(n) + 0.5) / n
    apart = np.asarray(x)[..., None] - nodes
    hit = apart == 0
    weight = (-1.0) ** np.arange(n) * np.sin(angle) / np.where(hit, 1, apart)
    weight = np.where(hit.any(-1, keepdims=True), hit, weight)
    found: np.ndarray = weight / weight.sum(-1, keepdims=True)
    return found
