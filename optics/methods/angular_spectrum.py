"""The angular spectrum of a pupil's field on grids, whole or with its paraxial part split off."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

from optics.elements.beam import Beam
from optics.methods.fresnel import paraxial_integral
from optics.methods.problem import Problem, PupilEdge
from optics.methods.spectral_taper import Taper, tapers
from optics.numerics.autodiff import Array, Scalar
from optics.numerics.cost import CALL, PUPIL_SAMPLE, SPECTRUM_SAMPLE
from optics.numerics.even_fields import even_seconds, even_sum, quarter, whole
from optics.numerics.field import Field
from optics.numerics.fourier import dft2, fast_length, predicted_seconds
from optics.numerics.grid import Grid
from optics.numerics.precision import Precision, opaque, precision

__all__ = [
    "GridSampling",
    "SpectrumSampling",
    "arrived",
    "split_period",
    "split_spectrum",
    "whole_period",
    "whole_spectrum",
]


class SpectrumSampling:
    """Samples of a spectrum, and of what it becomes.

    method: "angular_spectrum" or "split_angular_spectrum". taper: where the spectrum fades out.
    period: width [m] after which the pupil plane repeats: the spectrum's samples lie 1/period apart.
    output_period: samples over the period of the plane that the last transform starts from or ends on.
    even: whether the field is the same where x or y is mirrored: a quarter of each plane stands for it.
    """

    method: str
    taper: Taper
    period: float
    output_period: int
    even: bool = False

    @property
    def is_whole(self) -> bool:
        """Whether no paraxial part is split off."""
        return self.method == "angular_spectrum"

    @cached_property
    def spectrum(self) -> Grid:
        return Grid.square(2 * math.ceil(self.taper.end * self.period) + 1, 1 / self.period)

    @cached_property
    def relay(self) -> Grid:
        return Grid.square(self.output_period, self.period / self.output_period)

    def part(self, grid: Grid) -> Grid:
        """The samples of a plane that stand for it."""
        return quarter(grid) if self.even else grid

    def sum(self, field: Field, start: Grid, period: Scalar, end: Grid, sign: int) -> Field:
        """Fourier's, from one plane's samples to another's, see `fourier.dft2`."""
        if self.even:
            return even_sum(field, start.shape, period, end)
        return dft2(field, period, end.shape, sign, end.dx, end.centre)

    def sum_seconds(self, start: Grid, period: float, end: Grid) -> float:
        return even_seconds(start.shape, end.shape) if self.even else predicted_seconds(start.shape, period, end.shape)

    def seconds_from_spectrum(self, window: Grid) -> float:
        """What the transforms from the spectrum to the window take."""
        if self.is_whole:
            return self.sum_seconds(self.spectrum, self.output_period, window)
        to_relay = self.sum_seconds(self.spectrum, self.output_period, self.relay)
        return to_relay + self.sum_seconds(self.relay, 0.5, window)  # no whole period: a matrix

    def whole_phase(self, field: Field, beam: Beam, problem: Problem) -> Field:
        """What `arrived` leaves out of a split spectrum's field: e^{iπr²/λz}/i."""
        if self.is_whole:
            return field
        types = precision(problem.dtype)
        x, y = problem.window.coordinates(types)
        waves = (x * x + y * y) * (0.5 / opaque(types, problem.wavelength)) / opaque(types, beam.distance) - 0.25
        return field * Field.from_waves(1.0, waves, problem.window, types)

    def plane(self, problem: Problem) -> float:
        """Width [m] over which rounding spreads the pupil's light."""
        return self.period if self.is_whole else problem.wavelength * problem.distance / self.relay.dx


@dataclass(frozen=True)
class GridSampling(SpectrumSampling):
    """Of a pupil whose soft edge a grid carries, pupil_period samples to the period."""

    method: str
    edge: PupilEdge
    taper: Taper
    period: float
    pupil_period: int
    output_period: int
    even: bool = False
    seconds: float = 0.0
    model_error: float = 0.0

    @cached_property
    def pupil(self) -> Grid:
        """The samples that hold the soft disk."""
        pitch = self.period / self.pupil_period
        across = 2 * math.ceil(self.edge.outermost / pitch) + 1
        return Grid.square(min(self.pupil_period, across), pitch)

    def field(self, beam: Beam, problem: Problem) -> Field:
        """U over the window, less the carrier e^{ikz}."""
        return self.whole_phase(_angular_spectrum(beam, problem, self, precision(problem.dtype)), beam, problem)

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """|U|² over the window for unit amplitude at the pupil, a flat Dr.Jit array."""
        return _angular_spectrum(beam, problem, self, precision(problem.dtype)).intensity

    @property
    def padding(self) -> float:
        return self.pupil_period / self.pupil.shape[0]

    @property
    def samples(self) -> tuple[int, int]:
        return self.pupil.shape

    @property
    def largest(self) -> int:
        """Side of the largest square array."""
        sides = [self.pupil.shape[0], self.spectrum.shape[0]]
        side = max(sides if self.is_whole else [*sides, self.output_period])
        return side // 2 + 1 if self.even else side


def whole_spectrum(problem: Problem) -> list[GridSampling]:
    """Samplings by which the whole spectrum meets the problem's tolerance."""
    return _samplings(problem, "angular_spectrum")


def split_spectrum(problem: Problem) -> list[GridSampling]:
    """Samplings by which the split spectrum meets the problem's tolerance."""
    return _samplings(problem, "split_angular_spectrum")


def _samplings(problem: Problem, method: str) -> list[GridSampling]:
    """By wider and wider tapers, until one costs more than the last: narrow ones need more frequencies, wide ones more
    room, and between them costs have one least."""
    found: list[GridSampling] = []
    for taper in tapers(problem):
        found.append(_sampling(problem, taper, method))
        if len(found) > 1 and found[-1].seconds > found[-2].seconds:
            break
    return found


def _sampling(problem: Problem, taper: Taper, method: str) -> GridSampling:
    edge = problem.soft_edge(taper.end + problem.phase_band)
    find = whole_period if method == "angular_spectrum" else split_period
    period, output_period = find(problem, taper, edge.outermost)
    pupil_period = fast_length(period * (taper.end + edge.stopband + problem.phase_band))
    return _timed(GridSampling(method, edge, taper, period, pupil_period, output_period, problem.even), problem)


def whole_period(problem: Problem, taper: Taper, outermost: float) -> tuple[float, int]:
    """Period [m], and its samples at the window's pitch, that holds the window and all light that could wrap around
    into it from a pupil that ends `outermost` [m] from the axis."""
    beam = outermost + taper.blur + problem.distance * taper.tangent
    if problem.reach is not None:  # what lies beyond the reach is negligible: it may wrap around to the window's rim
        beam = min(beam, problem.reach + outermost)
    pitch = problem.window.dx
    samples = fast_length(max(problem.window.half_width + beam, 2 * outermost) / pitch)
    return samples * pitch, samples


def split_period(problem: Problem, taper: Taper, outermost: float) -> tuple[float, int]:
    """Period [m] that holds the pupil and the non-paraxial walk-off z (tan θ - sin θ); and its samples, so close that
    Fresnel's integral, which repeats every λz over their pitch, keeps its copies off the window."""
    relay = outermost + taper.blur + problem.distance * (taper.tangent - taper.sine)
    period = 2 * relay
    reached = problem.window.half_width + relay + problem.distance * taper.sine
    return period, fast_length(period * reached / (problem.wavelength * problem.distance))


def _timed(sampling: GridSampling, problem: Problem) -> GridSampling:
    seconds = sampling.sum_seconds(sampling.pupil, sampling.pupil_period, sampling.spectrum)
    seconds += sampling.seconds_from_spectrum(problem.window)
    pupil, spectrum = sampling.pupil.shape[0], sampling.spectrum.shape[0]
    points = pupil**2 * (PUPIL_SAMPLE + sampling.edge.seconds_per_point) + spectrum**2 * SPECTRUM_SAMPLE
    points *= 0.25 if sampling.even else 1.0
    seconds += points + CALL["angular_spectrum"]
    return replace(sampling, seconds=seconds)


def _angular_spectrum(beam: Beam, problem: Problem, how: GridSampling, types: Precision) -> Field:
    """U(x) = F⁻¹{F{U₀} H} (Goodman, Introduction to Fourier Optics, §3.10), up to a phase of the split one that
    intensity forgets."""
    u = beam.behind(how.edge.aperture, how.part(how.pupil), types)
    spectrum = how.sum(u, how.pupil, how.pupil_period, how.spectrum, -1)
    found = arrived(spectrum, beam, problem, how).scaled((how.pupil.dx / how.period) ** 2)
    return whole(found, problem.window) if how.even else found


def arrived(spectrum: Field, beam: Beam, problem: Problem, how: SpectrumSampling) -> Field:
    """Over the window, of light that has this spectrum at the pupil; up to a phase that intensity forgets."""
    spectrum = spectrum * _transfer(beam, problem, how, precision(problem.dtype))
    if how.is_whole:
        return how.sum(spectrum, how.spectrum, how.output_period, problem.window, +1)
    return _paraxial_rest(spectrum, beam, problem, how)


def _transfer(beam: Beam, problem: Problem, how: SpectrumSampling, types: Precision) -> Field:
    """exp(ikz (cos θ - 1)) under the spectral taper; the split method leaves the paraxial -ikz sin²θ/2 for later.

    Goodman, eq. 3-74. cos θ - 1 = -q, and with the paraxial part taken out -q²/2.
    """
    import drjit as dr

    spectrum = how.part(how.spectrum)
    fx, fy = spectrum.coordinates(types)
    f2 = fx * fx + fy * fy
    s2 = dr.minimum(f2 * dr.square(opaque(types, problem.wavelength)), 1)
    q = versine(s2)
    sag = q if how.is_whole else q * q / 2
    waves = -opaque(types, beam.distance) / opaque(types, problem.wavelength) * sag
    return Field.from_waves(how.taper.fade(f2, types), waves, spectrum, types)


def versine(s2: Array) -> Array:
    """q = 1 - cos θ of sin²θ, float64. The difference loses digits, of which the distance makes waves; a step towards
    q (2 - q) = sin²θ brings them back, without a division."""
    import drjit as dr

    q = 1 - dr.sqrt(1 - s2)
    return q + (s2 - q * (2 - q)) / 2


def _paraxial_rest(spectrum: Field, beam: Beam, problem: Problem, how: SpectrumSampling) -> Field:
    """Fresnel's integral of the relay field."""
    u = how.sum(spectrum, how.spectrum, how.output_period, how.relay, +1)

    def onto_window(u: Field, period: Scalar) -> Field:
        return how.sum(u, how.relay, period, problem.window, -1)

    return paraxial_integral(u, beam.distance, problem.wavelength, problem.window, onto_window=onto_window)
