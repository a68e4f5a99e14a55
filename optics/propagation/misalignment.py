"""Pupils of a system that are decentred and tilted.

Each plane has its own lateral coordinates about the centre of its pupil. The field that arrives at a decentred pupil is
therefore computed on samples around a shifted centre, and nothing else changes. The plane of a tilted pupil has the
depth ζ(x) = x·tan α. The field that arrives at a point of this plane is the field at the depth ζ of the point. Light
that leaves the point starts at the same depth. If the light's angles to the axis are at most θ, the field is the
product of a carrier exp(ikcζ) with c = (1 + cos θ)/2 and a function that varies slowly with the depth. This function is
interpolated between a few planes at Chebyshev nodes z_j, with Lagrange polynomials L_j. The light that arrives at the
tilted plane is

    U(x, ζ) = exp(ikcζ) Σ_j L_j(ζ) exp(-ikcz_j) U(x, z_j).

The light w that leaves the tilted plane arrives at the next plane as

    Σ_j exp(ikcz_j) P(-z_j) [L_j(ζ) exp(-ikcζ) w],

where P(-z_j) is the propagation from the depth z_j to the next plane. The second formula is the adjoint of the first
one. The second formula becomes the inverse of the first one if light at the angle θ is multiplied by 1 - tan α tan θ.
Fields on tilted planes are stored without exp(ikζ).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.numerics.accuracy import AccuracyError
from optics.numerics.arguments import in_range, of_kind, point_2d
from optics.numerics.array_library import turned
from optics.numerics.autodiff import Array, number
from optics.numerics.grid import Grid, sample_positions
from optics.numerics.precision import Precision, opaque

__all__ = [
    "ALIGNED",
    "Alignment",
    "DepthFactors",
    "Depths",
    "Misaligned",
    "path_to_tilted_plane",
    "seen_from",
    "slowness",
]

STEEPEST_TILT = 0.2  # choice [rad]: largest tilt; a thin element at a larger tilt is no longer thin along the axis
MOST_NODES = 8  # choice: largest number of depths between which fields are interpolated

# Choice: error of the interpolation over the pupil, relative to that of the steepest light at the deepest point.
MEAN_OVER_PUPIL = 1 / 3

Point = tuple[float, float]


@dataclass(frozen=True)
class Misaligned:
    """A decentred pupil in a system, tilted about the pupil's own centre.

    decentre: position (x, y) [m] of the pupil's centre relative to the axis.
    tilt: angles (x, y) [rad], -0.2 to 0.2. A positive angle moves the pupil's +x (or +y) side in the direction of the
        light.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
    """

    pupil: Pupil
    decentre: Point = (0.0, 0.0)
    tilt: Point = (0.0, 0.0)

    def __post_init__(self) -> None:
        of_kind("pupil", self.pupil, Pupil, "Pupil(25e-6)")
        object.__setattr__(self, "decentre", point_2d("decentre", self.decentre, "lengths (x, y) [m]"))
        x, y = point_2d("tilt", self.tilt, "angles (x, y) [rad]")
        tilt = tuple(in_range("tilt", angle, -STEEPEST_TILT, STEEPEST_TILT) for angle in (x, y))
        object.__setattr__(self, "tilt", tilt)


@dataclass(frozen=True)
class Alignment:
    """Position of a plane: its centre (x, y) [m], and the tangents of its tilt along x and y."""

    centre: Point = (0.0, 0.0)
    slope: Point = (0.0, 0.0)

    @classmethod
    def from_element(cls, element: Misaligned) -> Alignment:
        x, y = element.tilt
        return cls(element.decentre, (math.tan(x), math.tan(y)))

    @property
    def steepness(self) -> float:
        return math.hypot(*self.slope)

    def beside(self, other: Alignment) -> Point:
        """Return the centre (x, y) [m] of this plane relative to the centre of another plane."""
        return self.centre[0] - other.centre[0], self.centre[1] - other.centre[1]

    def nodes(self, radius: float, sine: float, wavelength: float, allowed: float) -> tuple[np.ndarray, float]:
        """Return the depths [m] between which fields are interpolated, and the error of the intensity.

        If one depth is sufficient, that depth is 0.

        Let ζ be the largest depth, k the wave number, and θ the largest angle of the light to the axis. Between the
        depths 0 and ζ, the phase of the field without its carrier changes by at most φ = kζ (1 - cos θ)/2. The carrier
        is the part of the field that varies fast with the depth. Interpolation between n Chebyshev nodes has an error
        of at most φⁿ / (2ⁿ⁻¹ n!).

        radius: largest distance [m] from the centre.
        sine: largest sin θ of the light.
        wavelength: wavelength [m] in the medium.
        allowed: largest error of the intensity.

        Raises:
            AccuracyError: the tilt is too large for this interpolation.
        """
        deepest = self.steepness * radius
        phase = 2 * math.pi / wavelength * deepest * slowness(sine)
        for count in range(1, MOST_NODES + 1):
            error = 2 * MEAN_OVER_PUPIL * phase**count / (2 ** (count - 1) * math.factorial(count))
            if error <= allowed:
                return deepest * np.cos(np.pi * (np.arange(count) + 0.5) / count) * (count > 1), error
        raise AccuracyError(
            f"tilt: {math.atan(self.steepness):.2g} rad over a radius of {radius:.3g} m is too large for light at "
            f"{math.degrees(math.asin(min(sine, 1))):.2g}° to the axis: widen the tolerance"
        )

    def weights(self, nodes: np.ndarray, grid: Grid, turns: float, types: Precision) -> list[np.ndarray]:
        """Return L_j(ζ) exp(2πi ζ turns) at the samples of a grid, as one array (y, x) per node j.

        L_j are the Lagrange polynomials of the nodes, and ζ is the depth [m] of the tilted plane at a sample, relative
        to the plane's centre. The grid is centred on the plane's centre.

        turns: number of waves per metre of depth [1/m].
        """
        depth, found = self.depth(grid).astype(types.dtype), []
        sides = (sample_positions(n, grid.dx) * slope for n, slope in zip(grid.shape, self.slope[::-1], strict=True))
        waves = (np.exp(2j * np.pi * turns * side).astype(types.complex_dtype) for side in sides)
        carrier = np.multiply.outer(*waves)
        for at in nodes.tolist():
            others = ((depth - other) / (at - other) for other in nodes.tolist() if other != at)
            found.append(math.prod(others, start=1) * carrier)
        return found

    def depth(self, grid: Grid) -> np.ndarray:
        """Return the depth ζ [m] of the tilted plane at the samples of a grid about the centre, (y, x)."""
        rows, columns = (sample_positions(n, grid.dx) for n in grid.shape)
        found: np.ndarray = np.add.outer(self.slope[1] * rows, self.slope[0] * columns)
        return found

    def error(self, sine: float) -> float:
        """Return the relative error of the intensity that is due to the approximate treatment of the plane's tilt.

        sine: largest sin θ of the light, where θ is its angle to the axis.
        """
        return self.steepness * sine**2 * (self.steepness + sine)

    def on_element(self, x: Array, y: Array, types: Precision) -> tuple[Array, Array]:
        """Return coordinates along the tilted plane, given coordinates (x, y) [m] perpendicular to the axis."""
        if not self.steepness:
            return x, y
        (sx, sy), stretch = self.slope, math.hypot(1, self.steepness) - 1
        along = (x * sx + y * sy) * opaque(types, stretch / self.steepness**2)
        return x + along * sx, y + along * sy


ALIGNED = Alignment()


@dataclass(frozen=True)
class DepthFactors:
    """Arrays that multiply fields and their spectra in a step between tilted planes.

    The field at a point of a tilted plane is interpolated between the fields at a few fixed depths along the axis.

    leaving: for the field that leaves a plane, one pair of arrays for each fixed depth: interpolation weights (y, x),
        and factors (fy, fx) that propagate the spectrum from the fixed depth.
    arriving: the same pairs for the field that arrives at the next plane. The factors propagate the spectrum to the
        fixed depth.
    """

    leaving: list[tuple[Any, Any]]
    arriving: list[tuple[Any, Any]]


@dataclass(frozen=True)
class Depths:
    """A few fixed depths along the axis, for the propagation of a field from one tilted plane to another.

    The field is propagated only from and to these depths. At any point of a tilted plane, it is interpolated between
    the fields at these depths.

    leaving: for the plane that the light leaves, depths [m], (depth,), and one array of interpolation weights (y, x)
        per depth, see `Alignment.weights`.
    arriving: the same for the plane at which the light arrives.
    turns: (1 - c)/λ [1/m], where c = (1 + cos θ)/2 and θ is the largest angle of the light to the axis. It is the
        number of waves per metre of depth ζ by which the carrier exp(ikcζ) of the field falls behind exp(ikζ).
    slope: tangents of the tilt along x and y of the plane that the light leaves.
    """

    leaving: tuple[np.ndarray, list[np.ndarray]]
    arriving: tuple[np.ndarray, list[np.ndarray]]
    turns: float
    slope: Point

    def factors(self, sines: np.ndarray, wavelength: float, types: Precision) -> DepthFactors:
        """Return the interpolation weights, and the factors that propagate each frequency to or from each depth.

        At the depth ζ, the factor is exp(±2πi ζ [turns - (1 - cos θ)/λ]), where θ is the angle of the frequency's wave
        to the axis. The sign is + for light that arrives and - for light that leaves. `turns` is the number of waves
        per metre by which the carrier, the part of the field that varies fast with the depth, falls behind a wave along
        the axis. The factor of light that leaves a plane tilted by α also includes 1 - tan α sin θ, an approximation of
        the obliquity factor.

        sines: sin θ of each frequency along an axis of the spectrum.
        wavelength: wavelength [m] in the medium.
        """
        slow, found = self.turns - sags(sines) / wavelength, []
        for sign, (nodes, weights) in ((-1, self.leaving), (1, self.arriving)):
            found.append(
                [(w, turned(1.0, sign * at * slow, types.dtype)) for at, w in zip(nodes, weights, strict=True)]
            )
        oblique = (1 - np.add.outer(self.slope[1] * sines, self.slope[0] * sines)).astype(types.dtype)
        return DepthFactors([(weight, factor * oblique) for weight, factor in found[0]], found[1])


def sags(sines: np.ndarray) -> np.ndarray:
    """Return 1 - cos θ for each frequency of a spectrum, (fy, fx); 1 for evanescent waves.

    sines: sin θ of each frequency along an axis.
    """
    squared = np.minimum(np.add.outer(sines * sines, sines * sines), 1)
    found: np.ndarray = squared / (1 + np.sqrt(1 - squared))
    return found


def slowness(sine: float) -> float:
    """Return (1 - cos θ)/2 for light whose angles to the axis are at most θ.

    The field of this light is a carrier exp(ikcζ) times a function that varies slowly with the depth ζ along the axis.
    The result is 1 - c, with c = (1 + cos θ)/2.

    sine: sin θ.
    """
    return sine**2 / (2 * (1 + math.sqrt(max(1 - sine**2, 0))))


def path_to_tilted_plane(source: PointSource, alignment: Alignment, grid: Grid) -> np.ndarray:
    """Return the path [m] of a source's light from the untilted to the tilted plane of a pupil, minus the depth ζ.

    The depth ζ is the distance between both planes along the axis, see `Alignment.depth`. The result has one value for
    each sample of a grid about the pupil's centre, (y, x).
    """
    tangents = [math.tan(angle) for angle in source.angle]
    distance = number(source.distance)
    per = 0.0 if math.isinf(distance) else 1 / distance
    x, y = tangents[0] + grid.x * per, tangents[1] + grid.y * per
    squared = np.add.outer(np.square(y), np.square(x))
    # cos θ - 1 = -tan²θ / (1 + tan²θ + √(1 + tan²θ))
    found: np.ndarray = -alignment.depth(grid) * squared / (1 + squared + np.sqrt(1 + squared))
    return found


def seen_from(source: PointSource, centre: Point) -> tuple[PointSource, float]:
    """Return a source relative to another centre (x, y) [m], and the difference [m] between two paths of its light.

    The difference is the path to the new centre minus the path to the old one. Paths are measured in vacuum.
    """
    distance, tangents = number(source.distance), [math.tan(angle) for angle in source.angle]
    along = (centre[0] * tangents[0] + centre[1] * tangents[1]) / math.hypot(*tangents, 1)
    if math.isinf(distance):
        return source, along
    moved = [tangent + at / distance for tangent, at in zip(tangents, centre, strict=True)]
    before, after = (distance * math.hypot(*t, 1) for t in (tangents, moved))
    excess = centre[0] ** 2 + centre[1] ** 2 + 2 * before * along
    return PointSource(source.distance, (math.atan(moved[0]), math.atan(moved[1]))), excess / (before + after)
