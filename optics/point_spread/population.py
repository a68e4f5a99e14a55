"""PSFs of a whole population with one plan: pupils of different sizes and reliefs, as one stack of matrix products.

Each PSF is computed as by the method "low_rank" with rank 1: the Fourier kernel is multiplied by the slow factor at the
window's centre,

    U(x) ≈ (z/ρ)² Σ_ξ P(ξ) z/(λD²) e^{ik(D - z)} Π (1 + 2ξx/z²) e^{-ik ξ·x/c},   D = √(ξ² + z²), ρ = √(x² + z²).

P is the light behind the pupil. Π is the product over both axes. Along an axis, c² is z² + ξ², plus the mean squares of
the other coordinates. In units of the radius, all pupils share the soft edge and the positions of samples, with the
values of B-splines (for reliefs) and powers (for Zernike polynomials). Changes of the slow factor's phase over the
window cause an error, which is predicted for each PSF. If it exceeds the tolerance, `optics.psf` computes the PSF.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from optics.apertures.aperture import EDGE_REACH, Aperture
from optics.methods.problem import SLOPE_MARGIN
from optics.methods.scalar_theory import light_spread, scalar_theory_error, steepest_sine
from optics.numerics.accuracy import Plan
from optics.numerics.autodiff import number
from optics.numerics.grid import Grid
from optics.numerics.interpolation import cubic_bsplines
from optics.numerics.precision import precision
from optics.point_spread.population_members import Member, powers
from optics.point_spread.window_cost import population_seconds

__all__ = ["population_pictures"]

LOOSEST = 1e-3  # choice: smallest tolerance for which float32 and rank 1 may be sufficient
FEW_WAVES = 3000.0  # choice: largest number of waves of a phase in float32
FAR = 200.0  # choice: smallest kz for which the near-field term of the kernel is negligible
RIPPLE = 0.3  # choice: ripple of the soft edge relative to the tolerance; see test_population.py
SAMPLING = 0.2  # choice: error due to the soft edge, relative to the tolerance
# Choice: smallest transmitted light, relative to a mask's brightest light near the aperture's edge, for which SAMPLING
# is valid; see test_population_members.py. The error of the soft edge is relative to the light near the edge.
LEAST_LIGHT = 1e-2
SPREAD = 1.4  # choice: error of the intensity divided by the spread of the phase; see test_population.py
TURNS = 1.3  # choice: ratio of successive numbers of samples; similar pupils then share a plan
STACK = 2_000_000  # choice, limited by memory: samples of pupils in a stack
RINGS = 12  # choice: number of rings of the window for which the error is predicted
SLOPES = np.linspace(-1, 1, 9) * (1 + EDGE_REACH)  # positions where the slope of a relief is evaluated
# Choices for the slope of a wavefront: positions per order at which it is evaluated, and step of differences [radii].
PER_ORDER, STEP = 4, 1e-4


def population_pictures(
    members: Sequence[Member], window: Grid, tolerance: float
) -> Iterator[tuple[int, np.ndarray, Plan]]:
    """Yield index, PSF (y, x) [1/m²] and plan of each member for which the common plan is accurate enough.

    Nothing is yielded for a tolerance below LOOSEST. The window is centred on the axis.
    """
    groups: dict[tuple[Aperture, int], list[int]] = defaultdict(list)
    plain = [index for index, member in enumerate(members) if member.plain]
    if tolerance < LOOSEST or window.centre != (0.0, 0.0) or not plain:
        return
    leaving = {}
    for index, turns, sine in zip(
        plain, *_turns(_Stack.from_members([members[index] for index in plain]), window), strict=True
    ):
        leaving[index] = float(sine)
        if math.isfinite(turns):
            step = math.ceil(math.log(max(turns, 1.0)) / math.log(TURNS))
            groups[members[index].pupil.aperture, step].append(index)
    for (aperture, step), group in groups.items():
        samples = _samples(aperture, TURNS**step, RIPPLE * tolerance)
        if samples.at.size**2 > STACK:
            continue
        size = max(1, STACK // max(samples.at.size**2, math.prod(window.shape)))
        for start in range(0, len(group), size):
            part = group[start : start + size]
            stack = _Stack.from_members([members[index] for index in part])
            masks = _masks(stack, samples)
            images = _images(stack, samples, masks, window) / np.float32(aperture.area)
            errors = _model_errors(stack, images, window) + SAMPLING * tolerance
            errors = np.where(_light(samples, masks) < LEAST_LIGHT, math.inf, errors)
            for index, image, error in zip(part, images, errors, strict=True):
                if error <= tolerance:
                    yield index, image, _plan(members[index], samples, window, float(error), leaving[index])


def _plan(member: Member, samples: _Samples, window: Grid, error: float, leaving: float) -> Plan:
    shape = samples.at.size, samples.at.size
    sine = steepest_sine(member.pupil.radius, number(member.distance), leaving)
    scalar = scalar_theory_error(sine, light_spread(member.pupil))
    why = "shared plan of a population: rank 1, no spot check"
    return Plan("low_rank", shape, "float32", error, why, population_seconds(shape[0], window), scalar_error=scalar)


@dataclass(frozen=True, eq=False)
class _Stack:
    """Parameters of many members, see `Member.numbers`, as arrays (member, 1, 1) of float32."""

    radius: np.ndarray
    wavelength: np.ndarray
    distance: np.ndarray
    source: np.ndarray
    focal: np.ndarray
    before: np.ndarray
    waist: np.ndarray
    relief: np.ndarray  # (member, 4, 4)
    order: int  # highest order of the wavefronts
    powers: np.ndarray  # coefficients of powers in the wavefronts, (member, term)
    members: Sequence[Member]

    @classmethod
    def from_members(cls, members: Sequence[Member]) -> _Stack:
        columns = np.array([member.numbers for member in members], np.float32).T[:, :, None, None]
        relief = np.array([member.relief for member in members], np.float32)
        order = max(member.order for member in members)
        terms = np.array([member.powers for member in members]) if order else np.zeros((len(members), 1))
        radius, wavelength, distance, source, focal, before, waist = columns
        counted = terms[:, : (order + 1) * (order + 2) // 2]
        lengths = radius, wavelength, distance, source, focal
        return cls(*lengths, before, waist, relief, order, counted, members)


@dataclass(frozen=True, eq=False)
class _Samples:
    """Samples of a soft aperture: positions and pitch in radii, transmittance (y, x), and B-splines (position, 4)."""

    at: np.ndarray
    pitch: float
    soft: np.ndarray
    splines: np.ndarray


@lru_cache(maxsize=64)
def _samples(aperture: Aperture, turns: float, ripple: float) -> _Samples:
    """Return the fewest samples for a phase with `turns` cycles per radius."""
    types, soft = precision("float64"), aperture.soften(turns, ripple, EDGE_REACH)
    pitch = 1 / (turns + soft.stopband)
    grid = Grid.square(2 * math.ceil((1 + soft.reach) / pitch) + 1, pitch)
    x, y = grid.coordinates(types)
    inside = soft.transmittance(x, y, types).numpy().reshape(grid.shape)
    splines = np.stack(cubic_bsplines((grid.x + 1) / 2), axis=1)
    return _Samples(grid.x.astype(np.float32), pitch, inside.astype(np.float32), splines.astype(np.float32))


def _turns(stack: _Stack, window: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Return the cycles per radius of the combined phase of pupil and path, and the largest sine of the light."""
    slopes = SLOPES if stack.order < 2 else np.linspace(-1, 1, PER_ORDER * stack.order + 1) * (1 + EDGE_REACH)
    r = stack.radius * np.hypot(slopes[:, None], slopes[None, :]).astype(np.float32)
    outward = stack.before * r / np.hypot(r, stack.source) - np.sign(stack.focal) * r / np.hypot(r, stack.focal)
    per_place = stack.radius / stack.wavelength / np.maximum(r / stack.radius, 1e-6)
    steep, path = outward * per_place, r / np.hypot(r, stack.distance) * per_place
    splines = [np.stack(part, axis=1).astype(np.float32) for part in _splines_and_slopes((slopes + 1) / 2)]
    along_x = splines[0] @ stack.relief @ splines[1].T + steep * slopes[None, None, :].astype(np.float32)
    along_y = splines[1] @ stack.relief @ splines[0].T + steep * slopes[None, :, None].astype(np.float32)
    if stack.order:
        x, y = np.meshgrid(slopes, slopes)
        for along, (dx, dy) in ((along_x, (STEP, 0.0)), (along_y, (0.0, STEP))):
            rise = powers(x + dx, y + dy, stack.order) - powers(x - dx, y - dy, stack.order)
            # Corners are omitted: the pupil is dark there, but high powers are large.
            rise = np.where(np.hypot(x, y) <= 1 + EDGE_REACH, rise / (2 * STEP), 0)
            along += np.tensordot(stack.powers, rise, 1).astype(np.float32)
    detail = np.array([member.detail for member in stack.members], np.float32)
    inside = np.hypot(slopes[:, None], slopes[None, :]) <= 1 + EDGE_REACH
    leaving = SLOPE_MARGIN * (np.hypot(along_x, along_y) * inside).max(axis=(1, 2)) + detail
    along_x, along_y = along_x + path * slopes[None, None, :], along_y + path * slopes[None, :, None]
    found = SLOPE_MARGIN * np.hypot(along_x, along_y).max(axis=(1, 2))
    found += (stack.radius * window.half_diagonal / (stack.wavelength * stack.distance))[:, 0, 0]
    found += detail
    waves = np.abs(found) + (np.square(stack.radius) / (stack.distance * stack.wavelength))[:, 0, 0]
    near = (stack.distance / stack.wavelength)[:, 0, 0] * 2 * math.pi < FAR
    # The result is infinite if float32 or the far-field kernel is not sufficient.
    turns = np.where((waves > FEW_WAVES) | near | ~np.isfinite(found), math.inf, found)
    return turns, (leaving + 1) * (stack.wavelength / stack.radius)[:, 0, 0]


def _splines_and_slopes(t: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return B-splines at t = (x + 1)/2, and their derivatives with respect to x."""
    s = 1 - t
    slopes = [-s * s / 2, (3 * t * t - 4 * t) / 2, -(3 * s * s - 4 * s) / 2, t * t / 2]
    return list(cubic_bsplines(t)), [slope / 2 for slope in slopes]


def _sine(stack: _Stack, window: Grid, at: np.ndarray) -> np.ndarray:
    """Return the sine ξ/c(ξ) along one axis; c² is z² + ξ² plus mean squares of the other coordinates."""
    elsewhere = np.square(stack.radius) / 4 + np.float32((0.4 * window.own_half_width) ** 2)
    found: np.ndarray = at / np.sqrt(np.square(stack.distance) + np.square(at) + elsewhere)
    return found


def _masks(stack: _Stack, samples: _Samples) -> np.ndarray:
    """Return the amplitudes that masks transmit, (member or 1, y, x)."""
    found = np.ones((1, *samples.soft.shape), np.float32)
    if np.isfinite(stack.waist).any():
        r2 = np.square(samples.at)[:, None] + np.square(samples.at)[None, :]
        found = np.exp(-np.square(stack.radius / stack.waist) * r2)
    maps = [member.mask(samples.at) for member in stack.members]
    if any(amplitudes is not None for amplitudes in maps):
        found = found * np.stack([np.ones_like(samples.soft) if own is None else own for own in maps], dtype=np.float32)
    return found


def _light(samples: _Samples, masks: np.ndarray) -> np.ndarray:
    """Return the transmitted light, relative to the mask's brightest light near the aperture's edge, (member or 1,)."""
    power, soft = np.square(masks).reshape(len(masks), -1), samples.soft.ravel()
    passed, brightest = power @ np.square(soft) / np.square(soft).sum(), power[:, soft < 0.5].max(axis=1)
    return np.asarray(passed / np.maximum(brightest, 1e-30))


def _images(stack: _Stack, samples: _Samples, masks: np.ndarray, window: Grid) -> np.ndarray:
    """Return |U|²/R² [1/m²] over the window, with R the pupil's radius, (member, y, x)."""
    u = samples.at
    r2 = np.square(stack.radius) * (np.square(u)[:, None] + np.square(u)[None, :])
    square_z = np.square(stack.distance)
    path = r2 / (np.sqrt(r2 + square_z) + stack.distance)
    if np.isfinite(stack.source).any():
        path += stack.before * (r2 / (np.sqrt(r2 + np.square(stack.source)) + stack.source))
    if np.isfinite(stack.focal).any():
        path -= np.sign(stack.focal) * r2 / (np.sqrt(r2 + np.square(stack.focal)) + np.abs(stack.focal))
    waves = path / stack.wavelength
    if stack.relief.any():
        waves += samples.splines @ stack.relief @ samples.splines.T
    if stack.order:
        waves += np.tensordot(stack.powers, _powers(samples.at.tobytes(), stack.order), 1).astype(np.float32)
    size = samples.soft * masks * (square_z / (r2 + square_z))
    size *= np.float32(samples.pitch**2) * stack.radius / (stack.distance * stack.wavelength)
    field = _turned(size, waves)
    across = _fourier(stack, u, window, window.x)
    down = across if window.shape[0] == window.shape[1] else _fourier(stack, u, window, window.y)
    out = np.matmul(np.matmul(down, field), across.swapaxes(1, 2))
    found: np.ndarray = np.square(out.real) + np.square(out.imag)
    # Modulus of the slow factor, which falls with the distance from the pupil's centre.
    nearness = square_z / (square_z + np.square(window.x)[None, None, :] + np.square(window.y)[None, :, None])
    found *= np.square(nearness, dtype=np.float32)
    return found


@lru_cache(maxsize=16)
def _powers(at: bytes, order: int) -> np.ndarray:
    places = np.frombuffer(at, np.float32).astype(np.float64)
    return powers(*np.meshgrid(places, places), order)


def _fourier(stack: _Stack, u: np.ndarray, window: Grid, at: np.ndarray) -> np.ndarray:
    """Return the Fourier kernel times the linear part of z²/D² along one axis, (member, position, sample)."""
    xi, places = stack.radius * u, at.astype(np.float32)[None, :, None]
    sines = _sine(stack, window, xi) / stack.wavelength
    return _turned(1 + 2 * xi * places / np.square(stack.distance), -sines * places)


def _turned(size: np.ndarray, waves: np.ndarray) -> np.ndarray:
    """Return size · exp(2πi waves), by sines in float32, which are many times faster than complex exponentials."""
    angle = (waves - np.rint(waves)) * np.float32(2 * math.pi)
    found = np.empty(waves.shape, np.complex64)
    np.multiply(size, np.cos(angle), out=found.real)
    np.multiply(size, np.sin(angle), out=found.imag)
    return found


def _model_errors(stack: _Stack, images: np.ndarray, window: Grid) -> np.ndarray:
    """Return the relative L2 error that results from the constant phase of the slow factor, (member,)."""
    ring, count = _rings(window)
    flat = images.reshape(len(images), -1)
    squares = np.stack([np.bincount(ring, np.square(image), RINGS) for image in flat.astype(np.float64)])
    means = np.stack([np.bincount(ring, image, RINGS) for image in flat.astype(np.float64)]) / count
    spread = _spread(stack, window)
    # The spread of the phase causes an error of the amplitude, which is weighted with the light.
    wrong = np.square(SPREAD * spread) * (squares + count * np.square(means))
    found: np.ndarray = np.sqrt(wrong.sum(axis=1) / squares.sum(axis=1))
    return found


@lru_cache(maxsize=8)
def _rings(window: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Return the index of each sample's ring around the axis, flat, and the number of samples per ring."""
    radius = np.hypot(window.x[None, :], window.y[:, None]).ravel()
    ring = np.minimum((radius / max(window.half_diagonal, window.dx) * RINGS).astype(np.intp), RINGS - 1)
    return ring, np.maximum(np.bincount(ring, minlength=RINGS), 1)


def _spread(stack: _Stack, window: Grid) -> np.ndarray:
    """Return the spread [rad] over the pupil of the slow factor's phase at each ring's outer end, (member, ring)."""
    turns = (np.arange(40) + 0.5) * (math.sqrt(5) - 1) / 2
    r = np.sqrt((np.arange(40) + 0.5) / 40)
    xi = stack.radius[:, 0, :, None].astype(np.float64) * (r * np.exp(2j * np.pi * turns))
    out = np.arange(1, RINGS + 1) / RINGS * max(window.half_diagonal, window.dx)
    z = stack.distance.astype(np.float64)[:, 0, :, None]
    sines = _sine(stack, window, xi.real) + 1j * _sine(stack, window, xi.imag)
    # Standard deviation of the phase relative to the window's centre: the larger of the values along axis and diagonal.
    worst = np.zeros((len(stack.radius), RINGS))
    for angle in (0.0, math.pi / 4):
        x = (out * np.exp(1j * angle))[None, :, None]
        along, size = (x * xi.conj()).real, np.abs(xi) ** 2
        rho = np.sqrt(np.abs(x) ** 2 + z * z)
        there = (size - 2 * along) / (np.sqrt(rho**2 + size - 2 * along) + rho) + (x * sines.conj()).real
        waves = (there - size / (np.sqrt(z * z + size) + z)) / stack.wavelength.astype(np.float64)[:, 0, :, None]
        worst = np.maximum(worst, 2 * math.pi * waves.std(axis=2))
    return worst
