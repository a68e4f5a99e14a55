"""The angular spectrum of a pupil of pixels: exact sums over nodes that are fitted to them, instead of a transform.

A spectrum that is needed up to a frequency asks for nodes that resolve it within each pixel, and for nothing from the
light beyond, which jumps send everywhere. From the spectrum on all is as for other pupils (`angular_spectrum`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from optics.elements.beam import Beam
from optics.methods.angular_spectrum import SpectrumSampling, arrived
from optics.methods.low_rank import FLOPS
from optics.methods.problem import Problem
from optics.methods.pupil_sampling import PixelSamples, pixel_samples
from optics.methods.rayleigh_sommerfeld import node_rule
from optics.methods.spectral_taper import Taper, tapers
from optics.numerics.autodiff import Array
from optics.numerics.field import Field
from optics.numerics.fourier import fast_length, predicted_seconds
from optics.numerics.grid import Grid
from optics.numerics.matrices import complex_matmul
from optics.numerics.precision import Precision, precision

__all__ = ["PixelSpectrum", "split", "whole"]


@dataclass(frozen=True)
class PixelSpectrum(SpectrumSampling):
    """Of a pupil of pixels with nodes fitted to them."""

    method: str
    pupil: PixelSamples
    taper: Taper
    period: float
    output_period: int
    seconds: float = 0.0
    model_error: float = 0.0

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """|U|² over the window for unit amplitude at the pupil, a flat Dr.Jit array."""
        types = precision(problem.dtype)
        spectrum = _spectrum(self.pupil.field(beam, types), beam, self, types)
        return arrived(spectrum, beam, problem, self).scaled(1 / self.period**2).intensity

    @property
    def samples(self) -> tuple[int, int]:
        return len(self.pupil.at), len(self.pupil.at)

    @property
    def largest(self) -> int:
        """Side of the largest square array."""
        arrays = [len(self.pupil.at), self.spectrum.shape[0]]
        return max([*arrays, self.output_period] if self.method.startswith("split") else arrays)


def whole(problem: Problem) -> list[PixelSpectrum]:
    """Samplings by which the whole spectrum meets the problem's tolerance."""
    found = (_whole(problem, taper) for taper in tapers(problem))
    return [sampling for sampling in found if sampling is not None]


def split(problem: Problem) -> list[PixelSpectrum]:
    """Samplings by which the split spectrum meets the problem's tolerance."""
    found = (_split(problem, taper) for taper in tapers(problem))
    return [sampling for sampling in found if sampling is not None]


def _nodes(problem: Problem, taper: Taper) -> PixelSamples | None:
    """Enough for the phase and every frequency that is kept, in all pixels."""
    assert problem.pixelated is not None
    cycles = problem.radius * (problem.phase_band_inside + taper.end)
    return pixel_samples(problem.pixelated, cycles, node_rule(problem)[1], problem.radius)


def _whole(problem: Problem, taper: Taper) -> PixelSpectrum | None:
    """One period holds the window and all light that could wrap around into it."""
    pupil = _nodes(problem, taper)
    if pupil is None:
        return None
    beam = problem.radius + taper.blur + problem.distance * taper.tangent
    if problem.reach is not None:  # what lies beyond the reach is negligible: it may wrap around to the window's rim
        beam = min(beam, problem.reach + problem.radius)
    pitch = problem.window.dx
    output_period = fast_length(max(problem.window.half_width + beam, 2 * problem.radius) / pitch)
    sampling = PixelSpectrum("angular_spectrum", pupil, taper, output_period * pitch, output_period)
    last = predicted_seconds(sampling.spectrum.shape, output_period, problem.window.shape)
    return _timed(sampling, last, problem.dtype)


def _split(problem: Problem, taper: Taper) -> PixelSpectrum | None:
    """One period holds the pupil and the non-paraxial walk-off z (tan θ - sin θ)."""
    pupil = _nodes(problem, taper)
    if pupil is None:
        return None
    relay = problem.radius + taper.blur + problem.distance * (taper.tangent - taper.sine)
    period = 2 * relay
    reached = problem.window.half_width + relay + problem.distance * taper.sine
    relay_period = fast_length(period * reached / (problem.wavelength * problem.distance))
    sampling = PixelSpectrum("split_angular_spectrum", pupil, taper, period, relay_period)
    last = predicted_seconds(sampling.spectrum.shape, relay_period, sampling.relay.shape)
    last += predicted_seconds(sampling.relay.shape, 0.5, problem.window.shape)  # no whole period: a matrix
    return _timed(sampling, last, problem.dtype)


def _timed(sampling: PixelSpectrum, last: float, dtype: str) -> PixelSpectrum:
    nodes, kept = len(sampling.pupil.at), sampling.spectrum.shape[0]
    sums = 8 * nodes * kept * (nodes + kept) / FLOPS[dtype]
    points = nodes * nodes * 6e-8 + kept * kept * 2e-8 + nodes * kept * 4e-8
    return replace(sampling, seconds=2e-3 + sums + points + last)


def _spectrum(u: Field, beam: Beam, how: PixelSpectrum, types: Precision) -> Field:
    """Σ u(ξ) e^{-2πi f·ξ} at all frequencies of the grid: two matrix products, W u Wᵀ, W = e^{-2πi f ξ}."""
    import drjit as dr

    nodes, grid = len(how.pupil.at), how.spectrum
    index = types.Float64(dr.arange(types.Index, grid.shape[0] * nodes))
    row = dr.floor((index + 0.5) / dr.opaque(types.Float64, nodes))
    place = how.pupil.places(dr.fma(-row, dr.opaque(types.Float64, nodes), index), beam, types)
    waves = place * (row - grid.shape[0] // 2) * dr.opaque(types.Float64, -grid.dx)
    wheel = Field.from_waves(types.Float(1), waves, Grid((grid.shape[0], nodes), 1.0), types)
    matrix = types.Tensor(wheel.re, wheel.grid.shape), types.Tensor(wheel.im, wheel.grid.shape)
    samples = types.Tensor(u.re, (nodes, nodes)), types.Tensor(u.im, (nodes, nodes))
    re, im = complex_matmul(complex_matmul(matrix, samples), matrix, transposed=True)
    return Field(re.array, im.array, grid, types)
