"""A plane of a system, sampled for the light that it transmits.

The edge of a pupil's aperture is softened (optics.apertures.aperture), but all frequencies that can reach the next
plane remain exact. The samples of the pupil are dense enough to keep aliases off these frequencies. Sums over samples
then converge spectrally.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from optics.apertures.aperture import EDGE_REACH, LEAST_RIPPLE, SoftAperture
from optics.elements.beam import Beam
from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.methods.problem import SLOPE_MARGIN
from optics.numerics.accuracy import MOST_SAMPLES, AccuracyError
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.propagation.propagate import WRAP_RIPPLE_PER_TOLERANCE, PropagationResult, propagate
from optics.propagation.transfer_function import kept_band, kept_square

__all__ = ["PlaneField", "PupilSampling", "StepSettings", "Stop"]

REACH_MARGIN = 1.02  # choice: factor on the planes' half widths, because `propagate` extends each plane by a sample


@dataclass(frozen=True)
class PlaneField:
    """The field on the samples of a plane. band: highest frequency [1/m] in the field."""

    u: np.ndarray
    dx: float
    band: float

    @property
    def half_width(self) -> float:
        return Grid(self.u.shape, self.dx).half_width

    @property
    def power(self) -> float:
        return float(np.sum(np.abs(self.u) ** 2, dtype=np.float64)) * self.dx**2


@dataclass(frozen=True)
class Stop:
    """A pupil, or the output window, at a distance from the previous stop.

    pupil: None for the output window.
    distance: distance [m] from the previous stop, negative for backward propagation.
    """

    distance: float
    pupil: Pupil | None
    half_width: float


@dataclass(frozen=True)
class StepSettings:
    """Settings that are the same at every plane.

    tolerance: tolerance of each step.
    wavelength: wavelength in vacuum [m].
    """

    wavelength: float
    medium_n: float
    backward: bool
    tolerance: float
    dtype: str

    @property
    def ripple(self) -> float:
        return WRAP_RIPPLE_PER_TOLERANCE * self.tolerance

    @property
    def edge_ripple(self) -> float:
        """Ripple of soft edges. It is not below LEAST_RIPPLE, because of rounding errors."""
        return max(self.ripple, LEAST_RIPPLE)

    def reaching(self, half_widths: float, distance: float) -> float:
        """Return the highest frequency [1/m] that `propagate` does not remove between planes, including its fade.

        The result is infinite if both planes coincide. If they are close, it includes evanescent waves that have not
        yet decayed.

        half_widths: sum of the half widths of the two planes [m].
        """
        z, wavelength = abs(distance), self.wavelength / self.medium_n
        if z == 0:
            return math.inf
        round_, square = (
            kept(REACH_MARGIN * widths, wavelength, z, self.ripple)
            for kept, widths in ((kept_band, math.sqrt(2) * half_widths), (kept_square, half_widths))
        )
        if math.isfinite(round_.kept):
            return max(round_.end, square.diagonal(wavelength) if math.isfinite(square.kept) else 0)
        return math.hypot(1 / wavelength, math.log(1 / self.ripple) / (2 * math.pi * z))

    def carried(self, field: PlaneField, distance: float, window: Grid) -> PropagationResult:
        """Return the field after propagation through free space, on the samples of another plane."""
        return propagate(
            field.u,
            dx=field.dx,
            wavelength=self.wavelength,
            distance=distance,
            out_dx=window.dx,
            out_shape=window.shape,
            medium_n=self.medium_n,
            tolerance=self.tolerance,
            dtype=self.dtype,
        )


@dataclass(frozen=True)
class PupilSampling:
    """Samples of a pupil, its soft aperture, and the highest frequency [1/m] (`band`) that they transmit."""

    pupil: Pupil
    source: PointSource
    grid: Grid
    soft: SoftAperture
    band: float

    @classmethod
    def for_stop(
        cls, stop: Stop, following: Stop, settings: StepSettings, source: PointSource, arriving: float
    ) -> PupilSampling:
        """Return the sampling of the pupil at a stop.

        The band is the sum of the frequencies of the arriving light, of the pupil's phase and of the pupil's edge.
        Frequencies beyond the band may be aliased, but not into the band.

        arriving: highest frequency [1/m] of the arriving light.

        Raises:
            AccuracyError: more samples are necessary than the limit allows.
        """
        pupil = stop.pupil
        assert pupil is not None
        if pupil.pixels:
            raise ValueError(
                "elements: a PixelRelief has jumps, which the grids between planes cannot represent: use psf for it"
            )
        slope = SLOPE_MARGIN * pupil.slopes(settings.wavelength, source).steepest / settings.wavelength
        turns = arriving + slope + pupil.bandwidth(settings.wavelength, settings.edge_ripple)
        band = settings.reaching(stop.half_width + following.half_width, following.distance)
        if math.isinf(band):
            band = turns  # coinciding planes: the edge is as soft as the finest detail
        soft = pupil.aperture.soften((turns + band) * pupil.radius, settings.edge_ripple, EDGE_REACH)
        pitch = 1 / (turns + band + soft.stopband / pupil.radius)
        across = 2 * math.ceil((1 + soft.reach) * pupil.radius / pitch) + 1
        if across > MOST_SAMPLES:
            raise AccuracyError(
                f"a pupil of radius {pupil.radius:.3g} m needs {across} samples across; the limit is {MOST_SAMPLES}: "
                "widen the tolerance, flatten its relief, or move the adjacent planes further away"
            )
        return cls(pupil, source, Grid.square(across, pitch), soft, band)

    def transmitted(self, u: np.ndarray | float, settings: StepSettings) -> PlaneField:
        """Return the field u on the grid times the pupil's transmittance; backwards, times its conjugate."""
        import drjit as dr

        beam = Beam(self.pupil, self.source, settings.wavelength, math.inf)
        field = beam.behind(self.soft, self.grid, precision(settings.dtype))
        if dr.grad_enabled(field.re, field.im):
            raise ValueError("elements: a system has no derivatives; use psf for a single pupil")
        transmittance = field.numpy()
        return PlaneField(u * (transmittance.conj() if settings.backward else transmittance), self.grid.dx, self.band)
