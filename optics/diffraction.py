"""From the pupil's field to the field on the sensor, by the sampling that the planner chose."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from optics.field import Field
from optics.fourier import dft2
from optics.grid import Grid
from optics.planner import Problem, Sampling
from optics.precision import Precision, opaque, precision
from optics.pupil import Pupil
from optics.source import PointSource

__all__ = ["diffract"]


def diffract(pupil: Pupil, source: PointSource, vacuum_wavelength: float, problem: Problem, how: Sampling) -> Field:
    """Field over the problem's window, up to a constant phase factor (and a curvature, for the split method)."""
    types = precision(problem.dtype)
    if how.method == "rayleigh_sommerfeld":
        return _direct_sum(pupil, source, vacuum_wavelength, problem, how, types)
    assert how.disk is not None
    grid = Grid.square(how.pupil_samples, how.period / how.pupil_period)
    x, y = grid.coordinates(types)
    waves = pupil.path(x, y, vacuum_wavelength, source, types) * opaque(types, 1 / vacuum_wavelength)
    u = Field.from_waves(how.disk.transmittance(x, y, types), waves, grid, types)
    spectrum = dft2(u, how.pupil_period, (how.spectrum_samples,) * 2, -1, 1 / how.period)
    spectrum = spectrum * _transfer(problem, how, types)
    scale = (grid.dx / how.period) ** 2
    if how.method == "angular_spectrum":
        window = problem.window
        return dft2(spectrum, how.output_period, window.shape, +1, window.dx).scaled(scale)
    return _paraxial_rest(spectrum, problem, how, types).scaled(scale)


def _transfer(problem: Problem, how: Sampling, types: Precision) -> Field:
    """exp(ikz (cos θ - 1)) under the spectral taper; the split method leaves the paraxial -ikz sin²θ/2 for later.

    Goodman, Introduction to Fourier Optics, eq. 3-74. cos θ - 1 = -s²/(1 + cos θ), and with the paraxial part taken
    out -s⁴/(2 (1 + cos θ)²), s = sin θ: no difference of nearly equal numbers.
    """
    import drjit as dr

    grid = Grid.square(how.spectrum_samples, 1 / how.period)
    fx, fy = grid.coordinates(types)
    f = dr.sqrt(fx * fx + fy * fy)
    s2 = dr.minimum(dr.square(f * opaque(types, problem.wavelength)), 1)
    cosine = dr.sqrt(1 - s2)
    distance = opaque(types, problem.distance / problem.wavelength)
    sag = s2 / (1 + cosine)
    waves = -distance * (sag * sag / 2 if how.method == "split_angular_spectrum" else sag)
    steepness = math.sqrt(math.log(1 / problem.ripple))
    middle = opaque(types, how.band + how.taper / 2)
    fade = dr.erf((f - middle) * opaque(types, 2 * steepness / how.taper))
    return Field.from_waves((1 - fade) / 2, waves, grid, types)


def _paraxial_rest(spectrum: Field, problem: Problem, how: Sampling, types: Precision) -> Field:
    """Fresnel's integral of the relay field: quadratic phase, then one Fourier sum of free output pitch.

    U(x) = 1/(iλz) e^{iπx²/λz} ∫ u(ξ) e^{iπξ²/λz} e^{-2πi xξ/λz} dξ (Goodman, eq. 4-17); the outer curvature is dropped.
    """
    relay = Grid.square(how.output_period, how.period / how.output_period)
    u = dft2(spectrum, how.output_period, relay.shape, +1, relay.dx)
    x, y = relay.coordinates(types)
    chirp = (x * x + y * y) * opaque(types, 1 / (2 * problem.wavelength * problem.distance))
    u = u * Field.from_waves(1.0, chirp, relay, types)
    window = problem.window
    reach = problem.wavelength * problem.distance
    return dft2(u, reach / (relay.dx * window.dx), window.shape, -1, window.dx).scaled(relay.dx**2 / reach)


def _direct_sum(
    pupil: Pupil, source: PointSource, vacuum_wavelength: float, problem: Problem, how: Sampling, types: Precision
) -> Field:
    """First Rayleigh-Sommerfeld integral over edge-fitted nodes (Goodman, eq. 3-41, without the far-field shortcut).

    U(x) = ∫ P(ξ) z/(2πR²) (1/R - ik) e^{ikR} dξ. R - z = d²/(R + z) loses its whole waves in float64.
    """
    import drjit as dr

    nodes_x, nodes_y, weight = _disk_nodes(problem.radius, how.pupil_period, how.output_period, types)
    waves = pupil.path(nodes_x, nodes_y, vacuum_wavelength, source, types) * opaque(types, 1 / vacuum_wavelength)
    dr.eval(nodes_x, nodes_y, weight, waves)
    count = dr.opaque(types.Index, len(weight))
    x, y = problem.window.coordinates(types)
    z, wavelength = opaque(types, problem.distance), opaque(types, problem.wavelength)
    k = 2 * math.pi / wavelength

    def add(i: Any, re: Any, im: Any) -> tuple[Any, Any, Any]:
        dx, dy = x - dr.gather(types.Float64, nodes_x, i), y - dr.gather(types.Float64, nodes_y, i)
        d2 = dx * dx + dy * dy
        r = dr.sqrt(d2 + z * z)
        phase = d2 / (r + z) / wavelength + dr.gather(types.Float64, waves, i)
        sin, cos = dr.sincos(types.Float((phase - dr.round(phase)) * (2 * math.pi)))
        size = dr.gather(types.Float64, weight, i) * z / (2 * math.pi * r * r)
        near, far = types.Float(size / r), types.Float(size * k)
        return i + 1, re + near * cos + far * sin, im + near * sin - far * cos

    zero = dr.zeros(types.Float, dr.width(x))
    start = dr.zeros(types.Index, dr.width(x))
    _, re, im = dr.while_loop((start, zero, zero), lambda i, re, im: i < count, add)
    return Field(re, im, problem.window, types)


def _disk_nodes(radius: float, radial: int, angular: int, types: Precision) -> tuple[Any, Any, Any]:
    """Gauss-Legendre in radius, trapezoid in angle, weights r dr dφ: exact edge, spectral convergence."""
    nodes, weights = np.polynomial.legendre.leggauss(radial)
    r = radius * (nodes + 1) / 2
    angle = 2 * np.pi * (np.arange(angular) + 0.5) / angular
    x, y = np.outer(r, np.cos(angle)), np.outer(r, np.sin(angle))
    weight = np.outer(weights * r * radius / 2, np.full(angular, 2 * np.pi / angular))
    return types.Float64(x.ravel()), types.Float64(y.ravel()), types.Float64(weight.ravel())
