"""Contrast as a function of spatial frequency, on a grid and at any other frequency.

If the PSF carries derivatives, `MTF.profile` returns Dr.Jit arrays that carry derivatives. Otherwise it returns NumPy
arrays.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from optics.numerics.accuracy import AccuracyError
from optics.numerics.arguments import flag, reals, shown, whole
from optics.numerics.autodiff import Array, plain, to_user
from optics.numerics.field import Field
from optics.numerics.fourier import dft2
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.numerics.read_only import ReadOnlyArrays, read_only
from optics.numerics.scattered_sum import ScatteredSum, sums_at
from optics.point_spread.mixture import flat
from optics.point_spread.window_loss import ErrorCauses, spectrum_of_loss

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
    cutoff: highest frequency [1/m] that the pupil transmits, 2 sin θ / λ, (wavelength,). λ is the wavelength behind the
        pupil, and θ the angle between the axis and the ray from the pupil's rim to the sensor's centre.
    predicted_error: largest predicted error of a contrast, at the grid's frequencies and between them, (wavelength,).
        Only contrasts at frequencies near 0 have errors of this size, see `errors`.
    shares: fraction of all arriving light in each sample of the PSF, as a Dr.Jit tensor (wavelength, y, x).
    centre: position (x, y) [m] of sample n//2 of the PSF.
    causes: errors due to light outside the window, to the uncertain amount of arriving light, and to the PSF itself,
        which together cause the predicted error. None if they are unknown.
    """

    tensor: Array
    fx: np.ndarray
    fy: np.ndarray
    cutoff: np.ndarray
    predicted_error: np.ndarray
    shares: Array
    centre: tuple[float, float] = (0.0, 0.0)
    causes: ErrorCauses | None = None

    @classmethod
    def from_shares(cls, shares: Array, window: Grid, cutoff: np.ndarray, causes: ErrorCauses) -> MTF:
        """Return the MTF of a PSF.

        shares: fraction of all arriving light in each sample of the PSF, as a Dr.Jit tensor (wavelength, y, x).
        window: the samples of the PSF.
        """
        import drjit as dr

        types, side = precision("float64"), max(window.shape)
        at_zero = dr.arange(types.Index, side * side) == (side // 2) * side + side // 2
        planes = [
            dr.select(at_zero, 1, dr.sqrt(dr.maximum(otf.intensity, 1e-300))) for otf in _transforms(shares, window.dx)
        ]
        tensor = types.Tensor(planes[0] if len(planes) == 1 else dr.concat(planes), (len(planes), side, side))
        f = Grid.square(side, 1 / (side * window.dx)).x
        return cls(tensor, f, f, cutoff, causes.total, shares, window.centre, causes)

    def __repr__(self) -> str:
        planes = f"{self.tensor.shape[0]} wavelengths or types, to {self.fx[-1]:.3g} cycles per metre"
        return f"<MTF of {planes}, predicted error {self.predicted_error.max():.1e}>"

    @cached_property
    def mtf(self) -> np.ndarray:
        """Contrasts, (wavelength, fy, fx), without derivatives."""
        return read_only(np.asarray(self.tensor.numpy()))

    @cached_property
    def phase(self) -> np.ndarray:
        """Phase of the optical transfer function ∫ PSF(x, y) exp(-2πi (fx x + fy y)) dx dy [rad], from -π to π.

        It has the shape of `mtf`, without derivatives. If the PSF is a point at (x, y) on the sensor, the phase is -2π
        (fx x + fy y). A phase of π is a reversal of contrast. Where the contrast is c, an error e of the contrasts
        changes the phase by at most about e/c.
        """
        turns = np.add.outer(self.fy * self.centre[1], self.fx * self.centre[0])
        there = np.exp(-2j * np.pi * turns)
        planes = [otf.numpy() * there for otf in _transforms(self.shares, self._dx)]
        return read_only(np.angle(np.stack(planes)))

    def otf(self, fx: Any, fy: Any) -> np.ndarray:
        """Return the optical transfer function at any frequencies [1/m], (wavelength, frequency), without derivatives.

        Its modulus is the contrast, and its argument the phase (see `phase`). At frequency 0, where contrasts are 1,
        the modulus is the fraction of the arriving light that falls within the window of the PSF.

        fx, fy: components of each frequency along x and y, of equal or broadcastable shapes. They are flattened.

        Raises:
            ValueError: a frequency is not a finite real number, or is beyond the Nyquist frequency of the PSF's
                samples. Shapes do not broadcast.
        """
        f = np.stack([part.ravel() for part in np.broadcast_arrays(reals("fx", fx), reals("fy", fy))])
        nyquist = 0.5 / self._dx
        if not (np.abs(f) <= nyquist * (1 + 1e-9)).all():
            raise ValueError(f"fx, fy: must be finite and at most {nyquist:.4g} per metre, half a cycle per sample")
        shares = np.asarray(self.shares.numpy(), dtype=np.float64)
        waves = [
            np.exp(-2j * np.pi * np.outer(part, (np.arange(n) - n // 2) * self._dx + at))
            for part, n, at in zip(f, shares.shape[:0:-1], self.centre, strict=True)
        ]
        found: np.ndarray = np.einsum("wyx,fx,fy->wf", shares, *waves, optimize=True)
        return found

    @cached_property
    def errors(self) -> np.ndarray:
        """Predicted error of each contrast, in the shape of `mtf`. Most are far smaller than `predicted_error`.

        If a fraction p of all light falls outside the window, contrasts at frequencies near 0 have an error of p, and
        other contrasts a much smaller error, see `optics.point_spread.window_loss`. An uncertainty of the total light
        that arrives changes each contrast in proportion to that contrast.
        """
        if self.causes is None:
            return read_only(np.broadcast_to(self.predicted_error[:, None, None], self.mtf.shape).copy())
        light, rest = (part[:, None, None] for part in (self.causes.light, self.causes.rest))
        images = np.asarray(self.shares.numpy())
        missing = np.stack([spectrum_of_loss(*each) for each in zip(images, self.causes.lost, strict=True)])
        found = missing + light * self.mtf + rest + self._at_nyquist[:, None, None]
        middle = self.fx.size // 2
        found[:, middle, middle] = 0
        return read_only(found)

    @property
    def _at_nyquist(self) -> np.ndarray:
        """Root mean square of the contrasts at the highest frequencies along each axis, (wavelength,).

        Contrasts beyond these frequencies are aliased, and are assumed to be of this size. If the pupil is only about a
        wavelength wide, its contrasts do not end sharply at the cutoff, so they can extend beyond these frequencies.
        """
        rim = np.concatenate([self.mtf[:, 0], self.mtf[:, :, 0]], axis=1)
        found: np.ndarray = np.sqrt(np.mean(np.square(rim), axis=1))
        return found

    @property
    def _dx(self) -> float:
        """Pitch of the PSF's samples [m]; 1 for a single sample, whose only frequency is 0."""
        return 1 / (self.fx.size * float(self.fx[1] - self.fx[0])) if self.fx.size > 1 else 1.0

    def first(self, count: int) -> MTF:
        """Return the MTF of the first `count` wavelengths.

        Raises:
            ValueError: count is not a whole number from 1 to the number of wavelengths.
        """
        count = whole("count", count, 1, self.tensor.shape[0])
        tensor, shares = (_first(part, count) for part in (self.tensor, self.shares))
        causes = None if self.causes is None else self.causes.first(count)
        errors = self.predicted_error[:count]
        return MTF(tensor, self.fx, self.fy, self.cutoff[:count], errors, shares, self.centre, causes)

    def profile(self, frequencies: np.ndarray, with_error: bool = False) -> Any:
        """Return the mean contrast over all orientations at radial `frequencies` [1/m], (wavelength, frequency).

        The frequencies need not lie on the grid. If `frequencies` has several axes, it is flattened. At frequency 0 the
        contrast is 1. Contrasts count as 0 if |fx| or |fy| is beyond the Nyquist frequency of the PSF's samples (half a
        cycle per sample).

        with_error: whether to return (value, predicted error), each (wavelength, frequency).

        Raises:
            ValueError: the PSF has a single sample, there are no frequencies, or one is not a finite real number.
            AccuracyError: contrasts change so fast with orientation that the error of a mean over 1024 orientations may
                exceed the predicted error.
        """
        flag("with_error", with_error)
        if self.fx.size < 2:
            raise ValueError("the PSF has one sample and therefore only the frequency 0: must be at least 2 x 2")
        f = np.atleast_1d(reals("frequencies", frequencies)).ravel()
        if f.size == 0 or not np.isfinite(f).all():
            raise ValueError(f"frequencies = {shown(frequencies)}: must be finite, and at least one")
        found, unsure = self._over_orientations(f)
        return (to_user(found), self._radial_errors(f) + unsure) if with_error else to_user(found)

    def _over_orientations(self, f: np.ndarray) -> tuple[Array, np.ndarray]:
        """Return the mean contrast over all orientations, and its error, (wavelength, frequency).

        Raises:
            AccuracyError: see `profile`.
        """
        found, n = self._mean(f, ORIENTATIONS, 0.0), ORIENTATIONS
        allowed = np.maximum(self.predicted_error, FINEST)[:, None]
        while n < MOST_ORIENTATIONS:
            between = self._mean(f, n, 0.5)
            apart = np.abs(plain(found) - plain(between)) / 2
            unsure = float((apart / allowed).max(initial=0))
            found, n = (found + between) / 2, 2 * n
            if unsure <= PART:
                return found, apart
        if unsure > 1:
            raise AccuracyError(
                f"frequencies: a mean over {n} orientations has {unsure:.2g} times the predicted error", "see `mtf`"
            )
        return found, apart

    def _radial_errors(self, f: np.ndarray) -> np.ndarray:
        """Return the mean of `errors` over the orientations at radial frequencies f, (wavelength, frequency).

        Means over rings of frequencies are interpolated. The width of a ring is the step between frequencies of the
        MTF. Below the smallest positive frequency of the MTF, the result is at least `predicted_error`, except at
        frequency 0, where the result is 0.
        """
        step, side = float(self.fx[1] - self.fx[0]), self.fx.size
        ring = np.rint(np.hypot.outer(self.fy, self.fx) / step).astype(np.intp).ravel()
        count = np.bincount(ring)
        means = np.stack([np.bincount(ring, one.ravel()) for one in self.errors]) / np.maximum(count, 1)
        means[:, :2] = np.maximum(means[:, :2], self.predicted_error[:, None])
        at = np.minimum(np.abs(f) / step, side // 2)
        found = np.stack([np.interp(at, np.arange(count.size), row) for row in means])
        return np.where(f == 0, 0.0, found)

    def _mean(self, f: np.ndarray, n: int, shift: float) -> Array:
        """Return the mean contrast over n orientations within half a turn, (wavelength, frequency).

        shift: angle of the first orientation, divided by the angle between neighbouring orientations.
        """
        import drjit as dr

        types, waves = precision("float64"), self.shares.shape[0]
        some, angle = max(1, AT_A_TIME // f.size), np.pi * (np.arange(n) + shift) / n
        parts = [self._sum(f, angle[start : start + some]) for start in range(0, n, some)]
        mean = sum(parts[1:], parts[0]) / n
        return types.Tensor(dr.select(types.Float(np.tile(f == 0, waves)) > 0, 1, mean), (waves, f.size))

    def _sum(self, f: np.ndarray, angle: np.ndarray) -> Array:
        """Return the sum of contrasts over the directions `angle` [rad], as a flat array.

        The array contains the sums for all frequencies `f` at the first wavelength, then at the next, and so on.
        """
        import drjit as dr

        types, waves = precision("float64"), self.shares.shape[0]
        turns = np.array([np.outer(f, part).ravel() * self._dx for part in (np.cos(angle), np.sin(angle))])
        resolved = (np.abs(turns) <= 0.5 * (1 + 1e-9)).all(axis=0)
        p, q = np.where(resolved, turns, 0)
        sums = ScatteredSum(p, q, self.shares.shape[1:], DIGITS)
        re, im = sums_at(sums, types.Float(flat(self.shares)))
        contrast = dr.sqrt(dr.maximum(re * re + im * im, 1e-300)) * types.Float(np.tile(resolved, waves))
        return dr.block_reduce(dr.ReduceOp.Add, contrast, angle.size)


def _transforms(shares: Array, dx: float) -> Iterator[Field]:
    """Yield the Fourier transform of the PSF's samples at each wavelength, a field (fy, fx).

    Phases refer to the sample with the index n//2 along each axis, where n is the number of samples.
    """
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
