"""The transmittance of a pupil of pixels after a low-pass filter, for samples on a grid.

The phase of a relief of pixels jumps at their borders, so its spectrum has no band limit. Convolution with a kernel
softens the jumps, as it softens the edge of an aperture. The kernel does not change the frequencies of light that can
reach the next plane. It is the product of a kernel along x and one along y, so that two matrix products evaluate the
convolution. One convolution softens the jumps and the edge of the aperture together. Softening them one after the other
would be wrong, because the product of two softened functions differs from their softened product.

The convolution is a sum over quadrature nodes within the pixels (`optics.apertures.pixelated`). The nodes resolve every
frequency of the kernel within each pixel. Large pixels are divided into several smaller ones for this purpose.

On a tilted pupil, samples that are evenly spaced in a plane perpendicular to the axis have the coordinates x' = a x + b
y and y' = b x + d y along the pupil. If b is not 0, the convolution is evaluated along x first and then along y. In
each of these two steps, the samples along one coordinate are shifted by an amount proportional to the other coordinate
(a shear). Phase factors on a spectrum produce the shifts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from optics.apertures.pixelated import MOMENT_DIGITS, PixelatedAperture
from optics.apertures.soft_edge import SoftEdge
from optics.elements.beam import Beam
from optics.elements.pupil import Pupil
from optics.numerics.accuracy import FLOAT_NOISE, MOST_SAMPLES, AccuracyError
from optics.numerics.array_library import like
from optics.numerics.autodiff import carries_derivative, grad_enabled
from optics.numerics.field import Field
from optics.numerics.grid import Grid, sample_positions
from optics.numerics.precision import Precision, padded_for_packets
from optics.propagation.field_derivatives import LinearMap, mapped
from optics.propagation.misalignment import Alignment

__all__ = ["SoftPixels"]

# Choice: ripple of the kernel and error of the nodes, relative to `ripple`, as a bound of the intensity's error.
RIPPLES = 8.0


@dataclass(frozen=True, eq=False)
class SoftPixels:
    """Convolution of the transmittance of a pupil that consists of pixels with a kernel, which softens all edges.

    Lengths are in radii R of the pupil, frequencies in cycles per R.

    edge: kernel along one axis; the same kernel is used along x and along y.
    aperture: opening of the pupil, divided into quadrature cells. A cell is a pixel or a part of one.
    across: number of quadrature nodes along a side of a cell.
    ripple: largest deviation of the kernel's spectrum from 1 in the passband and from 0 in the stopband.
    alignment: position of the pupil. If the pupil is tilted, samples are farther apart along the pupil than in a plane
        perpendicular to the axis.
    """

    edge: SoftEdge
    aperture: PixelatedAperture
    across: int
    ripple: float
    alignment: Alignment

    @classmethod
    def from_pupil(
        cls, pupil: Pupil, passband: float, ripple: float, widest_reach: float, alignment: Alignment
    ) -> SoftPixels:
        """Return the filter that leaves frequencies up to `passband` unchanged along x and y, to within `ripple`.

        widest_reach: largest distance beyond the aperture's edge at which the softened transmittance may differ from 0.

        Raises:
            ValueError: the radius of the pupil carries a derivative.
            AccuracyError: the convolution needs too many quadrature nodes within the pixels.
        """
        if carries_derivative(pupil.aperture_radius):
            raise ValueError(
                "aperture_radius: must be a plain number for a PixelRelief in a system, without derivative"
            )
        stretch = _stretch(alignment)
        edge = SoftEdge.cheapest(stretch * passband, ripple, widest_reach / stretch, pupil.aperture.half_widths)
        parts, most = 1, MOST_SAMPLES // pupil.pixels
        while parts <= most:
            aperture = PixelatedAperture(pupil.aperture, pupil.pixels * parts)
            # Errors of nodes repeat with the spectrum of the lattice, so they add up over its periods.
            digits = -math.log10(ripple) + math.log10(max(1.0, 2 * edge.stopband * aperture.widest))
            across = aperture.nodes_across(edge.stopband, digits)
            if across is not None and across * parts <= most:
                return cls(edge, aperture, across, ripple, alignment)
            parts += 1
        raise AccuracyError(
            f"{pupil.pixels} x {pupil.pixels} pixels over a radius of {pupil.radius:.3g} m need more than "
            f"{MOST_SAMPLES} nodes across: widen the tolerance, or move the adjacent planes further away"
        )

    @property
    def stopband(self) -> float:
        """Highest frequency of the softened transmittance, in cycles per R.

        Positions are measured in a plane perpendicular to the axis. R is the radius of the pupil.
        """
        return _stretch(self.alignment) * self.edge.stopband

    @property
    def reach(self) -> float:
        """Largest distance from the aperture at which the softened transmittance is not 0, in radii of the pupil."""
        return _stretch(self.alignment) * self.edge.reach

    def error(self, dtype: str) -> float:
        """Return the relative error of the intensity behind the softened pupil.

        The pupil's transmittance is softened by convolution with a kernel. The error has four causes: the kernel
        slightly changes the amplitudes of frequencies that should pass unchanged, the convolution is a sum over nodes
        instead of an integral, the aperture's edge cuts pixels, and numbers are rounded.
        """
        periods = max(1.0, 2 * self.edge.stopband * self.aperture.widest)
        cut = 2 * periods * self.aperture.cut_share * 10.0**-MOMENT_DIGITS
        return RIPPLES * self.ripple + cut + 2 * FLOAT_NOISE[dtype]

    def behind(self, beam: Beam, grid: Grid, types: Precision) -> Field:
        """Return the field just behind the pupil at the samples of a grid about the pupil's centre."""
        pupil, at = beam.pupil, self.aperture.rows(self.across)
        x, y = (types.Float64(padded_for_packets(axis)) for axis in np.meshgrid(at, at))
        turns = like(x, pupil.index_step(beam.wavelength)) * like(x, 1 / beam.wavelength)
        weights = types.Float64(padded_for_packets(self.aperture.weights(self.across)))
        nodes = Field.from_waves(weights, turns * pupil.height.height(x, y), Grid.square(len(at), 1.0), types)
        filters = self._filters(grid, pupil.radius, types)
        soft, linear = filters.forward(nodes.numpy()), None
        if grad_enabled([nodes.re, nodes.im]):
            linear = LinearMap(filters.forward, filters.adjoint)
        found = Field.from_numpy(soft, grid.dx, types) if linear is None else mapped(nodes, soft, grid, linear)
        level, places = replace(beam, pupil=pupil.level), self.alignment.on_element(*grid.coordinates(types), types)
        amplitude = types.Float64(1.0)
        if pupil.mask is not None:
            amplitude = pupil.amplitude(*(place * like(place, 1 / pupil.radius) for place in places))
        return Field.from_waves(amplitude, level.waves(*places), grid, types) * found

    def _filters(self, grid: Grid, radius: float, types: Precision) -> _Filters:
        (sx, sy), steep = self.alignment.slope, self.alignment.steepness
        bent = (math.hypot(1, steep) - 1) / steep**2 if steep else 0.0
        a, b, d = 1 + bent * sx * sx, bent * sx * sy, 1 + bent * sy * sy  # see the module
        at, nodes = sample_positions(grid.shape[0], grid.dx) / radius, self.aperture.rows(self.across)
        along_x = _Filter.between(self.edge, (a - b * b / d) * at, nodes, b / d * nodes, types)
        along_y = _Filter.between(self.edge, d * at, nodes, b * at, types)
        return _Filters(along_x, along_y)


@dataclass(frozen=True, eq=False)
class _Filter:
    """Convolution along one axis, which computes values at samples of a grid from values at quadrature nodes.

    It is applied for each position along the other axis.

    matrix: values of the kernel (sample, node); None if the samples are shifted by an amount that depends on the
        position along the other axis.
    factors: three arrays that replace the matrix in this case. The first, (frequency, node), transforms values at the
        nodes to a spectrum. The second, (frequency, position), multiplies the spectrum by that of the kernel and shifts
        the samples. The third, (sample, frequency), transforms the spectrum to values at the samples.
    """

    matrix: np.ndarray | None
    factors: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None

    @classmethod
    def between(
        cls, edge: SoftEdge, samples: np.ndarray, nodes: np.ndarray, shifts: np.ndarray, types: Precision
    ) -> _Filter:
        """Return the filter along one axis that computes values at the positions `samples` from values at `nodes`.

        shifts: for each position along the other axis, the distance by which all samples are shifted.
        """
        if not shifts.any():
            return cls(edge.line(np.subtract.outer(samples, nodes)).astype(types.dtype))
        farthest = np.abs(samples).max() + np.abs(shifts).max() + np.abs(nodes).max()
        period = farthest + edge.reach
        orders = np.arange(-(most := math.ceil(edge.stopband * period)), most + 1)
        step = -2j * np.pi / period
        response = edge.line_response(orders / period) / period
        from_nodes, back, onto = (np.exp(step * np.multiply.outer(orders, at)) for at in (nodes, -shifts, -samples))
        dtype = types.complex_dtype
        return cls(None, (from_nodes.astype(dtype), (response[:, None] * back).astype(dtype), onto.T.astype(dtype)))

    def forward(self, values: np.ndarray) -> np.ndarray:
        """Return the filtered values at the samples, given values at the nodes.

        The filter acts along x or along y. Samples and nodes lie along this axis, and positions along the axis
        perpendicular to it. The filter is applied for each position along the perpendicular axis. The result is an
        array (sample, position), and `values` is an array (node, position).
        """
        if self.matrix is not None:
            return _product(self.matrix, values)
        assert self.factors is not None
        from_nodes, shifts, onto_samples = self.factors
        found: np.ndarray = onto_samples @ (shifts * (from_nodes @ values))
        return found

    def adjoint(self, values: np.ndarray) -> np.ndarray:
        """Apply the adjoint of the linear map `forward` to values at the samples, and return values at the nodes.

        The filter acts along x or along y. It computes values at samples of a grid from values at quadrature nodes.
        Samples and nodes lie along its axis, and positions along the axis perpendicular to it. The adjoint is applied
        for each position along the perpendicular axis. `values` is an array (sample, position), and the result is an
        array (node, position).
        """
        if self.matrix is not None:
            return _product(self.matrix.T, values)
        assert self.factors is not None
        from_nodes, shifts, onto_samples = self.factors
        found: np.ndarray = from_nodes.conj().T @ (shifts.conj() * (onto_samples.conj().T @ values))
        return found


@dataclass(frozen=True, eq=False)
class _Filters:
    """Filters along x and along y, which map values at nodes (y, x) to values at samples (y, x)."""

    along_x: _Filter
    along_y: _Filter

    def forward(self, values: np.ndarray) -> np.ndarray:
        return self.along_y.forward(self.along_x.forward(values.T).T)

    def adjoint(self, values: np.ndarray) -> np.ndarray:
        return self.along_x.adjoint(self.along_y.adjoint(values).T).T


def _product(matrix: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the product of a real and a complex matrix, which takes half the time of a complex product."""
    pairs = np.ascontiguousarray(values).view(matrix.dtype)
    found: np.ndarray = (matrix @ pairs).view(values.dtype)
    return found


def _stretch(alignment: Alignment) -> float:
    """Return an upper bound of distances along a tilted pupil, relative to those in a plane perpendicular to the axis.

    Let s be the tangent of the tilt. Distances grow by a factor of at most 1 + s²/2. The bound also allows for two
    shears, in which samples along one coordinate are shifted in proportion to the other coordinate. Each shift is at
    most s²/4 times the other coordinate.
    """
    return 1 + alignment.steepness**2
