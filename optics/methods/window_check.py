"""The error of a PSF that was computed from few samples of the pupil.

The PSF is a sum over these samples. The check compares it with a sum over other samples, in a few rows and columns of
the window. The other samples are finer, and the soft edge of their aperture is sharper. Their grid is shifted by a
fraction of the pitch that is not a simple ratio. The comparison therefore shows the errors due to aliased light, to
detail between the samples, and to the soft edge.

The slow factor is the factor by which the diffraction kernel differs from a Fourier kernel. The PSF is computed by
interpolation of this factor over the window, and the check interpolates the factor over the pupil instead. The
comparison therefore also shows the error of the interpolation over the window. An error that both sums share does not
appear in the comparison. Both use the slow factor, so the check also compares this factor with the diffraction kernel
itself, for a few rays. The interpolation over the pupil has an error, too. The number of interpolation points is chosen
so that this error is below half the tolerance. If it is larger, it is added to the estimated error of the PSF.
"""

from __future__ import annotations

from bisect import bisect
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.methods.axis_kernel import AxisRows, axis_factor
from optics.methods.diffraction_kernel import diffraction_kernel
from optics.methods.remaining_factor import RemainingFactor
from optics.methods.sine_stack import SineStack
from optics.methods.slow_factor import Path
from optics.methods.window_crossings import WindowCrossings
from optics.methods.window_sums import intensity_of
from optics.numerics.array_library import beside, library, turned
from optics.numerics.autodiff import Array
from optics.numerics.grid import sample_positions
from optics.numerics.interpolation import chebyshev_points, lagrange_basis

__all__ = ["window_errors"]

CAUTION = 3.5  # choice: safety factor on the estimated error; see test_window_sampling.py
UNSEEN = 0.05  # choice: error that both sums may share, relative to the tolerance
ROUNDING = {dtype: float(np.finfo(dtype).eps) for dtype in ("float32", "float64")}
INTERPOLATED = 0.5  # choice: largest error of the interpolated kernel of the check, relative to the tolerance
# Choices: numbers of interpolation points across the pupil, and phases [rad] from which on each is too small.
ORDERS, PHASES = (2, 3, 4, 5, 7, 9, 12, 16), (0.02, 0.3, 0.8, 1.2, 1.8, 3.0, 6.0)


def window_errors(samples: SineStack, path: Path, field: Array, crossings: WindowCrossings, tolerance: float) -> Array:
    """Return the relative L2 errors of intensities over a window, estimated at crossings of rows and columns, (stack,).

    The intensities at the crossings are compared with those from a second sum over other, finer samples of the pupils.
    The result is NaN for a window without light. It is an array of NumPy or PyTorch like `field`, on the same device.

    samples: the finer samples. If they are the same for all PSFs, the first axis of their arrays has the length 1.
    path: wavelengths, distances and window.
    field: contribution of each of the finer samples to the field at the middle of the window, (stack, y, x), an array
        of NumPy or PyTorch; see `SineStack.arriving`.
    crossings: the rows and columns, and the intensities to be checked where they cross.
    tolerance: tolerance of the PSFs.
    """
    own, dtype = library(field), str(field.real.dtype).removeprefix("torch.")
    key = "check", path.key, dtype, float(tolerance)
    check: _CheckSums = samples.known.get(key, lambda: _CheckSums(samples, path, dtype, INTERPOLATED * tolerance))
    exact, total = check.intensity(field, crossings.rows, crossings.columns), crossings.total
    squares = own.stack([own.square(crossings.images - exact), own.square(exact)]) / crossings.chance
    squared, bright = squares.reshape(2, len(exact), -1).mean(2)
    # choice: with an error above a tenth, the PSF may be too bright, so the error is relative to the darker of the two
    bright = own.minimum(total, bright)
    total = own.where(total > 0, own.where(squared > 0.01 * total, bright, total), np.nan)
    rounding = ROUNDING[dtype]
    # Below the goal of the interpolation, the difference may be its own error, which both sums do not share.
    unlike = beside(field, np.where(check.apart > INTERPOLATED * tolerance, check.apart, 0))
    return CAUTION * (own.sqrt(squared / total) + unlike) + UNSEEN * tolerance + rounding


@dataclass(frozen=True, eq=False)
class _CheckSums:
    """Sums over samples of pupils. The sums yield the field U where some rows and columns of a window cross.

    Parts that do not depend on the light are cached. The slow factor is the factor by which the diffraction kernel
    differs from a Fourier kernel, divided by its value at the middle of the window. A_u and A_v are the values of the
    slow factor along the axes x and y of the window. The quotient G of the slow factor and A_u A_v is interpolated from
    a few points (ξ_a, η_b) of the pupil with the weights L_a and L_b:

        U(u, v) = Σ_ba G(ξ_a, η_b; u, v) Σ_ηξ L_b A_v e^{-ik v t} P L_a A_u e^{-ik u s}.

    P is the contribution of a sample of the pupil to the field at the middle of the window. (s, t) are the x and y
    components of the unit vector from this middle to the sample, minus those of the unit vector to the pupil's centre.
    (u, v) is a position relative to the middle of the window, and k the wave number.

    samples: samples of the pupils.
    path: wavelengths, distances and window.
    dtype: type of real and imaginary parts, "float32" or "float64".
    most: error of the interpolation below which the number of interpolation points is sufficient.
    """

    samples: SineStack
    path: Path
    dtype: str
    most: float

    def intensity(self, field: Array, rows: np.ndarray, columns: np.ndarray) -> Array:
        """Return the intensity |U|² where rows and columns of the window cross, (stack, row, column).

        field: contribution of each sample of the pupil to the middle of the window, (stack, y, x). The result is an
            array of the same library, NumPy or PyTorch.
        rows, columns: indices of the rows (stack, row) and of the columns (stack, column).
        """
        count = len(self._weight)
        across, down = (
            beside(field, (kernel[:, :, None, :] * self._weight).reshape(len(rows), -1, kernel.shape[2]))
            for kernel in self._rows(columns, rows)
        )
        sums = down @ field @ across.swapaxes(1, 2)
        split = sums.reshape(len(rows), rows.shape[1], count, columns.shape[1], count)
        ratio = beside(field, self._ratio(rows, columns))
        return intensity_of(library(field).einsum("nbavu,nvbua->nvu", ratio, split))

    @property
    def apart(self) -> np.ndarray:
        """Largest interpolation error of G, a slowly varying factor of the diffraction kernel (see `_CheckSums`).

        G is interpolated over the pupil. The error is evaluated in the corners of the window (see `_interpolation`).
        The shape is (stack,).
        """
        return self._interpolation[1]

    @cached_property
    def _interpolation(self) -> tuple[np.ndarray, np.ndarray, RemainingFactor]:
        """Interpolation points in the pupil, errors of the interpolation, and values of the interpolated factor G.

        G is a slowly varying factor of the diffraction kernel (see `_CheckSums`). The first result contains the sines
        of the interpolation points along an axis, (pupil, point). A sine is a component of the unit vector from the
        window's centre to a point, minus the same component of the unit vector to the pupil's centre. The second result
        contains the errors of the interpolation, see `apart`. The third is G for all pairs of these sines, as a
        `RemainingFactor`.

        Increasing numbers of points are tried. For each, the interpolated G is compared with the value that follows
        from the diffraction kernel itself, for rays from the middle and from the rim of the pupil to the corners of the
        window. The number that is tried first depends on the largest phase of G on these rays, and is usually
        sufficient.
        """
        samples, (left, top) = self.samples, ([0, 1, 0, 1], [0, 0, 1, 1])
        angle, radius = 2 * np.pi * np.arange(12) / 12, samples.outermost[:, None] * np.array([0, *[1] * 12])
        rim = samples.directions(radius * np.cos([0, *angle]), radius * np.sin([0, *angle]))
        u, v = (at[[0, -1]] for at in self._places)
        corners = u[None, left, None], v[None, top, None]
        exact = _remaining(self.path, samples, (rim[0][:, None], rim[1][:, None]), corners)
        phase = float(np.abs(np.angle(exact)).max())
        side = samples.at[:, [0, -1]]
        middle, half = side.mean(axis=1)[:, None], np.diff(side) / 2
        for order in ORDERS[bisect(PHASES, phase) :]:
            nodes = middle + half * chebyshev_points(order)
            weight = [lagrange_basis((part - middle) / half, chebyshev_points(order)) for part in rim]
            directions = nodes[:, None, :, None, None], nodes[:, :, None, None, None]
            factor = RemainingFactor(self.path, samples, directions, self.dtype)
            found = factor.at((u[None, None, None, None, :], v[None, None, None, :, None]))
            outer = np.einsum("nbac,bnk,ank->nck", found[..., top, left], weight[1], weight[0])
            apart = np.abs(outer - exact).max(axis=(1, 2))
            if apart.max() < self.most:
                break
        return nodes, apart, factor

    @cached_property
    def _places(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions of all columns and rows [m], relative to the middle of the window."""
        height, width = self.path.window.shape
        return sample_positions(width, self.path.window.dx), sample_positions(height, self.path.window.dx)

    @cached_property
    def _weight(self) -> np.ndarray:
        """Weights that interpolate a function along an axis of the pupil, (interpolation point, sample).

        The value at a sample is the sum over the interpolation points of weight times value. The weights are the same
        for all pupils, because interpolation points and samples differ only in scale from pupil to pupil.
        """
        return lagrange_basis(self.samples.at[0], self._interpolation[0][0]).astype(self.dtype)

    def _rows(self, columns: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the diffraction kernels along x, for columns of the window, and along y, for rows.

        They are A_u e^{-ik u s} and A_v e^{-ik v t}. The exponentials are Fourier kernels for the position (u, v) in
        the window and the sines (s, t) of a sample, and A_u and A_v are slowly varying factors (see `_CheckSums`). The
        shape of each is (stack, column or row, sample).

        columns, rows: indices, (stack, column) and (stack, row).
        """
        across, down = self._kernels
        if across is not down:
            return across.at(columns), down.at(rows)
        both = across.at(np.concatenate([columns, rows], axis=1))
        return both[:, : columns.shape[1]], both[:, columns.shape[1] :]

    @cached_property
    def _kernels(self) -> tuple[AxisRows, AxisRows]:
        """Diffraction kernels along x and along y, whose rows are computed when they are needed.

        Both are the same if the window is square and its centre has equal x and y.
        """
        (height, width), (x, y) = self.path.window.shape, self.path.window.centre
        across = AxisRows(self.path, self.samples, 0, self.dtype)
        same = height == width and x == y
        return across, across if same else AxisRows(self.path, self.samples, 1, self.dtype)

    @cached_property
    def _along(self) -> tuple[np.ndarray, np.ndarray]:
        """Slow factor on the x axis of the window, at all columns, and on the y axis, at all rows.

        The slow factor is the factor by which the diffraction kernel differs from a Fourier kernel (A_u and A_v in
        `_CheckSums`). The values are for the interpolation points of a single pupil. The first axis of both arrays
        distinguishes the amplitude (0) and the phase [waves] (1). The shapes are (part, 1, interpolation point along x,
        1, column) and (part, interpolation point along y, 1, 1, row).
        """
        factor, (u, v) = self._interpolation[2], self._places
        across = factor.along[0].at(factor.rounded(u[None, None, None, None, :]))
        down = factor.along[1].at(factor.rounded(v[None, None, None, :, None]))
        return np.stack(across)[:, 0], np.stack(down)[:, 0].swapaxes(-1, -2)

    def _ratio(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return G for light from the interpolation points of the pupil to the crossings of rows and columns.

        G is a slowly varying factor of the diffraction kernel (see `_CheckSums`). The shape is
        (stack, interpolation point along y, interpolation point along x, row, column).

        rows, columns: indices of rows and columns of the window, (stack, row) and (stack, column).
        """
        factor, (x, y) = self._interpolation[2], self._places
        u, v = factor.rounded(x[columns][:, None, None, None, :]), factor.rounded(y[rows][:, None, None, :, None])
        if len(self.samples.at) > 1:
            return factor.at((u, v))
        places = zip(self._along, (columns, rows), strict=True)
        across, down = (part[..., at].transpose(0, 4, 1, 2, 3, 5) for part, at in places)
        return factor.divided((u, v), [across, down.swapaxes(-1, -2)])


def _remaining(
    path: Path,
    samples: SineStack,
    directions: tuple[np.ndarray, np.ndarray],
    place: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """Return the quotient of the diffraction kernel and factors that are computed elsewhere, as a complex array.

    The factors are the kernel's value at the middle of the window, the Fourier kernel, and two axis factors. The slow
    factor is the factor by which the kernel differs from a Fourier kernel. The axis factors are the values of the slow
    factor on the x and y axes of the window. `RemainingFactor` computes the same quotient from a formula for the slow
    factor.

    directions: x and y components (s, t) of the difference of two unit vectors, which point from the window's centre to
        a point of a pupil and to the pupil's centre.
    place: positions (u, v) [m] relative to the middle of the window. All arrays are broadcast.
    """
    (s, t), (u, v) = directions, place
    wavelength, distance = path.numbers(s.ndim)
    x, y = path.window.centre
    points = samples.points_at(s, t)
    size, waves = diffraction_kernel(wavelength, distance, points, (u + x, v + y))
    middle = diffraction_kernel(wavelength, distance, points, (x, y))
    found = turned(size / middle[0], waves - middle[1] + (u * s + v * t) / wavelength, "float64")
    for axis in (0, 1):
        found /= axis_factor(path, samples, axis, directions[axis], place[axis])
    return found
