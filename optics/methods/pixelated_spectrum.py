"""The angular spectrum of a pupil of pixels, as a sum over quadrature nodes within the pixels.

For other pupils, the spectrum is the Fourier transform of samples on a grid (`angular_spectrum`).
To compute the spectrum up to a given frequency, the nodes must resolve this frequency within each pixel. Jumps between
pixels also diffract light to higher frequencies, which the nodes need not resolve. All further steps are the same as
for other pupils.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from optics.elements.beam import Beam
from optics.methods.angular_spectrum import arrived, split_period, whole_period
from optics.methods.problem import Problem
from optics.methods.pupil_sampling import PixelSamples, cell_samples, pixel_samples
from optics.methods.rayleigh_sommerfeld import node_rule
from optics.methods.spectral_taper import Taper, tapers
from optics.methods.spectrum_sampling import SpectrumSampling
from optics.numerics.autodiff import Array
from optics.numerics.cost import (
    CALL,
    ITEM_BYTES,
    MATMUL_FLOPS,
    NODE_BYTES,
    NODE_FOURIER_ENTRY,
    PIXEL_NODE,
    SPECTRUM_SAMPLE,
)
from optics.numerics.field import Field
from optics.numerics.fourier import predicted_bytes
from optics.numerics.grid import Grid
from optics.numerics.matrices import complex_flops, complex_matmul
from optics.numerics.precision import Precision, precision

__all__ = ["PixelSpectrum", "split_pixel_spectrum", "whole_pixel_spectrum"]


@dataclass(frozen=True)
class PixelSpectrum(SpectrumSampling):
    """Sampling of the angular spectrum of a pupil of pixels, computed from quadrature nodes in each pixel."""

    method: str
    pupil: PixelSamples
    taper: Taper
    period: float
    output_period: int
    seconds: float = 0.0
    bytes: float = 0.0
    model_error: float = 0.0
    padding: float = 1.0

    def field(self, beam: Beam, problem: Problem) -> Field:
        """Return the complex amplitude U over the window, without the carrier e^{ikz} of a plane wave."""
        types = precision(problem.dtype)
        spectrum = _spectrum(self.pupil.field(beam, types), beam, self, types)
        return self.whole_phase(arrived(spectrum, beam, problem, self).scaled(1 / self.period**2), beam, problem)

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Return the intensity over the window, for unit amplitude at the pupil, as a flat Dr.Jit array."""
        types = precision(problem.dtype)
        spectrum = _spectrum(self.pupil.field(beam, types), beam, self, types)
        return arrived(spectrum, beam, problem, self).scaled(1 / self.period**2).intensity

    @property
    def samples(self) -> tuple[int, int]:
        return len(self.pupil.at), len(self.pupil.at)


def whole_pixel_spectrum(problem: Problem) -> list[PixelSpectrum]:
    """Return samplings that propagate the angular spectrum in one step and meet the problem's tolerance."""
    return _samplings(problem, "angular_spectrum")


def split_pixel_spectrum(problem: Problem) -> list[PixelSpectrum]:
    """Return samplings that propagate the angular spectrum in two steps and meet the problem's tolerance.

    The first step leaves out the paraxial part of the phase. The second step, Fresnel's integral, adds this part.
    """
    return _samplings(problem, "split_angular_spectrum")


def _samplings(problem: Problem, method: str) -> list[PixelSpectrum]:
    find = whole_period if method == "angular_spectrum" else split_period
    found = []
    for taper in tapers(problem):
        pupil = _nodes(problem, taper)
        if pupil is not None:
            period, output_period = find(problem, taper, problem.radius)
            found.append(_timed(PixelSpectrum(method, pupil, taper, period, output_period), problem))
    return found


def _nodes(problem: Problem, taper: Taper) -> PixelSamples | None:
    """Return quadrature nodes in each pixel. They are dense enough for the pupil's phase and for the angular spectrum.

    The taper is a function of frequency that fades the spectrum out. The nodes resolve all frequencies below the end of
    the taper. The result is None if pixels would need too many nodes.
    """
    if problem.knots is not None:
        return cell_samples(problem, taper.end)
    assert problem.pixelated is not None
    cycles = problem.radius * (problem.phase_band_inside + taper.end)
    return pixel_samples(problem.pixelated, cycles, node_rule(problem)[1], problem.radius)


def _timed(sampling: PixelSpectrum, problem: Problem) -> PixelSpectrum:
    nodes, kept = len(sampling.pupil.at), sampling.spectrum.shape[0]
    sums = (complex_flops(nodes * nodes * kept) + complex_flops(nodes * kept * kept)) / MATMUL_FLOPS[problem.dtype]
    points = nodes * nodes * PIXEL_NODE + kept * kept * SPECTRUM_SAMPLE + nodes * kept * NODE_FOURIER_ENTRY
    needed = predicted_bytes((nodes, nodes), (kept, kept), ITEM_BYTES[problem.dtype]) + nodes * nodes * NODE_BYTES
    return replace(
        sampling,
        seconds=CALL["angular_spectrum"] + sums + points + sampling.seconds_from_spectrum(problem.window),
        bytes=max(needed, sampling.bytes_from_spectrum(problem.window, problem.dtype)),
    )


def _spectrum(u: Field, beam: Beam, how: PixelSpectrum, types: Precision) -> Field:
    """Return Σ u(ξ) e^{-2πi f·ξ} over the nodes ξ at all frequencies f of the grid, by two matrix products."""
    import drjit as dr

    nodes, grid = len(how.pupil.at), how.spectrum
    index = types.Float64(dr.arange(types.Index, grid.shape[0] * nodes))
    row = dr.floor((index + 0.5) / dr.opaque(types.Float64, nodes))
    place = how.pupil.along(dr.fma(-row, dr.opaque(types.Float64, nodes), index), beam, types)
    waves = place * (row - grid.shape[0] // 2) * dr.opaque(types.Float64, -grid.dx)
    fourier = Field.from_waves(types.Float(1), waves, Grid((grid.shape[0], nodes), 1.0), types)
    matrix = types.Tensor(fourier.re, fourier.grid.shape), types.Tensor(fourier.im, fourier.grid.shape)
    samples = types.Tensor(u.re, (nodes, nodes)), types.Tensor(u.im, (nodes, nodes))
    re, im = complex_matmul(complex_matmul(matrix, samples), matrix, transposed=True)
    return Field(re.array, im.array, grid, types)
