"""Contrast as a function of spatial frequency, on a grid and at any other frequency.

If the PSF carries derivatives, contrasts are Dr.Jit arrays that carry derivatives. Otherwise they are NumPy arrays.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.numerics.accuracy import AccuracyError
from optics.numerics.arguments import reals, shown, whole
from optics.numerics.autodiff import Array, plain, to_user
from optics.numerics.field import Field
from optics.numerics.fourier import dft2
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.numerics.read_only import ReadOnlyArrays, read_only
from optics.numerics.scattered_sum import ScatteredSum, sums_at
from optics.point_spread.mixture import flat

__all__ = ["MTF"]

# Choice: initial number of orientations in the mean of a profile. Half a turn is sufficient, because contrasts at f and
# -f are equal.
ORIENTATIONS = 16
MOST_ORIENTATIONS = 1024
# Choice: fraction of the predicted error within which means over even and odd orientations must agree.
PART = 0.1
FINEST = 1e-5  # choice: a smaller difference between the two means is always accepted
DIGITS = 7.0  # choice: digits of sums over the PSF
AT_A_TIME = 2**17  # choice: frequencies that are summed at once; with 64 cells each, they take some hundred megabytes


@dataclass(frozen=True, eq=False)
class MTF(ReadOnlyArrays):
    """Modulation transfer function on a square grid of spatial frequencies, zero frequency at n//2.

    tensor: contrast as a Dr.Jit tensor (wavelength, fy, fx), which is 1 at zero frequency. `mtf` is the same as a NumPy
        array.
    fx, fy: frequencies of the grid [cycles per metre on the sensor]. Their pitch is 1 / (longest side of the window).
    cutoff: highest frequency [1/m] that a pupil of this size transmits, 2 sin θ / λ, (wavelength,).
    predicted_error: predicted error of any contrast, at the grid's frequencies and between them, (wavelength,).
    shares: fraction of all arriving light in each sample of the PSF, as a Dr.Jit tensor (wavelength, y, x).
    centre: position (x, y) [m] of sample n//2 of the PSF.
    """

    tensor: Array
    fx: np.ndarray
    fy: np.ndarray
    cutoff: np.ndarray
    predicted_error: np.ndarray
    shares: Array
    centre: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def from_shares(cls, shares: Array, window: Grid, cutoff: np.ndarray, error: np.ndarray) -> MTF:
        """Return the MTF of samples on a window of the sensor."""
        import drjit as dr

        types, side = precision("float64"), max(window.shape)
        at_zero = dr.arange(types.Index, side * side) == (side // 2) * side + side // 2
        planes = [
            dr.select(at_zero, 1, dr.sqrt(dr.maximum(otf.intensity, 1e-300))) for otf in _transforms(shares, window.dx)
        ]
        tensor = types.Tensor(planes[0] if len(planes) == 1 else dr.concat(planes), (len(planes), side, side))
        f = Grid.square(side, 1 / (side * window.dx)).x
        return cls(tensor, f, f, cutoff, error, shares, window.centre)

    def __repr__(self) -> str:
        planes = f"{self.tensor.shape[0]} wavelengths or types, to {self.fx[-1]:.3g} cycles per metre"
        return f"<MTF of {planes}, predicted error {self.predicted_error.max():.1e}>"

    @cached_property
    def mtf(self) -> np.ndarray:
        return read_only(np.asarray(self.tensor.numpy()))

    @cached_property
    def phase(self) -> np.ndarray:
        """Phase of the optical transfer function ∫ PSF(x, y) exp(-2πi (fx x + fy y)) dx dy [rad], from -π to π.

        It has the shape of `mtf`, without derivatives. An image at the position (x, y) on the sensor has the phase -2π
        (fx x + fy y). A phase of π is a reversal of contrast. Where the contrast is c, an error e of the contrasts
        changes the phase by at most about e/c.
        """
        turns = np.add.outer(self.fy * self.centre[1], self.fx * self.centre[0])
        there = np.exp(-2j * np.pi * turns)
        planes = [otf.numpy() * there for otf in _transforms(self.shares, self._dx)]
        return read_only(np.angle(np.stack(planes)))

    @property
    def _dx(self) -> float:
        """Pitch of the PSF's samples [m]; 1 for a single sample, whose only frequency is 0."""
        return 1 / (self.fx.size * float(self.fx[1] - self.fx[0])) if self.fx.size > 1 else 1.0

    def first(self, count: int) -> MTF:
        """Return the MTF of the first `count` wavelengths.

        Raises:
            ValueError: there are fewer wavelengths, or count is not a whole number.
        """
        count = whole("count", count, 1, self.tensor.shape[0])
        tensor, shares = (_first(part, count) for part in (self.tensor, self.shares))
        return MTF(tensor, self.fx, self.fy, self.cutoff[:count], self.predicted_error[:count], shares, self.centre)

    def profile(self, frequencies: np.ndarray) -> np.ndarray | Array:
        """Return the mean over all orientations at radial `frequencies` [1/m], (wavelength, frequency).

        The frequencies need not lie on the grid. Beyond the Nyquist frequency of the PSF's samples (half a cycle per
        sample), contrasts are 0.

        Raises:
            ValueError: the PSF has a single sample, or the frequencies are invalid.
            AccuracyError: contrasts change so fast with orientation that the error of a mean over 1024 orientations may
                exceed the predicted error.
        """
        if self.fx.size < 2:
            raise ValueError("the PSF has one sample and therefore only the frequency 0: must be at least 2 x 2")
        f = np.atleast_1d(reals("frequencies", frequencies)).ravel()
        if f.size == 0 or not np.isfinite(f).all():
            raise ValueError(f"frequencies = {shown(frequencies)}: must be finite, and at least one")
        found, n = self._mean(f, ORIENTATIONS, 0.0), ORIENTATIONS
        allowed = np.maximum(self.predicted_error, FINEST)[:, None]
        while n < MOST_ORIENTATIONS:
            between = self._mean(f, n, 0.5)
            unsure = float((np.abs(plain(found) - plain(between)) / 2 / allowed).max(initial=0))
            found, n = (found + between) / 2, 2 * n
            if unsure <= PART:
                return to_user(found)
        if unsure > 1:
            raise AccuracyError(
                f"frequencies: a mean over {n} orientations has {unsure:.2g} times the predicted error", "see `mtf`"
            )
        return to_user(found)

    def _mean(self, f: np.ndarray, n: int, shift: float) -> Array:
        """Return the mean over n orientations within half a turn, (wavelength, frequency).

        shift: angle of the first orientation, in steps between orientations.
        """
        import drjit as dr

        types, waves = precision("float64"), self.shares.shape[0]
        some, angle = max(1, AT_A_TIME // f.size), np.pi * (np.arange(n) + shift) / n
        parts = [self._sum(f, angle[start : start + some]) for start in range(0, n, some)]
        mean = sum(parts[1:], parts[0]) / n
        return types.Tensor(dr.select(types.Float(np.tile(f == 0, waves)) > 0, 1, mean), (waves, f.size))

    def _sum(self, f: np.ndarray, angle: np.ndarray) -> Array:
        """Return the sum of contrasts over the directions `angle`, flat (wavelength, frequency)."""
        import drjit as dr

        types, waves = precision("float64"), self.shares.shape[0]
        turns = np.array([np.outer(f, part).ravel() * self._dx for part in (np.cos(angle), np.sin(angle))])
        told = (np.abs(turns) <= 0.5 * (1 + 1e-9)).all(axis=0)
        p, q = np.where(told, turns, 0)
        sums = ScatteredSum(p, q, self.shares.shape[1:], DIGITS)
        re, im = sums_at(sums, types.Float(flat(self.shares)))
        contrast = dr.sqrt(dr.maximum(re * re + im * im, 1e-300)) * types.Float(np.tile(told, waves))
        return dr.block_reduce(dr.ReduceOp.Add, contrast, angle.size)


def _transforms(shares: Array, dx: float) -> Iterator[Field]:
    """Yield the transform of the samples at each wavelength; the origin is sample n//2."""
    import drjit as dr

    types, (waves, height, width) = precision("float64"), shares.shape
    side, cells = max(height, width), dr.arange(types.Index, height * width)
    nothing = dr.zeros(types.Float, height * width)
    for index in range(waves):
        plane = dr.gather(types.Float, shares.array, cells + index * height * width)
        field = Field(plane, nothing, Grid((height, width), dx), types)
        yield dft2(field, side, (side, side), -1, 1 / (side * dx))


def _first(tensor: Array, count: int) -> Array:
    import drjit as dr

    types, (_, height, width) = precision("float64"), tensor.shape
    kept = dr.gather(types.Float, tensor.array, dr.arange(types.Index, count * height * width))
    return types.Tensor(kept, (count, height, width))
