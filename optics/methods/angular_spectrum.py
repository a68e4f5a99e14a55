"""The angular spectrum of a pupil's field on grids, propagated to the window in one step or in two.

The method with two steps is called the split method. It first propagates the spectrum to a relay plane, without the
paraxial part of the phase. From there to the window, Fresnel's integral adds this part.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

from optics.elements.beam import Beam
from optics.methods.fresnel import paraxial_integral
from optics.methods.problem import Problem
from optics.methods.pupil_edge import PupilEdge
from optics.methods.row_blocks import block_size, row_blocks
from optics.methods.spectral_taper import Taper, tapers
from optics.methods.spectrum_sampling import SpectrumSampling
from optics.numerics.autodiff import Array, Scalar
from optics.numerics.cost import CALL, PUPIL_SAMPLE, SPECTRUM_SAMPLE
from optics.numerics.even_fields import whole
from optics.numerics.field import Field
from optics.numerics.fourier import fast_length
from optics.numerics.grid import Grid
from optics.numerics.precision import Precision, opaque, precision

__all__ = [
    "GridSampling",
    "arrived",
    "split_period",
    "split_spectrum",
    "transfer",
    "whole_period",
    "whole_spectrum",
]


@dataclass(frozen=True)
class GridSampling(SpectrumSampling):
    """Grids on which the angular spectrum of a pupil with a soft edge is computed.

    pupil_period: number of samples of the pupil's plane in one period, the width after which the field repeats.
    """

    method: str
    edge: PupilEdge
    taper: Taper
    period: float
    pupil_period: int
    output_period: int
    even: bool = False
    seconds: float = 0.0
    bytes: float = 0.0
    model_error: float = 0.0

    @cached_property
    def pupil(self) -> Grid:
        """Grid in the pupil's plane.

        It covers the aperture with its soft edge, or one period if this is narrower. The field repeats after a period.
        """
        pitch = self.period / self.pupil_period
        across = 2 * math.ceil(self.edge.outermost / pitch) + 1
        return Grid.square(min(self.pupil_period, across), pitch)

    def field(self, beam: Beam, problem: Problem) -> Field:
        """Return the complex amplitude U over the window, without the carrier e^{ikz} of a plane wave."""
        return self.whole_phase(_angular_spectrum(beam, problem, self, precision(problem.dtype)), beam, problem)

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Return the intensity over the window, for unit amplitude at the pupil, as a flat Dr.Jit array."""
        return _angular_spectrum(beam, problem, self, precision(problem.dtype)).intensity

    @property
    def padding(self) -> float:
        return self.pupil_period / self.pupil.shape[0]

    @property
    def samples(self) -> tuple[int, int]:
        return self.pupil.shape


def whole_spectrum(problem: Problem) -> list[GridSampling]:
    """Return samplings with which propagation of the spectrum in one step meets the problem's tolerance.

    A sampling defines the grids on which a field is computed.
    """
    return _samplings(problem, "angular_spectrum")


def split_spectrum(problem: Problem) -> list[GridSampling]:
    """Return samplings with which the split method meets the problem's tolerance.

    A sampling defines the grids on which a field is computed. The split method first propagates the spectrum without
    the paraxial part of its phase. Fresnel's integral then adds this part.
    """
    return _samplings(problem, "split_angular_spectrum")


def _samplings(problem: Problem, method: str) -> list[GridSampling]:
    """Return samplings for tapers with increasing blur, up to the first sampling that costs more than its predecessor.

    A taper fades the spectrum out at high frequencies, which blurs the field. Tapers with little blur need more
    frequencies. Tapers with much blur need a longer period, after which the field repeats. The cost therefore has a
    single minimum.
    """
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
    """Return the period [m] after which the field repeats, and the number of its samples at the window's pitch.

    Fourier transforms on a grid add copies of the field, one period apart. The period is so long that the light of the
    copies does not reach the window. Copies of light farther from the axis than `problem.reach` may overlap the rim of
    the window, because this light is negligible. If `problem.steep` is True, it is not negligible and must not overlap.

    outermost: distance [m] from the axis at which the pupil ends.
    """
    beam = outermost + taper.blur + problem.distance * taper.tangent
    # Light beyond `reach` is negligible, except behind steep pupils, so it may wrap around to the rim of the window.
    if problem.reach is not None and not problem.steep:
        beam = min(beam, problem.reach + outermost)
    pitch = problem.window.dx
    samples = fast_length(max(problem.window.half_width + beam, 2 * outermost) / pitch)
    return samples * pitch, samples


def split_period(problem: Problem, taper: Taper, outermost: float) -> tuple[float, int]:
    """Return the period [m] after which the field in the relay plane repeats, and the number of samples in a period.

    The split method first propagates light to this plane, without the paraxial part of the phase, which Fresnel's
    integral adds later. The taper fades the spectrum out towards an angle θ from the axis, which blurs the field. The
    period covers the pupil, this blur, and the non-paraxial displacement z (tan θ - sin θ) of light at the angle θ,
    where z is the distance of the window. Fresnel's integral repeats the field at distances of λz divided by the pitch.
    The samples are so dense that these copies do not reach the window.

    outermost: distance [m] from the axis at which the pupil ends.
    """
    relay = outermost + taper.blur + problem.distance * (taper.tangent - taper.sine)
    period = 2 * relay
    reached = problem.window.half_width + relay + problem.distance * taper.sine
    return period, fast_length(period * reached / (problem.wavelength * problem.distance))


def _timed(sampling: GridSampling, problem: Problem) -> GridSampling:
    seconds, needed = _spectrum_cost(sampling, problem.dtype)
    seconds += sampling.seconds_from_spectrum(problem.window)
    pupil, spectrum = sampling.pupil.shape[0], sampling.spectrum.shape[0]
    points = pupil**2 * (PUPIL_SAMPLE + sampling.edge.seconds_per_point) + spectrum**2 * SPECTRUM_SAMPLE
    points *= 0.25 if sampling.even else 1.0
    seconds += points + CALL["angular_spectrum"]
    needed = max(needed, sampling.bytes_from_spectrum(problem.window, problem.dtype))
    return replace(sampling, seconds=seconds, bytes=needed)


def _spectrum_cost(how: GridSampling, dtype: str) -> tuple[float, float]:
    """Return the time [s] and the memory [bytes] of the Fourier sum over the pupil that gives the spectrum."""
    stored, spectrum = how.part(how.pupil), how.part(how.spectrum)
    count, rows = block_size(stored)
    block = Grid((rows, stored.shape[1]), stored.dx)
    needed = how.sum_bytes(block, spectrum, dtype)
    if how.even or count == 1:
        return how.sum_seconds(how.pupil, how.pupil_period, how.spectrum), needed
    each = how.sum_seconds(block, how.pupil_period, how.spectrum)
    return count * (each + math.prod(spectrum.shape) * SPECTRUM_SAMPLE), needed


def _angular_spectrum(beam: Beam, problem: Problem, how: GridSampling, types: Precision) -> Field:
    """Return the field over the window, U(x) = F⁻¹{F{U₀} H} (Goodman, Introduction to Fourier Optics, §3.10).

    U₀ is the field behind the pupil, F the Fourier transform and H the transfer function. If `how` is a sampling
    for the split method, which propagates light in two steps, the result lacks a phase that does not affect the
    intensity.
    """
    spectrum = _spectrum(beam, how, types)
    found = arrived(spectrum, beam, problem, how).scaled((how.pupil.dx / how.period) ** 2)
    return whole(found, problem.window) if how.even else found


def _spectrum(beam: Beam, how: GridSampling, types: Precision) -> Field:
    """Return the spectrum of the field behind the pupil, as the sum of the spectra of blocks of the pupil's rows."""
    total = None
    for first, block in row_blocks(how.part(how.pupil)):
        u = beam.behind(how.edge.aperture, block, types)
        part = how.sum(u, how.pupil, how.pupil_period, how.spectrum, -1, first)
        total = part if total is None else (total + part).evaluated()
    assert total is not None
    return total


def arrived(spectrum: Field, beam: Beam, problem: Problem, how: SpectrumSampling) -> Field:
    """Return the field over the window that results from this spectrum of the field in the pupil's plane.

    If `how` belongs to the split method, which propagates in two steps, the result lacks a phase that does not affect
    the intensity.
    """
    spectrum = spectrum * transfer(beam, problem, how, precision(problem.dtype))
    if how.is_whole:
        return how.sum(spectrum, how.spectrum, how.output_period, problem.window, +1)
    return _paraxial_rest(spectrum, beam, problem, how)


def transfer(beam: Beam, problem: Problem, how: SpectrumSampling, types: Precision) -> Field:
    """Return the product of the transfer function exp(ikz (cos θ - 1)) (Goodman, eq. 3-74) and the taper of `how`.

    θ is the angle of the light with the axis. The taper fades light out near grazing incidence. With q = 1 - cos θ, the
    exponent is -ikz q. The split method, which propagates light in two steps, leaves the paraxial part of the exponent,
    -ikz sin²θ/2, to the second step, Fresnel's integral. Because q - sin²θ/2 = q²/2, the exponent -ikz q²/2 remains.
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
    """Return q = 1 - cos θ from sin²θ, in float64.

    At small angles, rounding errors of cos θ are large relative to the difference 1 - cos θ. In the phase kz q, with
    the wave number k and the distance z, they would be magnified. One correction step towards the solution of q (2 - q)
    = sin²θ removes them without a division.
    """
    import drjit as dr

    q = 1 - dr.sqrt(1 - s2)
    return q + (s2 - q * (2 - q)) / 2


def _paraxial_rest(spectrum: Field, beam: Beam, problem: Problem, how: SpectrumSampling) -> Field:
    """Return the field over the window, from a spectrum that has propagated without the paraxial part of the phase.

    A Fourier transform gives the field in an intermediate plane, the relay plane. From there to the window, Fresnel's
    integral adds the paraxial part.
    """
    u = how.sum(spectrum, how.spectrum, how.output_period, how.relay, +1)

    def onto_window(u: Field, period: Scalar) -> Field:
        return how.sum(u, how.relay, period, problem.window, -1)

    return paraxial_integral(u, beam.distance, problem.wavelength, problem.window, onto_window=onto_window)
