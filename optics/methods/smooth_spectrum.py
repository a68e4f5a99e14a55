"""The angular spectrum behind a steep relief, from samples of the light convolved with a Gaussian (`smooth_pupil`).

To sample all light behind a rough relief, samples would have to resolve the steepest slopes of the relief, even if
nearly all of this light misses the window or is evanescent. Samples of the convolved light only have to resolve the
light that arrives in the window. The spectrum of the convolved light is divided by that of the Gaussian, and propagated
as in `angular_spectrum`. In the window, the image is set to 0 beyond the distance `Problem.reach` from the axis. The
light beyond this distance is small compared with the tolerance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from optics.elements.beam import Beam
from optics.elements.derivative_knots import carries_derivatives
from optics.elements.wavefront_slopes import derivative
from optics.methods.angular_spectrum import transfer, whole_period
from optics.methods.problem import Problem
from optics.methods.smooth_pupil import REACH, SmoothPupil, sides_of
from optics.methods.spectral_taper import Taper, tapers
from optics.methods.spectrum_sampling import SpectrumSampling
from optics.methods.window_sums import intensity_of
from optics.numerics.array_sum_cost import lines_seconds
from optics.numerics.autodiff import Array
from optics.numerics.cost import CALL, SMOOTH_SAMPLE, TRANSFER_SAMPLE
from optics.numerics.fourier import fast_length
from optics.numerics.grid import Grid
from optics.numerics.precision import padded_for_packets, precision

__all__ = ["SmoothSpectrum", "may_be_steep", "smooth_spectrum"]

# Choices, see test_smooth_spectrum.py.
CUBIC = 0.5  # largest error of the amplitude due to the third derivative of the phase, relative to the tolerance
ATTENUATED = 2.5  # largest a, where e^{-a} is the Gaussian's factor on light in the window, at a tolerance of 0.01
ALIASED = 0.02  # largest amplitude of aliased light, relative to the tolerance
AT_ONCE = 2**19  # choice: samples of columns that are transformed at once
SAMPLE_BYTES = 250.0  # arrays of float64 and complex128 per sample of the pupil


@dataclass(frozen=True)
class SmoothSpectrum(SpectrumSampling):
    """Samples and spectrum of the light behind a pupil, after a convolution of the light with a Gaussian.

    smooth: pupil whose light is convolved with a Gaussian in closed form.
    blur: width [m] of a second Gaussian, with which the light is convolved numerically. If the first Gaussian is
        narrow, the second one allows samples that are further apart. 0: no second Gaussian.
    pupil_period: number of the pupil's samples per period.
    """

    smooth: SmoothPupil
    blur: float
    taper: Taper
    period: float
    pupil_period: int
    output_period: int
    even: bool = False
    seconds: float = 0.0
    bytes: float = 0.0
    tolerance: float = 0.01
    method: str = "angular_spectrum"
    model_error: float = 0.0

    @cached_property
    def pupil(self) -> Grid:
        """Grid of the samples from which the spectrum is computed."""
        return _samples(self.smooth.outermost + REACH * self.blur, self.period / self.pupil_period)

    @cached_property
    def closed_form(self) -> Grid:
        """Grid on which the convolution of the pupil's light with a first Gaussian is computed in closed form.

        The width of the first Gaussian is `smooth.width`. If `blur` is not 0, the light on this grid is then convolved
        numerically with a second Gaussian of the width `blur`. This yields the light on another grid, `pupil`.
        """
        if self.blur == 0:
            return self.pupil
        return _samples(self.smooth.outermost, _pitch(self.taper.end, self.smooth.width, self.tolerance))

    @property
    def samples(self) -> tuple[int, int]:
        return self.closed_form.shape

    @property
    def padding(self) -> float:
        return self.pupil_period / self.pupil.shape[0]

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Return the intensity over the window, for unit amplitude at the pupil, as a flat Dr.Jit array."""
        assert problem.reach is not None
        types, window = precision(problem.dtype), problem.window
        found = intensity_of(self._propagated(self._light(beam, types.dtype), self._transfer(beam, problem), window))
        found[np.add.outer(np.square(window.y), np.square(window.x)) > problem.reach**2] = 0
        return types.Float(padded_for_packets(found / float(self.pupil_period) ** 4))

    def _light(self, beam: Beam, dtype: Any) -> np.ndarray:
        """Return the light behind the pupil, convolved with two Gaussians, on the grid `pupil`, complex (y, x).

        The first Gaussian has the width `smooth.width`. The second has the width `blur`, and is absent if `blur` is 0.
        """
        grid = self.closed_form
        light = self.smooth.light(beam, grid.x, grid.y, dtype)
        if self.blur == 0:
            return light
        bell = np.exp(-(np.subtract.outer(self.pupil.x, grid.x) ** 2) / (2 * self.blur**2))
        weight = (bell * (grid.dx / (math.sqrt(2 * math.pi) * self.blur))).astype(light.dtype)
        found: np.ndarray = weight @ light @ weight.T
        return found

    def _transfer(self, beam: Beam, problem: Problem) -> np.ndarray:
        """Return the transfer function from pupil to window, divided by the spectra of two Gaussians, complex (fy, fx).

        The light is convolved with these Gaussians. The first has the width `smooth.width`. The second has the width
        `blur`, and is absent if `blur` is 0. The division reverses the convolution. The transfer function is even along
        both axes, so only its values at non-negative frequencies are returned.
        """
        found = transfer(beam, problem, replace(self, even=True), precision(problem.dtype)).numpy()
        exponent = 2 * math.pi**2 * (self.smooth.width**2 + self.blur**2)
        gain = np.exp(exponent * (np.arange(len(found)) / self.period) ** 2).astype(found.real.dtype)
        found *= gain[:, None] * gain
        return found

    def _propagated(self, light: np.ndarray, transfer: np.ndarray, window: Grid) -> np.ndarray:
        """Return the field over the window (y, x), times the squared number of samples per period.

        The light is transformed to its spectrum, and the spectrum to the field in the window. Along y, both transforms
        are computed for a few columns at a time, so that these columns fit into the cache. The FFT assumes that the
        first sample lies at 0. Factors with phases that are linear in the frequency account for the true positions of
        the first samples.
        """
        from scipy import fft

        top, length, period = len(transfer) - 1, self.pupil_period, self.output_period
        frequency = np.arange(-top, top + 1) / self.period
        first = float(self.pupil.x[0])
        along, up = (
            np.exp(2j * np.pi * frequency * (at[0] - first)).astype(light.dtype) for at in (window.x, window.y)
        )
        columns = np.ascontiguousarray((_centred(fft.fft(light, length, axis=1), top) * along).T)
        rows = np.empty((len(columns), window.shape[0]), light.dtype)
        for place in np.array_split(np.arange(len(columns)), -(-len(columns) * length // AT_ONCE)):
            spectrum = _centred(fft.fft(columns[place], length, axis=1), top) * up
            own = transfer[np.abs(place - top)]
            spectrum[:, top:] *= own
            spectrum[:, :top] *= own[:, :0:-1]
            rows[place] = _back(spectrum, top, period)[:, : window.shape[0]]
        return _back(np.ascontiguousarray(rows.T), top, period)[:, : window.shape[1]]


def _centred(spectrum: np.ndarray, top: int) -> np.ndarray:
    """Return the part of a spectrum between the frequencies -top and top, (line, 2 top + 1).

    spectrum: lines in the order of the FFT, (line, frequency).
    """
    return np.concatenate([spectrum[:, len(spectrum[0]) - top :], spectrum[:, : top + 1]], axis=1)


def _back(spectrum: np.ndarray, top: int, period: int) -> np.ndarray:
    """Return Σ_k U[k] exp(2πi j k / period) over k from -top to top, for j from 0 to period - 1, along axis 1."""
    from scipy import fft

    before = -top % period  # frequencies that differ by multiples of `period` are added
    wrapped = np.zeros((len(spectrum), -(-(before + 2 * top + 1) // period) * period), spectrum.dtype)
    wrapped[:, before : before + 2 * top + 1] = spectrum
    if wrapped.shape[1] > period:
        wrapped = wrapped.reshape(len(spectrum), -1, period).sum(axis=1)
    found: np.ndarray = fft.ifft(wrapped, axis=1, norm="forward", overwrite_x=True)
    return found


def may_be_steep(beam: Beam) -> bool:
    """Return whether `smooth_spectrum` applies to the pupil: it has a smooth relief or wavefront, and no mask.

    The aperture must be a circle, a ring, a slit or a convex polygon, and no parameter of the light and the pupil may
    carry a derivative.
    """
    pupil = beam.pupil
    bends = pupil.bends(beam.wavelength) or pupil.wavefront is not None
    smooth = bends and not pupil.pixels and pupil.mask is None and not carries_derivatives(beam)
    return smooth and sides_of(pupil.aperture) is not None


def smooth_spectrum(problem: Problem) -> list[SmoothSpectrum]:
    """Return samplings that meet the problem's tolerance, one for each of the problem's `tapers`.

    A taper fades the spectrum out before grazing incidence.
    """
    third = _third_derivative(problem)
    return [_sampling(problem, taper, third) for taper in tapers(problem)]


def _sampling(problem: Problem, taper: Taper, third: float) -> SmoothSpectrum:
    sides, tolerance = sides_of(problem.aperture), problem.tolerance
    assert sides is not None
    # The error of the amplitude is at most about the third derivative of the phase, in waves, times δ³.
    widest = math.sqrt(ATTENUATED * min(1.0, tolerance / 0.01) / 2) / (math.pi * taper.end)
    smooth = SmoothPupil(sides, problem.radius, min(widest, (CUBIC * tolerance / third) ** (1 / 3)))
    blur = math.sqrt(widest**2 - smooth.width**2)
    blur = blur if blur > _pitch(taper.end, smooth.width, tolerance) else 0.0  # the samples must resolve it
    period, output_period = whole_period(problem, taper, smooth.outermost + REACH * blur)
    pupil_period = fast_length(period / _pitch(taper.end, math.hypot(smooth.width, blur), tolerance))
    sampling = SmoothSpectrum(smooth, blur, taper, period, pupil_period, output_period, tolerance=tolerance)
    return _timed(sampling, problem)


def _pitch(band: float, width: float, tolerance: float) -> float:
    """Return the sampling pitch [m] for light that is convolved with a Gaussian of this width [m].

    Sampling aliases the frequency 1/pitch - band onto the edge of the band [1/m]. The Gaussian attenuates this light
    more than light at the edge of the band. The pitch is chosen so that the ratio of both attenuation factors is
    ALIASED * tolerance, the largest allowed amplitude of aliased light.

    band: highest frequency that is needed [1/m].
    """
    exponent = math.log(1 / (ALIASED * tolerance))
    return 1 / (band + math.sqrt(band**2 + exponent / (2 * (math.pi * width) ** 2)))


def _samples(outermost: float, pitch: float) -> Grid:
    return Grid.square(2 * math.ceil(outermost / pitch) + 1, pitch)


def _third_derivative(problem: Problem) -> float:
    """Return the largest third derivative of the phase behind the pupil [cycles/m³], but at least 1/radius³."""
    slopes = problem.slopes
    along = slopes.along_x / problem.light.wavelength, slopes.along_y / problem.light.wavelength
    xx, yy = _gradient(along[0], slopes.grid.dx)[0], _gradient(along[1], slopes.grid.dx)[1]
    thirds = (*_gradient(xx, slopes.grid.dx), *_gradient(yy, slopes.grid.dx))
    square = thirds[0] ** 2 + 3 * thirds[1] ** 2 + 3 * thirds[2] ** 2 + thirds[3] ** 2
    inside = slopes.distance_from_axis <= problem.radius
    return max(math.sqrt(float(square[inside].max())), problem.radius**-3)


def _gradient(values: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    return derivative(values.T, step).T, derivative(values, step)


def _timed(sampling: SmoothSpectrum, problem: Problem) -> SmoothSpectrum:
    across, columns, rows = sampling.pupil.shape[0], sampling.spectrum.shape[0], problem.window.shape[0]
    closed = sampling.samples[0]
    to_spectrum = lines_seconds(across + columns, sampling.pupil_period, problem.dtype)
    to_window = lines_seconds(columns + rows, sampling.output_period, problem.dtype)
    points = closed**2 * SMOOTH_SAMPLE + columns**2 * TRANSFER_SAMPLE / 4
    item = np.dtype(precision(problem.dtype).complex_dtype).itemsize
    lines = across * sampling.pupil_period + columns * (columns / 4 + across + 2 * rows)
    return replace(
        sampling,
        seconds=CALL["angular_spectrum"] + points + to_spectrum + to_window,
        bytes=closed**2 * SAMPLE_BYTES + item * lines,
    )
