"""Field that the modes of a waveguide radiate to the points of a pupil.

In coordinates around the waveguide's axis, the radiated field is cos lφ or sin lφ, times a function of the angle θ from
this axis and of the distance D from the centre of the waveguide's end:

    Ψ(ξ) = z e^{ikD} cos lφ G(sin θ, D),   G = ∫ ψ(x) (1/d - ik)/(2πd²) e^{ik(d - D)} dx,   d = |ξ - x|.

ψ(x) is the mode's field at a position x on the waveguide's end, and ξ a point of the pupil. k is the wavenumber between
them, and z the distance of the waveguide's end from the pupil's plane. The end of a waveguide off the pupil's axis is
oblique to this plane. Ψ then has an error of up to 5e-3 of its largest value. The integral G is computed at Chebyshev
points in sin θ and 1/D, and interpolated between them by polynomials. For a waveguide on the pupil's axis, D is
z/cos θ, so G depends on sin θ alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from optics.numerics.interpolation import chebyshev_basis, chebyshev_points
from optics.numerics.quadrature import gauss_legendre, gauss_legendre_count, harmonics
from optics.ommatidia.waveguide import Mode

__all__ = ["DIGITS", "radiated", "reach"]

DIGITS = 6.0  # choice: digits of all sums
FAR = 14.0  # choice: a mode's field is neglected after it has decayed by e^-14 from the core's edge
# Choice: limit of the field in core radii, for modes near their cut-off. A limit of 100 radii would take up to seven
# times as long and change the result by 2e-4.
FARTHEST = 40.0
PAIRS = 4_000_000  # choice, limited by memory: pairs of point and node that are computed at once
SPARE_POINTS = 10, 5  # choice: Chebyshev points in sin θ and in 1/D, in addition to 1.2 per radian of the phase
LINE = 5e-3  # choice: radians between points of linear interpolation, fine enough for DIGITS
CLEAR = 1e-9  # margin for rounding at the ends of ranges

Ends = tuple[float, float]
OfMode = Callable[[int], np.ndarray]


def reach(modes: tuple[Mode, ...]) -> float:
    """Return the distance [m] from the waveguide's axis beyond which these modes' fields are negligible."""
    return max(mode.radius * _radii(mode) for mode in modes)


def _radii(mode: Mode) -> float:
    return 1 + min(FAR / mode.w, FARTHEST)


def radiated(
    modes: tuple[Mode, ...], x: np.ndarray, y: np.ndarray, end: tuple[float, float, float], k: float
) -> np.ndarray:
    """Return the field Ψ of each mode at points of a pupil, (mode, point), up to a constant phase.

    end: position (x, y, z) [m] of the waveguide's end, relative to the pupil's centre. The waveguide's axis passes
        through this position and the pupil's centre.
    k: wavenumber [1/m] behind the pupil.
    """
    sine, phi, distance = _in_guide_frame(x, y, end)
    function = (_along_axis if end[:2] == (0.0, 0.0) else _aside)(modes, sine, distance, k)
    excess = (x * x + y * y - 2 * (x * end[0] + y * end[1])) / (distance + math.hypot(*end))
    sphere = end[2] / distance**2 * np.exp(1j * k * excess)
    found = np.empty((len(modes), len(x)), dtype=complex)
    for at, mode in enumerate(modes):
        around = np.sin(mode.l * phi) if mode.sine else np.cos(mode.l * phi)
        np.multiply(function(at), around * sphere, out=found[at])
    return found


def _along_axis(modes: tuple[Mode, ...], sine: np.ndarray, distance: np.ndarray, k: float) -> OfMode:
    """Return a function for the field of each mode at points of the pupil, for a waveguide on the pupil's axis.

    The function maps a mode's index to values of G D², (point,). G(sin θ, D) is proportional to the field that the mode
    radiates to a point at the distance D from the waveguide's end. θ is the angle from the waveguide's axis to the line
    between the waveguide's end and the point. G is an integral over the waveguide's end, see the top of the module. For
    a waveguide on the axis, D is z/cos θ, where z is the distance of the end from the pupil, so G depends on θ alone.
    It is computed at closely spaced θ, and interpolated linearly between them.

    sine, distance: sin θ and D of the points, (point,).
    k: wavenumber [1/m].
    """
    z = float((distance * np.sqrt(1 - sine**2)).mean())
    sines = 0.0, float(sine.max()) * (1 + CLEAR)
    radians = k * reach(modes) * sines[1] / 2
    at = _between(sines, radians, SPARE_POINTS[0])
    table = _integrated(modes, at, z / np.sqrt(1 - at**2), k)
    close = np.linspace(*sines, 2 * math.ceil(max(radians, 1) / LINE))
    fine = table @ chebyshev_basis(_scaled(close, sines), len(at)).T

    def function(mode: int) -> np.ndarray:
        return np.asarray(np.interp(sine, close, fine[mode]))

    return function


def _aside(modes: tuple[Mode, ...], sine: np.ndarray, distance: np.ndarray, k: float) -> OfMode:
    """Return a function for the field of each mode at points of the pupil, for a waveguide off the pupil's axis.

    The function maps a mode's index to values of G D², (point,). G(sin θ, D) is proportional to the field that the mode
    radiates to a point at the distance D from the waveguide's end. θ is the angle from the waveguide's axis to the line
    between the waveguide's end and the point. G is an integral over the waveguide's end, see the top of the module. It
    is interpolated in sin θ and in 1/D, which are independent of each other.

    sine, distance: sin θ and D of the points, (point,).
    k: wavenumber [1/m].
    """
    sines = 0.0, float(sine.max()) * (1 + CLEAR)
    nearness = (1 - CLEAR) / float(distance.max()), (1 + CLEAR) / float(distance.min())
    far = reach(modes)
    at = _between(sines, k * far * sines[1] / 2, SPARE_POINTS[0])
    near = _between(nearness, k * far**2 * (nearness[1] - nearness[0]) / 4, SPARE_POINTS[1])
    by_row, by_column = (axis.ravel() for axis in np.meshgrid(at, 1 / near, indexing="ij"))
    table = _integrated(modes, by_row, by_column, k).reshape(len(modes), len(at), len(near))
    by_sine = chebyshev_basis(_scaled(sine, sines), len(at))
    by_nearness = chebyshev_basis(_scaled(1 / distance, nearness), len(near))
    return lambda mode: np.asarray(((by_sine @ table[mode]) * by_nearness).sum(axis=1))


def _in_guide_frame(x: np.ndarray, y: np.ndarray, end: tuple[float, float, float]) -> tuple[np.ndarray, ...]:
    """Return sin θ, φ and D, the spherical coordinates of points of a pupil about the waveguide's end, each (point,).

    θ is the angle from the waveguide's axis, φ the azimuth about this axis, and D the distance [m] from the centre of
    the waveguide's end. The azimuth is counted from the pupil's x axis towards its y axis, after the smallest rotation
    of these axes that turns the pupil's axis into the waveguide's axis.

    x, y: positions [m] of the points on the pupil.
    end: position (x, y, z) [m] of the waveguide's end.
    """
    there = np.stack([x - end[0], y - end[1], np.full(len(x), -end[2])])
    axis, normal = -np.array(end) / math.hypot(*end), np.array([0.0, 0.0, -1.0])
    between = axis + normal
    turned = [own - axis @ own / (1 + axis @ normal) * between for own in np.eye(3)[:2]]
    along = [way @ there for way in turned]
    distance = np.sqrt((there**2).sum(axis=0))
    return np.hypot(*along) / distance, np.arctan2(along[1], along[0]), distance


def _scaled(at: np.ndarray, ends: Ends) -> np.ndarray:
    """Map positions from the range `ends` to [-1, 1]."""
    found: np.ndarray = (2 * at - ends[0] - ends[1]) / (ends[1] - ends[0])
    return found


def _between(ends: Ends, radians: float, spare: int) -> np.ndarray:
    """Return Chebyshev points in the range `ends`, for a function with a varying phase.

    radians: change of the phase over half of the range.
    spare: number of points that are added to 1.2 per radian.
    """
    return (ends[0] + ends[1] + (ends[1] - ends[0]) * chebyshev_points(math.ceil(1.2 * radians) + spare)) / 2


def _integrated(modes: tuple[Mode, ...], sine: np.ndarray, distance: np.ndarray, k: float) -> np.ndarray:
    """Return values of G D² by quadrature over the modes' fields, for pairs of sin θ and D, (mode, pair).

    G(sin θ, D) is proportional to the field that a mode radiates to a point at the distance D from the waveguide's end
    and at the angle θ from the waveguide's axis. G is the integral of ψ(x) (1/d - ik)/(2πd²) e^{ik(d - D)} over the
    waveguide's end, where ψ(x) is the mode's field at a position x on this end, and d the distance from x to the point.

    sine, distance: sin θ and D [m] of each pair, (pair,).
    k: wavenumber [1/m].
    """
    u, v, weight = _mode_nodes(modes, k * float(sine.max()))
    # G is the same for the modes with sin lφ and with cos lφ. Only the cosine is nonzero at φ = 0, so it is used.
    amplitude = np.stack([weight * replace(mode, sine=False).field(u, v) for mode in modes], axis=1)
    found = np.empty((len(sine), len(modes)), dtype=complex)
    step = max(1, PAIRS // u.size)
    for start in range(0, len(sine), step):
        at, of = sine[start : start + step, None], distance[start : start + step, None]
        excess = u * u + v * v - 2 * of * at * u
        d = np.sqrt(of * of + excess)
        kernel = (of / d) ** 2 / (2 * np.pi) * (1 / d - 1j * k) * np.exp(1j * k * excess / (d + of))
        found[start : start + step] = kernel @ amplitude
    return found.T


def _mode_nodes(modes: tuple[Mode, ...], k: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x, y [m] and weights of quadrature nodes over the modes' fields.

    The nodes suit light with transverse wavenumbers up to k [1/m] along x.

    Only one side of the x axis has nodes, because the integrand is symmetric about it.
    """
    b, parts = modes[0].radius, []
    fastest, farthest, most = max(mode.u for mode in modes), max(map(_radii, modes)), max(mode.l for mode in modes)
    steep = max(mode.w for mode in modes) * (farthest - 1)  # polynomial degree that the fields' decay requires
    for low, high, turns, degree in ((0.0, b, fastest, 0), (b, b * farthest, 0.0, int(steep) + 8)):
        cycles = (k * (high - low) + turns) / (2 * math.pi)
        u, weight = gauss_legendre(gauss_legendre_count(cycles, DIGITS, 2 + degree))
        r = low + (high - low) * u
        around = (int(harmonics(np.array(k * high), DIGITS)) + most) // 2 + 1
        phi = np.pi * (np.arange(around) + 0.5) / around
        size = (high - low) * weight * r * 2 * np.pi / around
        parts.append((np.outer(r, np.cos(phi)).ravel(), np.outer(r, np.sin(phi)).ravel(), np.repeat(size, around)))
    x, y, weight = (np.concatenate(column) for column in zip(*parts, strict=True))
    return x, y, weight
