"""Ray methods without diffraction and interference: the density of rays behind a pupil, and the ideal pinhole."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from optics.apertures.aperture import Aperture
from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.methods.rayleigh_sommerfeld import cached_nodes, node_count
from optics.methods.rays import brightness, mismatch
from optics.numerics.autodiff import Array, is_differentiable, number
from optics.numerics.cost import CALL, RAY, RAY_BYTES
from optics.numerics.device import VARIABLE, device
from optics.numerics.precision import Precision, opaque, padded_for_packets, precision

__all__ = ["PinholeSampling", "RaySampling", "geometric", "pinhole"]

# Choice: step, in pupil radii, of the central differences for the local slope. Their error is the square of the step
# times a third derivative.
STEP = 1e-4
DIGITS = 1.0  # choice: digits of the quadrature rule, at the highest frequency of a splat, a B-spline around a ray
# Relative L2 size of the Fresnel fringes behind an edge, for a disk of Fresnel number 1. It falls with the fourth root
# of the Fresnel number.
FRINGES = 0.75
SPLAT_CELLS = 3.3  # area of a splat: (∫β²)⁻², with the quadratic B-spline β


class NoDerivativesError(ValueError):
    """A method cannot compute derivatives on the selected device."""


@dataclass(frozen=True)
class RaySampling:
    """Rays from quadrature nodes that are fitted to the edge of the aperture.

    rule: the aperture, the largest frequency [cycles per pupil radius] that the nodes resolve, and the accuracy of sums
        over the nodes [decimal digits].
    count: number of nodes.
    model_error: relative L2 error that the intensity has because rays replace waves.
    """

    rule: tuple[Aperture, float, float]
    count: int
    model_error: float
    seconds: float
    bytes: float
    method: str = "geometric"
    padding: float = 1.0

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Return the power per area at each sample of the window, as a flat Dr.Jit array.

        The intensity at the pupil is 1.

        Raises:
            NoDerivativesError: derivatives are required on a GPU. There, Dr.Jit computes reciprocals of float64
                numbers in derivatives with errors of 1e-6. The directions of rays are computed from small differences
                between optical paths, and this magnifies the errors to 1e-2.
        """
        import drjit as dr

        types = precision(problem.dtype)
        radius, nodes = opaque(types, beam.radius), cached_nodes(*self.rule)
        x, y = types.Float64(nodes.x) * radius, types.Float64(nodes.y) * radius
        weight = types.Float64(nodes.weight) * dr.square(radius)
        if beam.pupil.mask is not None:
            weight *= dr.square(beam.pupil.amplitude(types.Float64(nodes.x), types.Float64(nodes.y)))
        x, y, propagates = _landings(beam, x, y, types)
        if device() == "cuda" and dr.grad_enabled(x, y):
            raise NoDerivativesError(
                f"method = 'geometric': has no derivatives on a GPU; use 'exact' or {VARIABLE}=cpu"
            )
        return _splat(x, y, dr.select(propagates, weight, 0), problem, types)

    def plane(self, problem: Problem) -> float:
        """Return the width [m] of the square over which rounding errors are assumed to be evenly spread.

        The intensity of rounding errors is their power divided by the area of this square, see `Sampling.plane`. Here,
        the width is infinite, so these errors count as zero. Rounding errors shift rays, but do not scatter light over
        the window.
        """
        return math.inf

    @property
    def samples(self) -> tuple[int, int]:
        return self.count, 1


@dataclass(frozen=True)
class PinholeSampling:
    """Plan for a PSF with all light in one sample of the window.

    This is the sample closest to the point that the ray through the pupil's centre hits.
    """

    model_error: float
    seconds: float = CALL["pinhole"]
    method: str = "pinhole"
    samples: tuple[int, int] = (1, 1)
    bytes: float = 0.0
    padding: float = 1.0

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Return the power per area at each sample of the window, as a flat Dr.Jit array.

        The intensity at the pupil is 1.

        Raises:
            ValueError: derivatives are requested. The intensity has none: when the ray through the pupil's centre
                moves, all light jumps from one sample of the window to the next.
        """
        import drjit as dr

        types = precision(problem.dtype)
        zero = types.Float64(0)
        x, y, propagates = _landings(beam, zero, zero, types)
        passed = beam.pupil.transmission
        if dr.grad_enabled(x, y, passed) or is_differentiable(beam.radius):
            raise ValueError("method = 'pinhole': has no derivatives; use 'geometric' or a wave method")
        window = problem.window
        column, row = (round((float(at[0]) - first) / window.dx) for at, first in ((x, window.x[0]), (y, window.y[0])))
        image = np.zeros(window.shape, dtype=types.dtype)
        if 0 <= row < window.shape[0] and 0 <= column < window.shape[1] and bool(propagates[0]):
            image[row, column] = beam.pupil.area * number(passed) / window.dx**2
        return types.Float(padded_for_packets(image))

    def plane(self, problem: Problem) -> float:
        """Return the width [m] of the square over which rounding errors are assumed to be evenly spread.

        The intensity of rounding errors is their power divided by the area of this square, see `Sampling.plane`. Here,
        the width is infinite, so these errors count as zero. The reason is that all light is in one sample of the
        window, and the other samples are exactly 0.
        """
        return math.inf


def geometric(problem: Problem) -> list[RaySampling]:
    """Return a list with one sampling, which has enough rays for a smooth image.

    The list is empty if the pupil's relief consists of pixels, because these scatter light away from rays. Every ray is
    spread by a quadratic B-spline over the window's cells. The spectrum of the spline falls like (πf dx)⁻³, so it is
    below the error ε beyond f = ε^(-1/3)/(π dx). ε is a tenth of the tolerance or a hundredth of the model error,
    whichever is larger. The rays are dense enough for this frequency: their hit points are closer together than the
    window's pitch.
    """
    rays = problem.rays
    if rays is None:
        return []
    model = _ray_error(problem)
    error = max(problem.tolerance, model / 10) / 10
    stretch = float(rays.most.max()) if len(rays) else 1.0
    cycles = problem.radius * stretch / (math.pi * problem.window.dx) * error ** (-1 / 3)
    # Rounded up to one of a few values, so that cached rules are used.
    cycles = 2 ** (math.ceil(4 * math.log2(max(cycles, 1.0))) / 4)
    count = node_count(problem.aperture, cycles, DIGITS)
    seconds = CALL["geometric"] + count * RAY
    return [RaySampling((problem.aperture, cycles, DIGITS), count, model, seconds, count * RAY_BYTES)]


def pinhole(problem: Problem) -> list[PinholeSampling]:
    """Return a list with the sampling that puts all light into one sample of the window.

    The list is empty if the pupil's relief consists of pixels. The value of the sample is the mean
    intensity over a cell, the square around the sample. Samples of the exact PSF are intensities at points. Even if the
    exact PSF is smaller than a cell, they differ from the mean. The predicted error therefore always exceeds 100 %, and
    "auto" never chooses this method.
    """
    if problem.pixelated is not None:
        return []
    cell = problem.window.dx**2
    return [PinholeSampling(mismatch(1 / cell, _brightness(problem)))]


def _landings(beam: Beam, x: Array, y: Array, types: Precision) -> tuple[Array, Array, Array]:
    """Return the points (x, y) where rays from points of the pupil hit the sensor, and a mask of rays that propagate.

    The hit points are x + z p/√(1 - p²). p is the gradient of the optical path, divided by the index of the medium.
    """
    import drjit as dr

    step = opaque(types, STEP * beam.pupil.radius)
    scale = opaque(types, beam.wavelength / beam.index) / (2 * step)
    px = (beam.waves(x + step, y) - beam.waves(x - step, y)) * scale
    py = (beam.waves(x, y + step) - beam.waves(x, y - step)) * scale
    squared = px * px + py * py
    propagates = squared < 1 - 1e-9
    # dr.rsqrt has an error of 1e-6 on a GPU, also in float64.
    tangent = opaque(types, beam.distance) / dr.sqrt(dr.select(propagates, 1 - squared, 1))
    return x + tangent * px, y + tangent * py, propagates


def _splat(x: Array, y: Array, weight: Array, problem: Problem, types: Precision) -> Array:
    """Return a flat array with the sum of the weights that land in each cell of the window, divided by a cell's area.

    A quadratic B-spline spreads each weight over 3 x 3 cells. The nine parts add up to the weight, so power is lost
    only beyond the rim of the window.
    """
    import drjit as dr

    window, (height, width) = problem.window, problem.window.shape
    image = dr.zeros(types.Float64, height * width)
    places = []
    for at, first, n in ((x, window.x[0], width), (y, window.y[0], height)):
        place = (at - opaque(types, first)) * opaque(types, 1 / window.dx)
        place = dr.clip(place, -10, n + 10.0)  # far outside the window, but within the range of the index type
        cell = dr.detach(dr.round(place))
        places.append((cell, _quadratic_basis(place - cell)))
    (column, across), (row, along) = places
    columns = opaque(types, width)
    for i, down in enumerate(along):
        for j, over in enumerate(across):
            r, c = row + (i - 1), column + (j - 1)
            within = (r >= 0) & (r < height) & (c >= 0) & (c < width)
            target = types.Index(dr.select(within, dr.fma(r, columns, c), 0))
            dr.scatter_add(image, weight * down * over, target, within)
    return types.Float(image * opaque(types, 1 / window.dx**2))


def _quadratic_basis(t: Array) -> tuple[Array, Array, Array]:
    """Return the three uniform quadratic B-splines that are not zero at a distance t from a sample of the window.

    t is in units of the pitch, in [-1/2, 1/2]. The splines are those of the preceding sample, this one, and the next.
    """
    return (0.5 - t) * (0.5 - t) / 2, 0.75 - t * t, (0.5 + t) * (0.5 + t) / 2


def _ray_error(problem: Problem) -> float:
    """Return the relative L2 error of an intensity that is computed from the density of rays.

    Rays lack the fringes of diffraction along the rim of the shadow. The intensity is therefore wrong in a strip
    along this rim. The strip is as wide as a Fresnel zone plus a cell of the window, because each ray is spread over
    cells. The error exceeds 1 if rays cross, if a mask scatters light, or if the rays hit so small an area that
    diffraction or the size of a cell determines the spot.

    Let m be the magnification of the rays, the size of the shadow divided by that of the pupil. The fringes are then m
    times as large as the fringes that the pupil would have at the distance z/m without a lens. The reason is that a
    quadratic phase only scales Fresnel's integral (Goodman, eq. 4-17).
    """
    rays, cell = problem.rays, problem.window.dx**2
    assert rays is not None
    blurred = mismatch(1 / (rays.image_area + SPLAT_CELLS * cell), _brightness(problem))
    if len(rays) == 0 or rays.folded or problem.masked:
        return blurred
    stretch = float(np.mean(1 / np.maximum(rays.least, 1e-12)))
    zone = math.sqrt(problem.wavelength * problem.distance * stretch) + problem.window.dx * stretch
    # Size of the aperture: twice the area per length of edge. It is R for a disk.
    narrow = 2 * problem.aperture.area / problem.aperture.outline.length
    size = problem.radius * min(math.sqrt(problem.aperture.area / math.pi), narrow)
    return FRINGES * math.sqrt(zone / size) if zone < size else blurred


def _brightness(problem: Problem) -> float:
    """Return the brightness of the exact PSF, see `rays.brightness`.

    The area of the PSF is estimated as the area that rays hit, plus the area of the diffraction spot.
    """
    assert problem.rays is not None
    diffracted = math.pi * (problem.wavelength * problem.distance / (2 * problem.radius)) ** 2
    return brightness(problem.rays.image_area + diffracted, problem.window.dx**2)
