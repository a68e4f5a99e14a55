"""Grids for propagation by the angular spectrum, and the Fourier sums that transform a field from one grid to another.

There are grids of the spectrum, of the window, and of the relay plane. The relay plane is an intermediate plane of the
split method, which propagates light to the window in two steps (see `angular_spectrum`).
"""

from __future__ import annotations

import math
from functools import cached_property
from itertools import pairwise

from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.methods.row_blocks import with_rows_moved
from optics.methods.spectral_taper import Taper
from optics.numerics.autodiff import Scalar
from optics.numerics.cost import ITEM_BYTES
from optics.numerics.even_fields import even_seconds, even_sum, quarter
from optics.numerics.field import Field
from optics.numerics.fourier import dft2, predicted_bytes, predicted_seconds
from optics.numerics.grid import Grid
from optics.numerics.precision import opaque, precision

__all__ = ["SpectrumSampling"]


class SpectrumSampling:
    """Grid of the spectrum of the light behind a pupil, and grids of the fields that are computed from the spectrum.

    method: "angular_spectrum" or "split_angular_spectrum".
    taper: taper that fades the spectrum out.
    period: width [m] after which the field in the pupil's plane repeats. The spectrum's samples are 1/period apart.
    output_period: number of samples after which the field in the window's plane repeats. With the split method, number
        of samples after which the field in the `relay` plane repeats.
    even: True if the field is even in x and y. A quarter of the samples of each plane is then sufficient.
    """

    method: str
    taper: Taper
    period: float
    output_period: int
    even: bool = False

    @property
    def is_whole(self) -> bool:
        """True if the spectrum is propagated to the window in one step.

        False for the split method, which propagates the spectrum to an intermediate plane first, without the paraxial
        part of the phase. Fresnel's integral from there to the window adds this part.
        """
        return self.method == "angular_spectrum"

    @cached_property
    def spectrum(self) -> Grid:
        """Grid of the spatial frequencies [1/m]."""
        return Grid.square(2 * math.ceil(self.taper.end * self.period) + 1, 1 / self.period)

    @cached_property
    def relay(self) -> Grid:
        """Grid [m] of the relay plane of the split method.

        The split method first propagates the spectrum to this plane, without the paraxial part of the phase. Fresnel's
        integral from this plane to the window adds this part.
        """
        return Grid.square(self.output_period, self.period / self.output_period)

    def part(self, grid: Grid) -> Grid:
        """Return the part of a grid that is stored: a quarter if the field is even in x and y, else the whole grid."""
        return quarter(grid) if self.even else grid

    def sum(self, field: Field, start: Grid, period: Scalar, end: Grid, sign: int, first: int = 0) -> Field:
        """Return the Fourier sum of a field on one grid, computed at the samples of another grid; see `fourier.dft2`.

        start: grid of the field.
        period: number of samples of the result after which it repeats.
        end: grid of the result.
        sign: sign of the exponent.
        first: index of the field's first row in `start`, if the field contains only some rows of this grid.
        """
        if self.even:
            return even_sum(field, start.shape, period, end, first)
        found = dft2(field, period, end.shape, sign, end.dx, end.centre)
        return with_rows_moved(found, first + field.grid.shape[0] // 2 - start.shape[0] // 2, period, sign)

    def sum_seconds(self, start: Grid, period: float, end: Grid) -> float:
        return even_seconds(start.shape, end.shape) if self.even else predicted_seconds(start.shape, period, end.shape)

    def sum_bytes(self, start: Grid, end: Grid, dtype: str) -> float:
        """Return the predicted memory [bytes] of the Fourier sum that transforms a field from one grid to another.

        start, end: grids before and after the sum.
        """
        return predicted_bytes(start.shape, end.shape, ITEM_BYTES[dtype])

    def bytes_from_spectrum(self, window: Grid, dtype: str) -> float:
        """Return the predicted memory [bytes] of the transforms from the spectrum to the window."""
        planes = [self.spectrum, window] if self.is_whole else [self.spectrum, self.relay, window]
        stored = [self.part(plane) for plane in planes]
        return max(self.sum_bytes(*pair, dtype) for pair in pairwise(stored))

    def seconds_from_spectrum(self, window: Grid) -> float:
        """Return the predicted time [s] of the transforms from the spectrum to the window."""
        if self.is_whole:
            return self.sum_seconds(self.spectrum, self.output_period, window)
        to_relay = self.sum_seconds(self.spectrum, self.output_period, self.relay)
        # This period is not a whole number, so `dft2` uses a matrix.
        return to_relay + self.sum_seconds(self.relay, 0.5, window)

    def whole_phase(self, field: Field, beam: Beam, problem: Problem) -> Field:
        """Return a field over the window with its complete phase.

        The split method propagates light to a relay plane, and from there to the window by Fresnel's integral. A field
        that was computed in this way lacks the factor e^{iπr²/λz}/i, because the intensity does not depend on it. The
        field is multiplied by this factor here. r is the distance from the axis in the window, and z is the distance of
        the window from the pupil.

        field: result of `arrived`.
        """
        if self.is_whole:
            return field
        types = precision(problem.dtype)
        x, y = problem.window.coordinates(types)
        waves = (x * x + y * y) * (0.5 / opaque(types, problem.wavelength)) / opaque(types, beam.distance) - 0.25
        return field * Field.from_waves(1.0, waves, problem.window, types)

    def plane(self, problem: Problem) -> float:
        """Return the width [m] of the square over which rounding errors are spread, see `Sampling.plane`.

        Rounding errors are assumed to be spread evenly over the square. The square lies in the plane of the window. The
        field in this plane is a Fourier sum, so it repeats periodically. The width of the square is one period.
        """
        return self.period if self.is_whole else problem.wavelength * problem.distance / self.relay.dx
