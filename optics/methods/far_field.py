"""The Rayleigh-Sommerfeld integral by Fourier transforms, from points of the pupil to directions towards the window.

The window is the part of the sensor plane in which the PSF is computed. The kernel of the integral is a Fourier kernel
times a factor that varies slowly over the window. With the value of this factor at one point of the window, the
integral is a Fourier transform. It is computed for a few such points, the nodes, and interpolated between them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from optics.elements.beam import Beam
from optics.methods.far_field_nodes import WindowNodes, all_nodes, few_nodes
from optics.methods.problem import Problem
from optics.methods.pupil_edge import PupilEdge
from optics.numerics.autodiff import Array
from optics.numerics.cost import (
    CALL,
    DIRECTION_BYTES,
    ITEM_BYTES,
    MATMUL_FLOPS,
    PUPIL_SAMPLE,
    SPECTRUM_SAMPLE,
    WINDOW_SAMPLE,
)
from optics.numerics.field import Field
from optics.numerics.fourier import dft2, fast_length, predicted_bytes, predicted_seconds
from optics.numerics.grid import Grid
from optics.numerics.interpolation import LAGRANGE_8, TAPS, chebyshev_points, lagrange_basis, lagrange_weights
from optics.numerics.precision import Precision, opaque, padded_for_packets, precision

__all__ = ["FarFieldSampling", "far_field"]

MOST_DIRECTIONS = 4096  # choice, limited by memory: largest number of directions along an axis
STEEPEST_CORNER = 0.95  # choice: largest sine towards a corner of the window
GRAZING = 0.98  # choice: largest sine among the directions that interpolation at the window's rim needs
TRIED = 41  # choice: test positions between nodes, for each of 8 points on the rim
# Choice: numbers of nodes along an axis to try.
CHEBYSHEV_NODES = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16)
FEW = 2  # choice: up to this number of nodes along an axis, omitting nodes saves no time
POINTS = 150  # choice: points of the pupil at which the slow factors of nodes are compared


@dataclass(frozen=True)
class FarFieldSampling:
    """Samples of the pupil and of direction cosines, and nodes over the window.

    The pitch of the direction cosines is λ/(period · pitch), with the wavelength λ and the pitch of the pupil grid. The
    nodes are Chebyshev points in the angle atan(x/z), because the kernel as a function of x has poles at ±iz, with z
    the distance of the window.
    """

    edge: PupilEdge
    pupil: Grid
    directions: Grid
    period: int
    nodes: WindowNodes
    seconds: float
    bytes: float
    method: str = "far_field"
    model_error: float = 0.0

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Return the intensity over the window, for unit amplitude at the pupil, as a flat Dr.Jit array."""
        return _far_field(beam, problem, self, precision(problem.dtype))

    def plane(self, problem: Problem) -> float:
        """Return the width [m] of the square over which rounding errors are assumed to be evenly spread.

        `Sampling.plane` explains how the size of rounding errors follows from this width. The width is one period of
        the Fourier transform of the pupil's samples.
        """
        return problem.wavelength * problem.distance / self.pupil.dx

    @property
    def padding(self) -> float:
        return self.period / self.pupil.shape[0]

    @property
    def samples(self) -> tuple[int, int]:
        return self.pupil.shape


def far_field(problem: Problem) -> list[FarFieldSampling]:
    """Return a list with one sampling, or an empty list if the method is not suitable for the window.

    The sampling consists of samples of the pupil, directions towards the window, and a few points of the window
    (nodes). The field is computed for the directions. They are denser than the field requires, so that it can be
    interpolated between them. The slow factor, the ratio of the diffraction kernel to a Fourier kernel, is interpolated
    between the nodes.
    """
    half = problem.window.half_width
    sine = half / math.hypot(half, problem.distance)
    corner = math.sqrt(2) * half / math.hypot(half, half, problem.distance)
    count = _nodes_needed(problem, problem.ripple)
    if count is None or corner >= STEEPEST_CORNER:
        return []
    edge = problem.soft_edge(problem.turning)
    pitch = 1 / (problem.turning + edge.stopband)
    pupil = Grid.square(2 * math.ceil(edge.outermost / pitch) + 1, pitch)
    oversampling = math.pi / _step(problem.ripple / 2)  # relative to the Nyquist rate of the field
    # Interpolation needs directions beyond the window's rim, but they must not reach grazing incidence.
    finest = problem.wavelength * max(TAPS / (GRAZING - sine), TAPS / (GRAZING - corner))
    if finest / pitch >= MOST_DIRECTIONS:
        return []
    # The period is a whole number, so that the FFT can be used.
    period = fast_length(max(2 * oversampling * edge.outermost, finest) / pitch)
    step = problem.wavelength / (period * pitch)
    directions = Grid.square(2 * (math.ceil(sine / step) + TAPS) + 1, step)
    nodes = _nodes(problem, count)
    unknown = FarFieldSampling(edge, pupil, directions, period, nodes, 0.0, 0.0)
    return [replace(unknown, seconds=_seconds(unknown, problem), bytes=_bytes(unknown, problem.dtype))]


def _bytes(how: FarFieldSampling, dtype: str) -> float:
    item, directions = ITEM_BYTES[dtype], how.directions.shape[0] ** 2
    weights = directions * (how.nodes.count * (8 + 2 * item) + 2 * len(how.nodes.kept) * item + DIRECTION_BYTES)
    return weights + predicted_bytes(how.pupil.shape, how.directions.shape, item)


def _seconds(how: FarFieldSampling, problem: Problem) -> float:
    kept, count, directions = len(how.nodes.kept), how.nodes.count, how.directions.shape[0] ** 2
    once = predicted_seconds(how.pupil.shape, how.period, how.directions.shape) + CALL["far_field"]
    once += how.pupil.shape[0] ** 2 * PUPIL_SAMPLE + directions * SPECTRUM_SAMPLE
    products = directions * count**2 * (1 + 4 * kept)
    soft = how.pupil.shape[0] ** 2 * how.edge.seconds_per_point
    window = math.prod(problem.window.shape) * WINDOW_SAMPLE
    return kept * once + products / MATMUL_FLOPS[problem.dtype] + soft + window


def _nodes(problem: Problem, count: int) -> WindowNodes:
    """Return the nodes of the window at which the slow factor of `_far_field` must be evaluated.

    The slow factor is the ratio of the diffraction kernel to a Fourier kernel. The nodes are selected from a square of
    `count` x `count` Chebyshev points.
    """
    # The width of a single sample is 0, but the half angle must be positive.
    half_angle = math.atan2(max(problem.window.half_width, problem.window.dx), problem.distance)
    if count <= FEW:
        return all_nodes(count, half_angle)
    turns = (np.arange(POINTS) + 0.5) * (math.sqrt(5) - 1) / 2
    r = problem.radius * np.sqrt((np.arange(POINTS) + 0.5) / POINTS)
    x, y = (r * part(2 * np.pi * turns) for part in (np.cos, np.sin))
    at = half_angle * chebyshev_points(count)
    slow = _slow_part(problem, (x, y), at[None, :, None], problem.distance * np.tan(at)[:, None, None])
    return few_nodes(count, half_angle, slow, problem.ripple)


def _step(error: float) -> float:
    """Return the phase difference [rad] of neighbouring samples of a wave that leads to this interpolation error.

    The wave has the amplitude 1 and is interpolated by eight-point Lagrange polynomials. The difference is at most 1.5.
    """
    return min(1.5, (error / LAGRANGE_8) ** 0.125)


def _nodes_needed(problem: Problem, error: float) -> int | None:
    """Return how many Chebyshev nodes along an axis are sufficient to interpolate the slow factor.

    The slow factor is the ratio of the diffraction kernel to a Fourier kernel. The result is None if the largest number
    that is tried is not sufficient. Interpolation is tested for points on the rim of the aperture.
    """
    angle = np.linspace(0, 2 * np.pi, 8, endpoint=False)[:, None]
    rim_x, rim_y = problem.radius * np.cos(angle), problem.radius * np.sin(angle)
    half_angle = math.atan2(problem.window.half_width, problem.distance)
    rows = 0.0, problem.window.half_width

    def along(angles: np.ndarray) -> np.ndarray:
        return np.stack([_slow_part(problem, (rim_x, rim_y), half_angle * angles, row) for row in rows])

    exact = along(np.linspace(-1, 1, TRIED))
    for n in CHEBYSHEV_NODES:
        if np.abs(exact - along(chebyshev_points(n)) @ _between(n)).max() < error:
            return n
    return None


@lru_cache(maxsize=len(CHEBYSHEV_NODES))
def _between(n: int) -> np.ndarray:
    """Return weights that interpolate from n Chebyshev points to evenly spaced positions, array (point, position).

    The constant TRIED is the number of positions.
    """
    return lagrange_basis(np.linspace(-1, 1, TRIED), chebyshev_points(n))


def _slow_part(
    problem: Problem, points: tuple[np.ndarray, np.ndarray], angle: np.ndarray, y: np.ndarray | float
) -> np.ndarray:
    """Return the slow factor (ρ/D)² (1 + i/(kD)) exp(ik(D - ρ + s·ξ)) of light from ξ to P = (z tan(angle), y, z).

    D is the distance from the point ξ of the pupil to P, and ρ the distance from the pupil's centre to P. s contains
    the x and y components of the unit vector from the centre to P.

    points: points ξ (x, y) [m] of the pupil. All arrays are broadcast.
    """
    x = problem.distance * np.tan(angle)
    rho = np.sqrt(x * x + y * y + problem.distance**2)
    along = (x * points[0] + y * points[1]) / rho
    excess = points[0] ** 2 + points[1] ** 2 - 2 * rho * along
    distance = np.sqrt(rho**2 + excess)
    waves = (excess / (distance + rho) + along) / problem.wavelength
    near = problem.wavelength / (2 * np.pi * distance)
    found: np.ndarray = np.square(rho / distance) * (1 + 1j * near) * np.exp(2j * np.pi * waves)
    return found


def _far_field(beam: Beam, problem: Problem, how: FarFieldSampling, types: Precision) -> Array:
    """Return the intensity |U|² over the window, from the Rayleigh-Sommerfeld integral in the form

    U(x) = z/(λρ²) ∫ P(ξ) G(ξ; x) e^{-ik s·ξ} dξ,  G = (ρ/D)² (1/(kD) - i) e^{ik(D - ρ + s·ξ)},

    where ρ = |(x, z)|, D = |(x - ξ, z)|, s = x/ρ. P is the light behind the pupil. The slow factor G varies slowly with
    x, because its phase contains only Fresnel's quadratic term and smaller terms. G is evaluated at nodes x_ab. For
    each node, the integral is one Fourier transform. Between nodes, the integrals are interpolated.
    """
    import drjit as dr

    u = beam.behind(how.edge.aperture, how.pupil, types)
    dr.eval(u.re, u.im)
    s = how.directions.x
    cosine = np.sqrt(np.maximum(1 - s[:, None] ** 2 - s[None, :] ** 2, 1e-6))
    edge = math.asin(min(float(s[-1]), 0.999))  # the directions extend beyond the window, for the interpolation below
    weights = how.nodes.weights(np.clip(np.arctan2(s[None, :], cosine), -edge, edge), types.dtype)
    total_re, total_im = dr.zeros(types.Float, s.size**2), dr.zeros(types.Float, s.size**2)
    for (across, along), weight in zip(how.nodes.tangents, weights, strict=True):
        part = u * _slow_kernel(across, along, beam, how.pupil, types)
        part = dft2(part, how.period, how.directions.shape, -1, how.directions.dx)
        re, im = (types.Float(padded_for_packets(each)) for each in weight)
        total_re, total_im = total_re + re * part.re - im * part.im, total_im + re * part.im + im * part.re
        dr.eval(total_re, total_im)
    return _onto_window((total_re, total_im), beam, problem, how, types)


def _slow_kernel(tan_x: float, tan_y: float, beam: Beam, grid: Grid, types: Precision) -> Field:
    """Return the factor by which the diffraction kernel differs from a Fourier kernel, on the pupil's grid.

    This is the factor G(ξ; x) of the integrand in `_far_field`, apart from the constant -i. For a fixed point ξ of the
    pupil, it varies slowly with the point x of the window.

    tan_x, tan_y: tangents x/z and y/z of the point x of the window.
    """
    import drjit as dr

    px, py = grid.coordinates(types)
    wavelength = beam.wavelength / beam.index
    slant = math.sqrt(1 + tan_x**2 + tan_y**2)
    far = opaque(types, beam.distance) * opaque(types, slant)
    along = px * opaque(types, tan_x / slant) + py * opaque(types, tan_y / slant)
    excess = px * px + py * py - 2 * far * along
    distance = dr.sqrt(far * far + excess)
    waves = (excess / (distance + far) + along) * opaque(types, 1 / wavelength)
    near = opaque(types, wavelength / (2 * math.pi)) / distance
    size = dr.square(far / distance)
    return Field.from_waves(size, waves, grid, types) * Field(
        types.Float(dr.ones(types.Float64, dr.width(px))), types.Float(near), grid, types
    )


def _onto_window(
    parts: tuple[Array, Array], beam: Beam, problem: Problem, how: FarFieldSampling, types: Precision
) -> Array:
    """Return the intensity over the window, as a flat array.

    Eight-point Lagrange polynomials interpolate the field between the direction cosines for which it was computed.

    parts: real and imaginary part of the field at these direction cosines, flat arrays.
    """
    import drjit as dr

    x, y = problem.window.coordinates(types)
    z, side = opaque(types, beam.distance), how.directions.shape[0]
    rho = dr.sqrt(x * x + y * y + z * z)
    pitch, middle = opaque(types, 1 / how.directions.dx), dr.opaque(types.Float64, side // 2)
    cells, weights = [], []
    for position in (y, x):
        place = position / rho * pitch + middle
        cell = dr.clip(dr.floor(place), TAPS // 2 - 1, dr.opaque(types.Float64, side - TAPS // 2 - 1))
        cells.append(types.Index(cell) - (TAPS // 2 - 1))
        weights.append(lagrange_weights(types.Float(place - cell), TAPS))
    amplitude, columns = (
        types.Float(opaque(types, how.pupil.dx**2 / problem.wavelength) * z / (rho * rho)),
        dr.opaque(types.Index, side),
    )
    image = types.Float(0)
    for part in parts:
        found = types.Float(0)
        for i, down in enumerate(weights[0]):
            start, line = (cells[0] + i) * columns + cells[1], types.Float(0)
            for j, across in enumerate(weights[1]):
                line = dr.fma(across, dr.gather(types.Float, part, start + j), line)
            found = dr.fma(down, line, found)
        image = image + dr.square(amplitude * found)
    if problem.reach is not None:
        image = dr.select(x * x + y * y > opaque(types, problem.reach**2), 0, image)
    return image
