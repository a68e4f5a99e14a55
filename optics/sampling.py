"""Where each method samples pupil, spectrum and window, and what that costs."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from optics.aperture import EDGE_REACH, SoftDisk
from optics.fourier import fast_length, predicted_seconds
from optics.grid import Grid

__all__ = ["FarFieldSampling", "GridSampling", "NodeSampling", "Problem", "Sampling", "options"]

# Amplitude ripple of the soft aperture and of the spectral taper against the tolerance on intensity. The predicted
# error is half the tolerance; tests hold the actual one below it on random reliefs.
RIPPLE_PER_TOLERANCE = 0.3
# The taper must end this far from grazing incidence, where z tan θ has no bound.
STEEPEST_SINE = 0.9995
FADES = (0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0)  # blurs to try, in units of the problem's size
CHEBYSHEV_NODES = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16)


@dataclass(frozen=True)
class Problem:
    """One monochromatic propagation from a disk to a window, in numbers.

    radius, distance [m]; wavelength [m] in the medium; window: output grid.
    phase_band: highest spatial frequency [1/m] in the pupil's phase, over the disk and its soft edge.
    widest_band: frequencies beyond it may be dropped (infinite: whatever reaches the window counts).
    reach: distance from the axis [m] up to which the window counts (None: to its corners).
    fade_ripple: amplitude error allowed to light from beyond the band (None: as everywhere).
    """

    radius: float
    wavelength: float
    distance: float
    window: Grid
    phase_band: float
    tolerance: float
    dtype: str = "float32"
    widest_band: float = math.inf
    reach: float | None = None
    fade_ripple: float | None = None

    @property
    def ripple(self) -> float:
        return self.tolerance * RIPPLE_PER_TOLERANCE

    @property
    def outermost(self) -> float:
        return self.window.half_diagonal if self.reach is None else self.reach

    @property
    def fresnel_number(self) -> float:
        return self.radius**2 / (self.wavelength * self.distance)

    def band(self, margin: float = 0.0) -> float:
        """Highest frequency [1/m] whose light can come within `margin` of the window from anywhere on the disk."""
        reach = (1 + EDGE_REACH) * self.radius + self.outermost + margin
        return min(self.widest_band, reach / math.hypot(reach, self.distance) / self.wavelength)


@dataclass(frozen=True)
class Taper:
    """Where the spectrum fades out: from `band` over `width` [1/m], which blurs the field by `blur` [m].

    The fading is an error function whose derivative's transform falls to the ripple within the blur. What it removes
    must therefore land at least that far outside the window.
    """

    band: float
    width: float
    blur: float
    sine: float
    tangent: float

    @classmethod
    def of(cls, problem: Problem, blur: float) -> Taper:
        ripple = problem.ripple if problem.fade_ripple is None else problem.fade_ripple
        band, width = problem.band(blur), 2 * math.log(1 / ripple) / (math.pi * blur)
        sine = (band + width) * problem.wavelength
        return cls(band, width, blur, sine, sine / math.sqrt(max(1 - sine * sine, 1e-12)))

    @property
    def end(self) -> float:
        return self.band + self.width


@dataclass(frozen=True)
class GridSampling:
    """Samples of "angular_spectrum" and "split_angular_spectrum".

    period: width [m] after which the pupil plane repeats, in pupil_period samples; spectrum_samples lie 1/period apart.
    output_period: samples over the period of the plane that the last transform starts from or ends on.
    """

    method: str
    disk: SoftDisk
    taper: Taper
    period: float
    pupil_period: int
    output_period: int
    seconds: float = 0.0

    @property
    def pupil(self) -> Grid:
        """The samples that hold the soft disk."""
        pitch = self.period / self.pupil_period
        across = 2 * math.ceil((self.disk.radius + self.disk.reach) / pitch) + 1
        return Grid.square(min(self.pupil_period, across), pitch)

    @property
    def spectrum(self) -> Grid:
        return Grid.square(2 * math.ceil(self.taper.end * self.period) + 1, 1 / self.period)

    @property
    def relay(self) -> Grid:
        return Grid.square(self.output_period, self.period / self.output_period)

    @property
    def samples(self) -> tuple[int, int]:
        return self.pupil.shape

    @property
    def largest(self) -> int:
        """Side of the largest square array."""
        arrays = [self.pupil.shape[0], self.spectrum.shape[0]]
        return max([*arrays, self.output_period] if self.method.startswith("split") else arrays)


@dataclass(frozen=True)
class NodeSampling:
    """Gauss-Legendre nodes in radius times trapezoid nodes in angle."""

    radial: int
    angular: int
    seconds: float
    method: str = "rayleigh_sommerfeld"

    @property
    def samples(self) -> tuple[int, int]:
        return self.radial, self.angular

    @property
    def largest(self) -> int:
        return self.radial


@dataclass(frozen=True)
class FarFieldSampling:
    """Pupil samples, direction cosines (pitch 1/period of their transform), and nodes per axis over the window.

    The nodes are Chebyshev points in the angle atan(x/z) up to half_angle [rad]: in x the kernel has a pole at ±iz.
    """

    disk: SoftDisk
    pupil: Grid
    directions: Grid
    period: int
    nodes: int
    half_angle: float
    seconds: float
    method: str = "far_field"

    @property
    def samples(self) -> tuple[int, int]:
        return self.pupil.shape

    @property
    def largest(self) -> int:
        return max(self.pupil.shape[0], self.directions.shape[0])


Sampling = GridSampling | NodeSampling | FarFieldSampling


def options(problem: Problem, method: str) -> list[Sampling]:
    """Every sampling by which the method would meet the problem's tolerance."""
    if method == "rayleigh_sommerfeld":
        return [_nodes(problem)]
    if method == "far_field":
        return _far_field(problem)
    size = problem.radius + problem.outermost
    tapers = [Taper.of(problem, share * size) for share in FADES]
    make = _whole if method == "angular_spectrum" else _split
    return [make(problem, taper) for taper in tapers if taper.sine < STEEPEST_SINE]


def _soft_disk(problem: Problem, band: float) -> SoftDisk:
    return SoftDisk.cheapest(problem.radius, band, problem.ripple, EDGE_REACH * problem.radius)


def _whole(problem: Problem, taper: Taper) -> Sampling:
    """One period holds the window and all light that could wrap around into it."""
    disk = _soft_disk(problem, taper.end + problem.phase_band)
    beam = problem.radius + disk.reach + taper.blur + problem.distance * taper.tangent
    pitch = problem.window.dx
    output_period = fast_length(max(problem.window.half_width + beam, 2 * (problem.radius + disk.reach)) / pitch)
    period = output_period * pitch
    pupil_period = fast_length(period * (taper.end + disk.stopband + problem.phase_band))
    sampling = GridSampling("angular_spectrum", disk, taper, period, pupil_period, output_period)
    last = predicted_seconds(sampling.spectrum.shape, output_period, problem.window.shape)
    return _timed(sampling, last)


def _split(problem: Problem, taper: Taper) -> Sampling:
    """One period holds the pupil and the non-paraxial walk-off z (tan θ - sin θ)."""
    disk = _soft_disk(problem, taper.end + problem.phase_band)
    relay = problem.radius + disk.reach + taper.blur + problem.distance * (taper.tangent - taper.sine)
    period = 2 * relay
    pupil_period = fast_length(period * (taper.end + disk.stopband + problem.phase_band))
    reached = problem.window.half_width + relay + problem.distance * taper.sine
    relay_period = fast_length(period * reached / (problem.wavelength * problem.distance))
    sampling = GridSampling("split_angular_spectrum", disk, taper, period, pupil_period, relay_period)
    last = predicted_seconds(sampling.spectrum.shape, relay_period, sampling.relay.shape)
    last += predicted_seconds(sampling.relay.shape, 0.5, problem.window.shape)  # no whole period: a matrix
    return _timed(sampling, last)


def _timed(sampling: GridSampling, last: float) -> GridSampling:
    pupil, spectrum = sampling.pupil.shape, sampling.spectrum.shape
    seconds = predicted_seconds(pupil, sampling.pupil_period, spectrum) + last
    seconds += pupil[0] ** 2 * 6e-8 + spectrum[0] ** 2 * 2e-8 + 2e-3
    return GridSampling(**{**sampling.__dict__, "seconds": seconds})


def _nodes(problem: Problem) -> Sampling:
    """Enough nodes for the cycles that phase and path turn through."""
    cycles = problem.radius * (problem.phase_band + problem.band())
    digits = -math.log10(problem.ripple)
    radial = math.ceil(1.75 * cycles + 2 * digits + 4)
    angular = 2 * math.ceil(math.pi * cycles + 1.5 * digits * (1 + cycles ** (1 / 3)) + 4)
    pairs = radial * angular * problem.window.shape[0] * problem.window.shape[1]
    return NodeSampling(radial, angular, pairs / 1e8 + 5e-3)


def _far_field(problem: Problem) -> list[Sampling]:
    """Directions at twice the intensity's Nyquist rate; as many nodes as the kernel's slow part needs."""
    half = problem.window.half_width
    nodes = _nodes_needed(problem, problem.tolerance)
    if nodes is None or problem.tolerance < 1e-3:
        return []
    band = problem.outermost / math.hypot(problem.outermost, problem.distance) / problem.wavelength
    phase_band = problem.phase_band + (1 + EDGE_REACH) * problem.radius / (problem.wavelength * problem.distance)
    disk = _soft_disk(problem, band + phase_band)
    pitch = 1 / (band + disk.stopband + phase_band)
    pupil = Grid.square(2 * math.ceil((disk.radius + disk.reach) / pitch) + 1, pitch)
    period = fast_length(8 * problem.radius / pitch)  # a whole number, for the FFT
    step = problem.wavelength / (period * pitch)
    directions = Grid.square(2 * (math.ceil(half / math.hypot(half, problem.distance) / step) + 10) + 1, step)
    once = predicted_seconds(pupil.shape, period, directions.shape) + 2e-3
    once += pupil.shape[0] ** 2 * 6e-8 + directions.shape[0] ** 2 * 2e-8
    seconds = nodes**2 * once + math.prod(problem.window.shape) * 3e-7
    return [FarFieldSampling(disk, pupil, directions, period, nodes, math.atan2(half, problem.distance), seconds)]


def _nodes_needed(problem: Problem, error: float) -> int | None:
    """Chebyshev nodes along an axis that interpolate the far-field kernel's slow part, tried on the aperture's rim."""
    angle = np.linspace(0, 2 * np.pi, 8, endpoint=False)[:, None]
    rim_x, rim_y = problem.radius * np.cos(angle), problem.radius * np.sin(angle)
    half_angle = math.atan2(problem.window.half_width, problem.distance)
    test = half_angle * np.linspace(-1, 1, 41)
    for n in CHEBYSHEV_NODES:
        places = half_angle * chebyshev_nodes(n)
        weights = lagrange(test, places)
        worst = 0.0
        for across in (0.0, problem.window.half_width):
            exact, known = (_slow_part(problem, rim_x, rim_y, angles, across) for angles in (test, places))
            worst = max(worst, float(np.abs(exact - known @ weights).max()))
        if worst < error:
            return n
    return None


def _slow_part(problem: Problem, rim_x: np.ndarray, rim_y: np.ndarray, angle: np.ndarray, y: float) -> np.ndarray:
    """exp(ik(D - ρ + s·ξ)), D the distance from ξ to (z tan(angle), y, z), ρ that from the axis, s the direction."""
    x = problem.distance * np.tan(angle)
    rho = np.sqrt(x * x + y * y + problem.distance**2)
    along = (x * rim_x + y * rim_y) / rho
    excess = problem.radius**2 - 2 * rho * along
    distance = excess / (np.sqrt(rho**2 + excess) + rho)
    return np.exp(2j * np.pi / problem.wavelength * (distance + along))


def chebyshev_nodes(n: int) -> np.ndarray:
    """Chebyshev points of the first kind on [-1, 1]."""
    return np.cos(np.pi * (np.arange(n) + 0.5) / n)


def lagrange(x: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """(node, *x.shape): the Lagrange polynomials of the nodes at x."""
    basis = np.ones((len(nodes), *np.shape(x)))
    for i, node in enumerate(nodes):
        for other in np.delete(nodes, i):
            basis[i] *= (x - other) / (node - other)
    return basis
