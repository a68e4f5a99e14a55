"""A smooth function of one variable as equidistant samples that Dr.Jit interpolates."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from math import pi

import numpy as np

from optics.numerics.autodiff import Array
from optics.numerics.precision import Precision, opaque

__all__ = ["TAPS", "Interpolant", "chebyshev_points", "lagrange", "lagrange_weights"]

# Samples beyond either end that six-point interpolation reads.
MARGIN = 2


@dataclass(frozen=True, eq=False)
class Interpolant:
    """Samples at first + i step, i = -2 ... n + 1; constant beyond its ends."""

    first: float
    step: float
    samples: np.ndarray

    @classmethod
    def of(
        cls, function: Callable[[np.ndarray], np.ndarray], ends: tuple[float, float], cycles: float, error: float
    ) -> Interpolant:
        """Table of a function that turns through at most `cycles` cycles between the ends, and is constant beyond.

        The function is evaluated at Chebyshev nodes only, because it is dear. Six-point interpolation of a unit wave
        errs by (225/64)/720 (2π/N)⁶ with N samples per cycle; a step's spectrum falls with frequency, so 1/20 of that.
        """
        from scipy.fft import dct

        per_cycle = 2 * pi * (2.4e-4 / error) ** (1 / 6)
        n = int(cycles * per_cycle + 64)
        degree = int(pi * cycles - 3 * np.log10(error) + 12)
        middle, half = (ends[0] + ends[1]) / 2, (ends[1] - ends[0]) / 2
        values = function(middle + half * np.cos(pi * (np.arange(degree) + 0.5) / degree))
        series = np.polynomial.Chebyshev(dct(values) / degree * np.where(np.arange(degree) == 0, 0.5, 1))
        step = 2 / (n - 1)
        samples = series(np.clip(np.arange(-MARGIN, n + MARGIN) * step - 1, -1, 1))
        samples[: MARGIN + 1], samples[-MARGIN - 1 :] = function(np.array(ends))  # exact where it is constant
        return cls(ends[0], step * half, samples)

    def at(self, place: Array, types: Precision) -> Array:
        """Interpolated at a flat Dr.Jit Float64 array; differentiable."""
        import drjit as dr

        last = opaque(types, len(self.samples) - 2 * MARGIN - 1)
        t = dr.clip((place - opaque(types, self.first)) * opaque(types, 1 / self.step), 0, last)
        cell = dr.minimum(dr.floor(t), last - 1)
        samples, first = types.Float64(self.samples), types.Index(cell)
        values = [dr.gather(types.Float64, samples, first + i) for i in range(6)]
        return sum((w * v for w, v in zip(_lagrange6(t - cell), values, strict=True)), types.Float64(0))


def _lagrange6(t: Array) -> list[Array]:
    """Weights of six-point Lagrange interpolation at nodes -2 ... 3, t in [0, 1]."""
    a, b, c, d, e, f = t + 2, t + 1, t, t - 1, t - 2, t - 3
    ab, cd, ef = a * b, c * d, e * f
    return [
        b * cd * ef / -120,
        a * cd * ef / 24,
        ab * d * ef / -12,
        ab * c * ef / 12,
        ab * cd * f / -24,
        ab * cd * e / 120,
    ]


TAPS = 8


def lagrange_weights(t: Array) -> list[Array]:
    """Eight-point Lagrange interpolation at nodes -3 ... 4, t in [0, 1]."""
    steps = [t + (TAPS // 2 - 1 - i) for i in range(TAPS)]
    before, after = [1.0], [1.0]
    for i in range(TAPS - 1):
        before.append(before[-1] * steps[i])
        after.append(after[-1] * steps[TAPS - 1 - i])
    sign = [(-1) ** (TAPS - 1 - i) / (math.factorial(i) * math.factorial(TAPS - 1 - i)) for i in range(TAPS)]
    return [before[i] * after[TAPS - 1 - i] * sign[i] for i in range(TAPS)]


def chebyshev_points(n: int) -> np.ndarray:
    """Chebyshev points of the first kind on [-1, 1]."""
    return np.cos(np.pi * (np.arange(n) + 0.5) / n)


def lagrange(x: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """(node, *x.shape): the Lagrange polynomials of the nodes at x."""
    basis = np.ones((len(nodes), *np.shape(x)))
    for i, node in enumerate(nodes):
        for other in np.delete(nodes, i):
            basis[i] *= (x - other) / (node - other)
    return basis
