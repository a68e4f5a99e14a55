"""The ray methods: density of rays behind a pupil, and the perfect pinhole. No diffraction, no interference."""

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
from optics.numerics.cost import CALL, RAY
from optics.numerics.device import VARIABLE, device
from optics.numerics.precision import Precision, opaque, padded_for_packets, precision

__all__ = ["PinholeSampling", "RaySampling", "geometric", "pinhole"]

# Choice. Step of the central differences that give the local slope, in pupil radii: they err by its square times a
# cubic term.
STEP = 1e-4
DIGITS = 1.0  # choice: of the rule of nodes, for the fastest that the splats' spectra turn
# Relative L2 of Fresnel's fringes behind an edge, over a disk of Fresnel number 1: they fall with its fourth root.
FRINGES = 0.75
SPLAT_CELLS = 3.3  # area of a splat, as its inverse mean square: (∫β²)⁻² of the quadratic B-spline β


class NoDerivativesError(ValueError):
    """A method has no derivatives where it computes."""


@dataclass(frozen=True)
class RaySampling:
    """Edge-fitted rays, and the error of the intensity that rays instead of waves make."""

    rule: tuple[Aperture, float, float]
    count: int
    model_error: float
    seconds: float
    method: str = "geometric"
    padding: float = 1.0

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Power per area over the window for unit intensity at the pupil, a flat Dr.Jit array.

        Raises:
            NoDerivativesError: they are asked for on a GPU. Rules of Dr.Jit's that take the reciprocal of a float64
                err by 1e-6 there, and by 1e-2 in directions, which are differences of paths.
        """
        import drjit as dr

        types = precision(problem.dtype)
        radius, nodes = opaque(types, beam.radius), cached_nodes(*self.rule)
        x, y = types.Float64(nodes.x) * radius, types.Float64(nodes.y) * radius
        weight = types.Float64(nodes.weight) * dr.square(radius)
        if beam.pupil.mask is not None:
            weight *= dr.square(beam.pupil.amplitude(types.Float64(nodes.x), types.Float64(nodes.y), types))
        x, y, propagates = _landings(beam, x, y, types)
        if device() == "cuda" and dr.grad_enabled(x, y):
            raise NoDerivativesError(
                f"method = 'geometric': has no derivatives on a GPU; ask for 'exact', or for {VARIABLE}=cpu"
            )
        return _splat(x, y, dr.select(propagates, weight, 0), problem, types)

    def plane(self, problem: Problem) -> float:
        """Rounding does not spread rays."""
        return math.inf

    @property
    def samples(self) -> tuple[int, int]:
        return self.count, 1

    @property
    def largest(self) -> int:
        """Each ray has four numbers."""
        return 2 * math.ceil(math.sqrt(self.count))


@dataclass(frozen=True)
class PinholeSampling:
    """All light in the cell where the ray through the pupil's centre ends."""

    model_error: float
    seconds: float = CALL["pinhole"]
    method: str = "pinhole"
    samples: tuple[int, int] = (1, 1)
    largest: int = 1
    padding: float = 1.0

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Power per area over the window for unit intensity at the pupil, a flat Dr.Jit array.

        Raises:
            ValueError: derivatives are asked for; a light's cell does not change smoothly.
        """
        import drjit as dr

        types = precision(problem.dtype)
        zero = types.Float64(0)
        x, y, propagates = _landings(beam, zero, zero, types)
        passed = beam.pupil.transmission
        if dr.grad_enabled(x, y, passed) or is_differentiable(beam.radius):
            raise ValueError("method = 'pinhole': has no derivatives; ask for 'geometric' or a wave method")
        window = problem.window
        column, row = (round((float(at[0]) - first) / window.dx) for at, first in ((x, window.x[0]), (y, window.y[0])))
        image = np.zeros(window.shape, dtype=types.dtype)
        if 0 <= row < window.shape[0] and 0 <= column < window.shape[1] and bool(propagates[0]):
            image[row, column] = beam.pupil.area * number(passed) / window.dx**2
        return types.Float(padded_for_packets(image))

    def plane(self, problem: Problem) -> float:
        """Nothing rounds."""
        return math.inf


def geometric(problem: Problem) -> list[RaySampling]:
    """Enough rays that their splats join to a smooth picture: node spacing after stretching below the window's pitch.

    A quadratic B-spline's spectrum falls like (πf dx)⁻³: beyond f = error^(-1/3)/(π dx) it is negligible.
    """
    rays = problem.rays
    if rays is None:
        return []
    model = _ray_error(problem)
    error = max(problem.tolerance, model / 10) / 10
    stretch = float(rays.most.max()) if len(rays) else 1.0
    cycles = problem.radius * stretch / (math.pi * problem.window.dx) * error ** (-1 / 3)
    cycles = 2 ** (math.ceil(4 * math.log2(max(cycles, 1.0))) / 4)  # few different rules, so that they are found again
    count = node_count(problem.aperture, cycles, DIGITS)
    seconds = CALL["geometric"] + count * RAY
    return [RaySampling((problem.aperture, cycles, DIGITS), count, model, seconds)]


def pinhole(problem: Problem) -> list[PinholeSampling]:
    """One sample holds all light. Against samples of the exact PSF that is wrong by all of it, however small the PSF
    is: they are intensities at points, not means over cells. So "auto" never takes it."""
    if problem.pixelated is not None:
        return []
    cell = problem.window.dx**2
    return [PinholeSampling(mismatch(1 / cell, _brightness(problem)))]


def _landings(beam: Beam, x: Array, y: Array, types: Precision) -> tuple[Array, Array, Array]:
    """Where rays from points (x, y) of the pupil meet the sensor: x + z p/√(1 - p²), p the gradient of the path; and
    which of them propagate."""
    import drjit as dr

    step = opaque(types, STEP * beam.pupil.radius)
    scale = opaque(types, beam.wavelength / beam.index) / (2 * step)
    px = (beam.waves(x + step, y, types) - beam.waves(x - step, y, types)) * scale
    py = (beam.waves(x, y + step, types) - beam.waves(x, y - step, types)) * scale
    squared = px * px + py * py
    propagates = squared < 1 - 1e-9
    # dr.rsqrt errs by 1e-6 on a GPU, also in float64.
    tangent = opaque(types, beam.distance) / dr.sqrt(dr.select(propagates, 1 - squared, 1))
    return x + tangent * px, y + tangent * py, propagates


def _splat(x: Array, y: Array, weight: Array, problem: Problem, types: Precision) -> Array:
    """Sum of weights over the window's cells per area, each under a quadratic B-spline three cells wide: its nine
    shares add up to 1, so that no power is lost but over the window's rim."""
    import drjit as dr

    window, (height, width) = problem.window, problem.window.shape
    image = dr.zeros(types.Float64, height * width)
    places = []
    for at, first, n in ((x, window.x[0], width), (y, window.y[0], height)):
        place = (at - opaque(types, first)) * opaque(types, 1 / window.dx)
        place = dr.clip(place, -10, n + 10.0)  # far outside, and within the index type
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
    """The three uniform quadratic B-splines that act within half a cell of a sample, t in [-1/2, 1/2]."""
    return (0.5 - t) * (0.5 - t) / 2, 0.75 - t * t, (0.5 + t) * (0.5 + t) / 2


def _ray_error(problem: Problem) -> float:
    """Relative L2 error of the ray density: fringes along the shadow's rim, one Fresnel zone or a cell wide; all of it
    where rays cross, or end in a place smaller than diffraction or cells allow.

    Behind an edge stretched by m, light looks as behind an open edge at z/m, magnified by m: a quadratic phase only
    scales Fresnel's integral (Goodman, eq. 4-17).
    """
    rays, cell = problem.rays, problem.window.dx**2
    assert rays is not None
    blurred = mismatch(1 / (rays.image_area + SPLAT_CELLS * cell), _brightness(problem))
    if len(rays) == 0 or rays.folded or problem.masked:
        return blurred
    stretch = float(np.mean(1 / np.maximum(rays.least, 1e-12)))
    zone = math.sqrt(problem.wavelength * problem.distance * stretch) + problem.window.dx * stretch
    # Of a disk R; of narrow or cut openings, twice the area for each length of edge.
    narrow = 2 * problem.aperture.area / problem.aperture.outline.length
    size = problem.radius * min(math.sqrt(problem.aperture.area / math.pi), narrow)
    return FRINGES * math.sqrt(zone / size) if zone < size else blurred


def _brightness(problem: Problem) -> float:
    """Of the light where rays and diffraction spread it."""
    assert problem.rays is not None
    diffracted = math.pi * (problem.wavelength * problem.distance / (2 * problem.radius)) ** 2
    return brightness(problem.rays.image_area + diffracted, problem.window.dx**2)
