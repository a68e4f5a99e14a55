"""The angular spectrum of a steep pupil, from samples of its light convolved with a Gaussian (`smooth_pupil`).

Samples of all light of a rough relief would need the pitch of its steepest slopes, even if nearly all of this light
misses the window or is evanescent. The convolved light needs the pitch of the light that arrives in the window. Its
spectrum is divided by that of the Gaussian. All further steps are the same as for other pupils (`angular_spectrum`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from optics.elements.beam import Beam
from optics.elements.derivative_knots import carries_derivatives
from optics.elements.wavefront_slopes import derivative
from optics.methods.angular_spectrum import arrived, split_period, whole_period
from optics.methods.problem import Problem
from optics.methods.smooth_pupil import SmoothPupil, sides_of
from optics.methods.spectral_taper import Taper, tapers
from optics.methods.spectrum_sampling import SpectrumSampling
from optics.numerics.autodiff import Array
from optics.numerics.cost import CALL, SMOOTH_SAMPLE, SPECTRUM_SAMPLE
from optics.numerics.even_fields import whole
from optics.numerics.field import Field
from optics.numerics.fourier import fast_length
from optics.numerics.grid import Grid
from optics.numerics.precision import Precision, opaque, precision

__all__ = ["SmoothSpectrum", "may_be_steep", "split_smooth_spectrum", "whole_smooth_spectrum"]

# Choices. Largest error of the amplitude due to the third derivative of the phase, relative to the tolerance; largest
# exponent by which the Gaussian attenuates light in the window, at a tolerance of 0.01; and light that the samples
# alias, relative to the tolerance. See test_smooth_spectrum.py.
CUBIC, ATTENUATED, ALIASED = 0.25, 1.0, 0.01
SAMPLE_BYTES = 250.0  # arrays of float64 and complex128 per sample of the pupil


@dataclass(frozen=True)
class SmoothSpectrum(SpectrumSampling):
    """Spectrum of a pupil whose light is convolved with a Gaussian. pupil_period: number of its samples per period."""

    method: str
    smooth: SmoothPupil
    taper: Taper
    period: float
    pupil_period: int
    output_period: int
    even: bool = False
    seconds: float = 0.0
    bytes: float = 0.0
    model_error: float = 0.0
    padding: float = 1.0

    @cached_property
    def pupil(self) -> Grid:
        pitch = self.period / self.pupil_period
        across = 2 * math.ceil(self.smooth.outermost / pitch) + 1
        return Grid.square(min(self.pupil_period, across), pitch)

    def field(self, beam: Beam, problem: Problem) -> Field:
        """Return U over the window, without the carrier e^{ikz}."""
        return self.whole_phase(self._arrived(beam, problem), beam, problem)

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Return |U|² over the window for unit amplitude at the pupil, a flat Dr.Jit array."""
        return self._arrived(beam, problem).intensity

    @property
    def samples(self) -> tuple[int, int]:
        return self.pupil.shape

    def _arrived(self, beam: Beam, problem: Problem) -> Field:
        spectrum = self._spectrum(beam, precision(problem.dtype))
        found = arrived(spectrum, beam, problem, self).scaled((self.pupil.dx / self.period) ** 2)
        return whole(found, problem.window) if self.even else found

    def _spectrum(self, beam: Beam, types: Precision) -> Field:
        """Return the spectrum of the light before the convolution, F{u} / e^{-2π²δ²f²}."""
        import drjit as dr

        pupil = self.part(self.pupil)
        light = Field.from_numpy(self.smooth.light(beam, pupil.x, pupil.y), pupil.dx, types)
        found = self.sum(replace(light, grid=pupil), self.pupil, self.pupil_period, self.spectrum, -1)
        fx, fy = self.part(self.spectrum).coordinates(types)
        gain = types.Float(dr.exp((fx * fx + fy * fy) * opaque(types, self.smooth.exponent)))
        return Field(found.re * gain, found.im * gain, found.grid, types)


def may_be_steep(beam: Beam) -> bool:
    """Return whether these methods apply to the pupil: it has a smooth relief or wavefront, and no mask.

    The aperture must be a circle, a ring, a slit or a convex polygon, and no number may carry a derivative.
    """
    pupil = beam.pupil
    bends = pupil.bends(beam.wavelength) or pupil.wavefront is not None
    smooth = bends and not pupil.pixels and pupil.mask is None and not carries_derivatives(beam)
    return smooth and sides_of(pupil.aperture) is not None


def whole_smooth_spectrum(problem: Problem) -> list[SmoothSpectrum]:
    """Return samplings with which the whole spectrum meets the problem's tolerance."""
    return _samplings(problem, "angular_spectrum")


def split_smooth_spectrum(problem: Problem) -> list[SmoothSpectrum]:
    """Return samplings with which the split spectrum meets the problem's tolerance."""
    return _samplings(problem, "split_angular_spectrum")


def _samplings(problem: Problem, method: str) -> list[SmoothSpectrum]:
    return [_sampling(problem, taper, method) for taper in tapers(problem)]


def _sampling(problem: Problem, taper: Taper, method: str) -> SmoothSpectrum:
    sides = sides_of(problem.aperture)
    assert sides is not None
    smooth = SmoothPupil(sides, problem.radius, _width(problem, taper.end))
    find = whole_period if method == "angular_spectrum" else split_period
    period, output_period = find(problem, taper, smooth.outermost)
    # The light at frequencies that the samples alias onto the band is weaker than that in the band by this exponent.
    exponent = math.log(1 / (ALIASED * problem.tolerance))
    aliased = math.sqrt(taper.end**2 + exponent / smooth.exponent)
    pupil_period = fast_length(period * (taper.end + aliased))
    return _timed(SmoothSpectrum(method, smooth, taper, period, pupil_period, output_period, problem.even), problem)


def _width(problem: Problem, band: float) -> float:
    """Return the width δ [m] of the Gaussian, for light up to the frequency `band` [1/m].

    The error of the amplitude is about the third derivative of the phase, in waves, times δ³.
    """
    attenuated = math.sqrt(ATTENUATED * min(1.0, problem.tolerance / 0.01) / 2) / (math.pi * band)
    return min(attenuated, (CUBIC * problem.tolerance / _third_derivative(problem)) ** (1 / 3))


def _third_derivative(problem: Problem) -> float:
    """Return the largest third derivative of the waves behind the pupil [1/m³], at least one per cubed radius."""
    slopes = problem.slopes
    along = slopes.along_x / problem.light.wavelength, slopes.along_y / problem.light.wavelength
    (xx, xy), yy = _gradient(along[0], slopes.grid.dx), _gradient(along[1], slopes.grid.dx)[1]
    thirds = (*_gradient(xx, slopes.grid.dx), *_gradient(yy, slopes.grid.dx))
    square = thirds[0] ** 2 + 3 * thirds[1] ** 2 + 3 * thirds[2] ** 2 + thirds[3] ** 2
    inside = slopes.distance_from_axis <= problem.radius
    return max(math.sqrt(float(square[inside].max())), problem.radius**-3)


def _gradient(values: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    return derivative(values.T, step).T, derivative(values, step)


def _timed(sampling: SmoothSpectrum, problem: Problem) -> SmoothSpectrum:
    pupil, spectrum = sampling.part(sampling.pupil), sampling.part(sampling.spectrum)
    samples = math.prod(pupil.shape)
    points = samples * SMOOTH_SAMPLE + math.prod(spectrum.shape) * SPECTRUM_SAMPLE
    sums = sampling.sum_seconds(sampling.pupil, sampling.pupil_period, sampling.spectrum)
    needed = samples * SAMPLE_BYTES + sampling.sum_bytes(pupil, spectrum, problem.dtype)
    return replace(
        sampling,
        seconds=CALL["angular_spectrum"] + points + sums + sampling.seconds_from_spectrum(problem.window),
        bytes=max(needed, sampling.bytes_from_spectrum(problem.window, problem.dtype)),
        padding=sampling.pupil_period / sampling.pupil.shape[0],
    )
