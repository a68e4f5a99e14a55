"""From the pupil's field to the light on the sensor, by the sampling that the planner chose."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.aperture import SoftDisk
from optics.field import Field
from optics.fourier import dft2
from optics.grid import Grid
from optics.precision import Precision, opaque, precision
from optics.pupil import Pupil
from optics.sampling import FarFieldSampling, GridSampling, NodeSampling, Problem, Sampling, chebyshev_nodes, lagrange
from optics.source import PointSource

__all__ = ["Beam", "intensity"]


@dataclass(frozen=True)
class Beam:
    """Light of one vacuum wavelength [m] from a source through a pupil."""

    pupil: Pupil
    source: PointSource
    wavelength: float

    def waves(self, x: Any, y: Any, types: Precision) -> Any:
        """Optical path in wavelengths at the pupil's points, float64."""
        return self.pupil.path(x, y, self.wavelength, self.source, types) * opaque(types, 1 / self.wavelength)

    def behind(self, disk: SoftDisk, grid: Grid, types: Precision) -> Field:
        """Field just behind the pupil, aperture softened."""
        x, y = grid.coordinates(types)
        return Field.from_waves(disk.transmittance(x, y, types), self.waves(x, y, types), grid, types)


def intensity(beam: Beam, problem: Problem, how: Sampling) -> Any:
    """|U|² over the problem's window, a flat Dr.Jit array, for unit amplitude at the pupil."""
    types = precision(problem.dtype)
    if isinstance(how, NodeSampling):
        return _direct_sum(beam, problem, how, types).intensity
    if isinstance(how, FarFieldSampling):
        return _far_field(beam, problem, how, types)
    return _angular_spectrum(beam, problem, how, types).intensity


def _angular_spectrum(beam: Beam, problem: Problem, how: GridSampling, types: Precision) -> Field:
    """U(x) = F⁻¹{F{U₀} H} (Goodman, Introduction to Fourier Optics, §3.10), up to a phase that intensity forgets."""
    u = beam.behind(how.disk, how.pupil, types)
    spectrum = dft2(u, how.pupil_period, how.spectrum.shape, -1, how.spectrum.dx)
    spectrum = spectrum * _transfer(problem, how, types)
    scale = (how.pupil.dx / how.period) ** 2
    if how.method == "angular_spectrum":
        window = problem.window
        return dft2(spectrum, how.output_period, window.shape, +1, window.dx).scaled(scale)
    return _paraxial_rest(spectrum, problem, how, types).scaled(scale)


def _transfer(problem: Problem, how: GridSampling, types: Precision) -> Field:
    """exp(ikz (cos θ - 1)) under the spectral taper; the split method leaves the paraxial -ikz sin²θ/2 for later.

    Goodman, eq. 3-74. cos θ - 1 = -q, q = sin²θ / (1 + cos θ), and with the paraxial part taken out -q²/2: no
    difference of nearly equal numbers.
    """
    import drjit as dr

    fx, fy = how.spectrum.coordinates(types)
    f = dr.sqrt(fx * fx + fy * fy)
    s2 = dr.minimum(dr.square(f * opaque(types, problem.wavelength)), 1)
    q = s2 / (1 + dr.sqrt(1 - s2))
    sag = q if how.method == "angular_spectrum" else q * q / 2
    waves = -opaque(types, problem.distance / problem.wavelength) * sag
    # The error function falls to the ripple in √ln(1/ripple), which is what the taper's blur is made of.
    steepness = math.sqrt(math.pi * how.taper.width * how.taper.blur / 2)
    middle = opaque(types, how.taper.band + how.taper.width / 2)
    fade = dr.erf(types.Float((f - middle) * opaque(types, 2 * steepness / how.taper.width)))
    return Field.from_waves((1 - fade) / 2, waves, how.spectrum, types)


def _paraxial_rest(spectrum: Field, problem: Problem, how: GridSampling, types: Precision) -> Field:
    """Fresnel's integral of the relay field: quadratic phase, then one Fourier sum of free output pitch.

    U(x) = 1/(iλz) e^{iπx²/λz} ∫ u(ξ) e^{iπξ²/λz} e^{-2πi xξ/λz} dξ (Goodman, eq. 4-17); the outer curvature is dropped.
    """
    relay, window = how.relay, problem.window
    u = dft2(spectrum, how.output_period, relay.shape, +1, relay.dx)
    x, y = relay.coordinates(types)
    u = u * Field.from_waves(1.0, (x * x + y * y) * opaque(types, 0.5 / _scale(problem)), relay, types)
    period = _scale(problem) / (relay.dx * window.dx)
    return dft2(u, period, window.shape, -1, window.dx).scaled(relay.dx**2 / _scale(problem))


def _scale(problem: Problem) -> float:
    """λz [m²]"""
    return problem.wavelength * problem.distance


def _far_field(beam: Beam, problem: Problem, how: FarFieldSampling, types: Precision) -> Any:
    """Rayleigh-Sommerfeld's integral with the plane wave of each direction split off:

    U(x) = z/(λρ²) ∫ P(ξ) G(ξ; x) e^{-ik s·ξ} dξ,  G = (ρ/D)² (1/(kD) - i) e^{ik(D - ρ + s·ξ)},

    ρ = |(x, z)|, D = |(x - ξ, z)|, s = x/ρ. G hardly varies with x (it is Fresnel's quadratic phase and less), so it is
    taken at nodes x_ab and the integrals, one Fourier transform each, are interpolated.
    """
    import drjit as dr

    u = beam.behind(how.disk, how.pupil, types)
    dr.eval(u.re, u.im)
    s = how.directions.x
    cosine = np.sqrt(np.maximum(1 - s[:, None] ** 2 - s[None, :] ** 2, 1e-6))
    nodes = how.half_angle * chebyshev_nodes(how.nodes)
    edge = math.asin(min(float(s[-1]), 0.999))  # a margin beyond the window, for the interpolation that follows
    angle = np.clip(np.arctan2(s[None, :], cosine), -edge, edge)
    along_x = lagrange(angle, nodes)
    total_re, total_im = dr.zeros(types.Float, s.size**2), dr.zeros(types.Float, s.size**2)
    places = problem.distance * np.tan(nodes)
    for a, x in enumerate(places):
        for b, y in enumerate(places):
            part = u * _slow_kernel(float(x), float(y), problem, how.pupil, types)
            part = dft2(part, how.period, how.directions.shape, -1, how.directions.dx)
            weight = types.Float(np.ascontiguousarray(along_x[a] * along_x[b].T, dtype=types.dtype).ravel())
            total_re, total_im = total_re + weight * part.re, total_im + weight * part.im
            dr.eval(total_re, total_im)
    return _onto_window(total_re * total_re + total_im * total_im, problem, how, types)


def _slow_kernel(x: float, y: float, problem: Problem, grid: Grid, types: Precision) -> Field:
    """G(ξ; x) on the pupil's grid, without its constant factor -i (1/(kD) is kept)."""
    import drjit as dr

    px, py = grid.coordinates(types)
    rho = math.sqrt(x * x + y * y + problem.distance**2)
    along = px * opaque(types, x / rho) + py * opaque(types, y / rho)
    far = opaque(types, rho)
    excess = px * px + py * py - 2 * far * along
    distance = dr.sqrt(far * far + excess)
    waves = (excess / (distance + far) + along) * opaque(types, 1 / problem.wavelength)
    near = opaque(types, problem.wavelength / (2 * math.pi)) / distance
    size = dr.square(far / distance)
    return Field.from_waves(size, waves, grid, types) * Field(
        types.Float(dr.ones(types.Float64, dr.width(px))), types.Float(near), grid, types
    )


def _onto_window(squared: Any, problem: Problem, how: FarFieldSampling, types: Precision) -> Any:
    """Quintic interpolation from direction cosines to the window; directions are sampled at twice Nyquist's rate."""
    from scipy.ndimage import map_coordinates

    window, directions = problem.window, how.directions
    rho = np.sqrt(window.x[None, :] ** 2 + window.y[:, None] ** 2 + problem.distance**2)
    places = np.stack([window.y[:, None] / rho, window.x[None, :] / rho]) / directions.dx + directions.shape[0] // 2
    values = map_coordinates(squared.numpy().reshape(directions.shape), places, order=5, mode="nearest")
    amplitude = how.pupil.dx**2 * problem.distance / (problem.wavelength * rho**2)
    image = np.maximum(values, 0) * amplitude**2
    if problem.reach is not None:
        image[np.hypot(window.x[None, :], window.y[:, None]) > problem.reach] = 0
    return types.Float(np.ascontiguousarray(image, dtype=types.dtype).ravel())


def _direct_sum(beam: Beam, problem: Problem, how: NodeSampling, types: Precision) -> Field:
    """First Rayleigh-Sommerfeld integral over edge-fitted nodes (Goodman, §3.5):

    U(x) = ∫ P(ξ) z/(2πD²) (1/D - ik) e^{ikD} dξ. D - z = d²/(D + z) loses its whole waves in float64.
    """
    import drjit as dr

    nodes_x, nodes_y, weight = _disk_nodes(problem.radius, how, types)
    waves = beam.waves(nodes_x, nodes_y, types)
    dr.eval(nodes_x, nodes_y, weight, waves)
    count = dr.opaque(types.Index, len(weight))
    x, y = problem.window.coordinates(types)
    z, wavelength = opaque(types, problem.distance), opaque(types, problem.wavelength)
    k = 2 * math.pi / wavelength

    def add(i: Any, re: Any, im: Any) -> tuple[Any, Any, Any]:
        dx, dy = x - dr.gather(types.Float64, nodes_x, i), y - dr.gather(types.Float64, nodes_y, i)
        d2 = dx * dx + dy * dy
        distance = dr.sqrt(d2 + z * z)
        phase = d2 / (distance + z) / wavelength + dr.gather(types.Float64, waves, i)
        sin, cos = dr.sincos(types.Float((phase - dr.round(phase)) * (2 * math.pi)))
        size = dr.gather(types.Float64, weight, i) * z / (2 * math.pi * distance * distance)
        near, far = types.Float(size / distance), types.Float(size * k)
        return i + 1, re + near * cos + far * sin, im + near * sin - far * cos

    zero = dr.zeros(types.Float, dr.width(x))
    start = dr.zeros(types.Index, dr.width(x))
    _, re, im = dr.while_loop((start, zero, zero), lambda i, re, im: i < count, add)
    return Field(re, im, problem.window, types)


def _disk_nodes(radius: float, how: NodeSampling, types: Precision) -> tuple[Any, Any, Any]:
    """Gauss-Legendre in radius, trapezoid in angle, weights r dr dφ: exact edge, spectral convergence."""
    nodes, weights = np.polynomial.legendre.leggauss(how.radial)
    r = radius * (nodes + 1) / 2
    angle = 2 * np.pi * (np.arange(how.angular) + 0.5) / how.angular
    x, y = np.outer(r, np.cos(angle)), np.outer(r, np.sin(angle))
    weight = np.outer(weights * r * radius / 2, np.full(how.angular, 2 * np.pi / how.angular))
    return types.Float64(x.ravel()), types.Float64(y.ravel()), types.Float64(weight.ravel())
