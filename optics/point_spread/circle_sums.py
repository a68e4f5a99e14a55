"""Sums over samples within circles about one centre, computed for all circles at once.

A weighted sum over samples equals an integral if the weights contain no frequencies that alias onto those of the
intensity. The weights for a circle of radius R are therefore the circle's indicator function, convolved with a kernel.
The kernel's radial spectrum G is 1 at the intensity's frequencies, and 0 at frequencies that alias onto them. At the
distance ρ from the centre, the weight is

    w(ρ, R) = 2π R ∫ G(f) J₁(2πRf) J₀(2πρf) df

Weights are even in ρ and in R. They contain no frequencies above a limit, because G is 0 there. They are therefore
interpolated between evenly spaced distances and radii. Lengths are in units of 1/cutoff, frequencies in units of the
cutoff.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.apertures.soft_edge import SoftEdge
from optics.numerics.autodiff import Array
from optics.numerics.interpolation import LAGRANGE_8, TAPS, lagrange_weights
from optics.numerics.precision import padded_for_packets, precision
from optics.numerics.quadrature import gauss_legendre, gauss_legendre_count

__all__ = ["SoftCircles", "soft_sums", "sums_of_cells"]

PART = 0.1  # choice: error of interpolation and quadrature, in units of the kernel's ripple


@dataclass(frozen=True, eq=False)
class SoftCircles:
    """The sums Σ_j v_j w(ρ_j, R) over samples v for every radius R, as a product of matrices.

    w(ρ, R) is the weight of a sample at the distance ρ from the centre for a circle of radius R. J₀ and J₁ are Bessel's
    functions.

    near: indices of the samples that contribute to at least one circle.
    samples: sparse matrix that interpolates from evenly spaced distances to those of these samples (sample, distance).
    to_spectrum: J₀ (distance, frequency).
    from_spectrum: J₁ with the weights of the quadrature (frequency, radius).
    radii: sparse matrix that interpolates from evenly spaced radii to the requested radii (requested, radius).
    size: number of all samples.
    """

    near: np.ndarray
    samples: Any
    to_spectrum: np.ndarray
    from_spectrum: np.ndarray
    radii: Any
    size: int

    @classmethod
    def around(cls, distance: np.ndarray, radii: np.ndarray, kernel: SoftEdge) -> SoftCircles:
        """Return the matrices for weighted sums over samples within circles about one centre.

        Distances and radii are in units of 1/cutoff, where the cutoff is the highest frequency of the intensity that is
        summed.

        distance: distance of each sample from the centre, (sample,).
        radii: radius of each circle, (radius,).
        kernel: kernel that softens the edges of the circles.
        """
        from scipy.special import j0, j1

        error, end = PART * kernel.ripple, kernel.stopband
        step = (error / LAGRANGE_8) ** (1 / TAPS) / (2 * math.pi * end)
        near = np.flatnonzero(distance < radii.max() + kernel.reach)
        samples, at = _between(distance[near], step)
        circles, wide = _between(radii, step)
        cycles = end * (float(at.max(initial=0.0)) + float(wide.max()))
        node, weight = gauss_legendre(gauss_legendre_count(cycles, -math.log10(error)))
        f = end * node
        passed = 2 * math.pi * end * weight * _spectrum(kernel, f)
        back = passed[:, None] * wide * j1(2 * math.pi * np.multiply.outer(f, wide))
        return cls(near, samples, j0(2 * math.pi * np.multiply.outer(at, f)), back, circles, distance.size)

    def evaluate(self, values: np.ndarray) -> np.ndarray:
        """Return the sum Σ_j v_j w(ρ_j, R) over samples for each circle, (row, radius).

        w(ρ_j, R) is the weight of sample j, at the distance ρ_j from the centre, for the circle of radius R.

        values: values v_j at the samples, (row, sample).
        """
        spectrum = (self.samples.T @ values[:, self.near].T).T @ self.to_spectrum
        return np.asarray((self.radii @ (spectrum @ self.from_spectrum).T).T)

    def transposed(self, sums: np.ndarray) -> np.ndarray:
        """Return Σ_R u_R w(ρ_j, R) for every sample j, the transpose of `evaluate`, (row, sample).

        w(ρ_j, R) is the weight of sample j, at the distance ρ_j from the centre, in the sum for the circle of radius R.

        sums: values u_R, one for each circle, (row, radius).
        """
        spectrum = (self.radii.T @ sums.T).T @ self.from_spectrum.T
        found = np.zeros((len(sums), self.size))
        found[:, self.near] = (self.samples @ (spectrum @ self.to_spectrum.T).T).T
        return found


def soft_sums(circles: SoftCircles, values: Array) -> Array:
    """Return the result of `circles.evaluate`, with derivatives, as a flat Dr.Jit array (row, radius).

    It is the weighted sum over samples within each circle.

    values: flat Dr.Jit Float64 array (row, sample).
    """
    import drjit as dr

    types = precision("float64")

    class SoftSums(dr.CustomOp):
        """`SoftCircles.evaluate`, the weighted sums over samples within circles, as a differentiable operation."""

        def eval(self, values: Array) -> Array:
            return types.Float(padded_for_packets(circles.evaluate(values.numpy().reshape(-1, circles.size))))

        def forward(self) -> None:
            self.set_grad_out(self.eval(self.grad_in("values")))

        def backward(self) -> None:
            given: Any = self.grad_out()
            grad = given.numpy().reshape(-1, circles.radii.shape[0])
            self.set_grad_in("values", types.Float(padded_for_packets(circles.transposed(grad))))

    return dr.custom(SoftSums, values)


def sums_of_cells(values: Array, distance: np.ndarray, radii: np.ndarray, dx: float) -> Array:
    """Return sums of values within circles, flat (row, radius), with derivatives.

    The values are means over square cells with the side dx. A cell at the distance ρ has the weight (R - ρ)/dx + 1/2,
    limited to [0, 1]. All weights are 0 for R = 0. The sum of the weighted values v is the difference of the function
    t ↦ Σ v max(t - ρ, 0)/dx between t = R + dx/2 and t = R - dx/2. This function follows from the sums of v and of vρ
    over all cells nearer than t.

    values: flat Dr.Jit Float64 array (row, sample).
    distance: distance ρ [m] of each sample from the centre, (sample,).
    radii: radii R [m] of the circles, (radius,).
    """
    import drjit as dr

    types, order = precision("float64"), np.argsort(distance, kind="stable")
    sorted_ = distance[order]
    ends = np.concatenate([radii + dx / 2, radii - dx / 2])
    count = np.searchsorted(sorted_, ends)
    last, within = types.Index(np.maximum(count - 1, 0).astype(np.uint32)), types.Float((count > 0) / dx)
    index, far = types.Index(padded_for_packets(order.astype(np.uint32))), types.Float(padded_for_packets(sorted_))
    outer = dr.arange(types.Index, radii.size)
    parts = []
    for row in range(len(values) // distance.size):
        own = dr.gather(types.Float, values, index + row * distance.size)
        total, moment = (dr.gather(types.Float, dr.cumsum(part), last) for part in (own, own * far))
        ramp = (types.Float(ends) * total - moment) * within
        found = dr.gather(types.Float, ramp, outer) - dr.gather(types.Float, ramp, outer + radii.size)
        parts.append(found * types.Float((radii > 0).astype(np.float64)))
    return parts[0] if len(parts) == 1 else dr.concat(parts)


def _between(places: np.ndarray, step: float) -> tuple[Any, np.ndarray]:
    """Return the sparse matrix that interpolates even functions at `places` >= 0, and the nodes of the interpolation.

    The nodes are multiples of `step`. Because the functions are even, values at positive nodes replace those at
    negative ones.
    """
    from scipy.sparse import csr_array

    cell = np.floor(places / step)
    weights = np.stack(lagrange_weights(places / step - cell, TAPS), axis=1)
    read = np.abs(cell[:, None].astype(np.int64) + np.arange(TAPS) - (TAPS // 2 - 1))
    used = np.zeros(int(read.max(initial=0)) + 1, dtype=bool)
    used[read.ravel()] = True
    column = np.cumsum(used) - 1
    rows = np.arange(len(places) + 1) * TAPS
    matrix = csr_array((weights.ravel(), column[read].ravel(), rows), shape=(len(places), int(used.sum())))
    return matrix, step * np.flatnonzero(used)


def _spectrum(kernel: SoftEdge, f: np.ndarray) -> np.ndarray:
    """Return the radial spectrum of the kernel, ∫ ring(r) J₀(2πfr) dr.

    ring(r) is 2πr times the kernel at the radius r: the integral of the kernel along the circle of this radius.
    """
    from scipy.special import j0

    node, weight = gauss_legendre(int(24 + 4 * kernel.cycles + 2 * kernel.beta))
    r = kernel.reach * node
    ring = kernel.reach * weight * kernel.ring(r)
    return np.asarray(j0(2 * math.pi * np.multiply.outer(f, r)) @ ring)
