"""The light behind a steep relief or wavefront, convolved with a Gaussian, so that few samples represent it.

The convolution multiplies light of the spatial frequency ν by e^{-2π²δ²ν²}, where δ is the standard deviation of the
Gaussian. It nearly removes light that is too steep to arrive in the window in which the image is computed. Light that
arrives in the window is only attenuated. Division of the spectrum of the samples by e^{-2π²δ²ν²} restores this light.

Within the width of the Gaussian, the phase is approximated by a quadratic function, with the slope and the curvature of
the wavefront. The convolution then has a closed form. Near the edge of the aperture, the edge is approximated by a
straight line. The samples therefore contain the light that the edge diffracts, even where the relief is steep. The
fraction of the Gaussian that lies on the open side of this line is a complementary error function of a complex
argument. At a corner, the fractions for both edges are multiplied. The largest neglected term is the third derivative
of the phase, times δ³.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from optics.apertures.aperture import Aperture
from optics.elements.beam import Beam
from optics.elements.wavefront_slopes import derivative

__all__ = ["REACH", "Side", "SmoothPupil", "sides_of"]

REACH = 5.0  # choice, in δ: distance from the edge within which the edge changes the light
DARKEST = 18.0  # choice: samples darker than e^-18 are omitted
PARALLEL = 1e-6  # choice: ratio of the variances `along` and `variance` of `_within` below which sides are parallel
TINY = 1e-30  # avoids a division by 0 in the middle of a circle
INSIDE = 1e-6  # distance from the edge, in radii, of the points at which the aperture is open or not
TRIED = 101  # number of points along an axis at which the sides of an aperture are compared with its opening


@dataclass(frozen=True)
class Side:
    """A straight line or a circle that bounds an aperture. Lengths are in radii of the pupil.

    sign: 1 if the opening lies inside the circle, -1 if it lies outside.
    centre, radius: centre and radius of the circle. The radius is 0 for a line.
    normal, offset: unit normal vector of the line, which points out of the opening, and distance of the line from the
        axis along this vector.
    """

    sign: int = 1
    centre: tuple[float, float] = (0.0, 0.0)
    radius: float = 0.0
    normal: tuple[float, float] = (0.0, 0.0)
    offset: float = 0.0

    def depth(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the distance [radii] of points from the side, and the normal (x, y) that points out of the opening.

        The distance is positive inside the opening and negative outside.
        """
        if self.radius == 0:
            depth = self.offset - self.normal[0] * x - self.normal[1] * y
            return depth, np.full_like(depth, self.normal[0]), np.full_like(depth, self.normal[1])
        across, along = x - self.centre[0], y - self.centre[1]
        distance = np.maximum(np.hypot(across, along), TINY)
        return self.sign * (self.radius - distance), self.sign * across / distance, self.sign * along / distance


@lru_cache(maxsize=64)
def sides_of(aperture: Aperture) -> tuple[Side, ...] | None:
    """Return the lines and circles that bound an aperture; None if they do not describe it completely.

    Each side, a line or a circle, divides the plane into an open and a dark region. The sides describe the aperture if
    it is the intersection of the open regions of all sides. This is true for circles, single rings, slits and convex
    polygons.
    """
    outline, sides = aperture.outline, []
    for start, end in outline.segments:
        along = (end - start) / np.hypot(*(end - start))
        normal, middle = np.array([along[1], -along[0]]), (start + end) / 2
        outwards = -1 if aperture.contains(*(middle + INSIDE * normal)[:, None])[0] else 1
        sides.append(Side(normal=tuple(outwards * normal), offset=float(outwards * normal @ middle)))
    for x, y, radius, begin, end in outline.arcs:
        if end - begin < 2 * math.pi - 1e-9:
            return None
        inside = aperture.contains(np.array([x + radius - INSIDE]), np.array([y]))[0]
        sides.append(Side(1 if inside else -1, (float(x), float(y)), float(radius)))
    at = np.linspace(-1, 1, TRIED) * (1 + 1e-4)  # no point lies on an edge
    x, y = np.meshgrid(at, at)
    depth = np.min([side.depth(x, y)[0] for side in sides], axis=0)
    clear = np.abs(depth) > INSIDE
    return tuple(sides) if np.array_equal(depth[clear] > 0, aperture.contains(x, y)[clear]) else None


class _Gaussian(NamedTuple):
    """A complex Gaussian around each sample: the light near the sample, times the real Gaussian of a convolution.

    The light is convolved with this real Gaussian to smooth it. The variable of both factors is the displacement (x, y)
    from the sample. The phase of the light is approximated by a quadratic function of the displacement, so the product
    is a Gaussian with complex parameters.

    log: logarithm of the integral of the complex Gaussian.
    mean: mean displacement (x, y) [m].
    covariance: covariances xx, xy and yy of the displacement [m²].
    """

    log: np.ndarray
    mean: tuple[np.ndarray, np.ndarray]
    covariance: tuple[np.ndarray, np.ndarray, np.ndarray]

    def along(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the mean [m] and the variance [m²] of one component of the displacement from each sample.

        x, y: components of the unit vectors along which the component of the displacement is taken.
        """
        return x * self.mean[0] + y * self.mean[1], self.between((x, y), (x, y))

    def between(self, one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Return the covariance [m²] between two components of the displacement from each sample.

        one, other: unit vectors (x, y) along which the two components of the displacement are taken.
        """
        xx, xy, yy = self.covariance
        return one[0] * other[0] * xx + (one[0] * other[1] + one[1] * other[0]) * xy + one[1] * other[1] * yy

    def at(self, points: np.ndarray) -> _Gaussian:
        """Return the Gaussians of the samples with the indices `points`, in double precision."""
        log, mean_x, mean_y, *covariance = (
            part[points].astype(complex) for part in (self.log, *self.mean, *self.covariance)
        )
        return _Gaussian(log, (mean_x, mean_y), (covariance[0], covariance[1], covariance[2]))


@dataclass(frozen=True)
class SmoothPupil:
    """A pupil whose light is convolved with a Gaussian.

    sides: the lines and circles that bound the aperture.
    radius: radius [m] of the pupil.
    width: width δ [m] of the Gaussian, its standard deviation.
    """

    sides: tuple[Side, ...]
    radius: float
    width: float

    @property
    def outermost(self) -> float:
        """Distance from the axis [m] beyond which the samples are dark."""
        return self.radius + REACH * self.width

    @cached_property
    def exponent(self) -> float:
        """Coefficient 2π²δ² [m²] of the factor e^{-2π²δ²ν²}, by which light of the spatial frequency ν is attenuated.

        δ is the standard deviation `width` of the Gaussian with which the light is convolved.
        """
        return 2 * (math.pi * self.width) ** 2

    def light(self, beam: Beam, x: np.ndarray, y: np.ndarray, dtype: Any) -> np.ndarray:
        """Return the light behind the pupil, convolved with a Gaussian of the width `width`, complex (y, x).

        x, y: evenly spaced positions [m] along each axis.
        dtype: type of the real and imaginary parts.
        """
        waves, pitch = beam.waves(x[None, :], y[:, None]), float(x[1] - x[0])
        along = derivative(waves.T, pitch).T.astype(dtype), derivative(waves, pitch).astype(dtype)
        across, down = ((at / self.radius).astype(dtype) for at in (x[None, :], y[:, None]))
        depth = np.min([side.depth(across, down)[0] for side in self.sides], axis=0)
        reach = REACH * self.width / self.radius
        bright = along[0] ** 2 + along[1] ** 2 < DARKEST / self.exponent
        kept = (depth > -reach) & (bright | (depth < reach))
        bends = (
            derivative(along[0].T, pitch).T[kept],
            derivative(along[0], pitch)[kept],
            derivative(along[1], pitch)[kept],
        )
        waves = waves[kept]
        inner = self._gaussian((waves - np.rint(waves)).astype(dtype), (along[0][kept], along[1][kept]), bends)
        values, near = np.exp(inner.log), np.flatnonzero(depth[kept] < reach)
        row, column = (at[near] for at in np.nonzero(kept))
        values[near] = self._within(inner.at(near), x[column] / self.radius, y[row] / self.radius)
        found = np.zeros(kept.shape, values.dtype)
        found[kept] = values
        return found

    def _gaussian(
        self, waves: np.ndarray, slope: tuple[np.ndarray, np.ndarray], bends: tuple[np.ndarray, ...]
    ) -> _Gaussian:
        """Return the Gaussian e^{-u²/2δ²} e^{2πi (W + ∇W·u + uᵀHu/2)} / 2πδ² of the displacement u.

        waves: W, the phase behind the pupil [waves]. Whole waves may be subtracted, as they do not change the result.
        slope: gradient of W [1/m].
        bends: H, the second derivatives of W along xx, xy and yy [1/m²].
        """
        square = self.width**2
        xx, xy, yy = (-2j * math.pi * square * bend for bend in bends)
        determinant = (1 + xx) * (1 + yy) - xy * xy
        covariance = square * (1 + yy) / determinant, -square * xy / determinant, square * (1 + xx) / determinant
        along_x, along_y = (2j * math.pi * part for part in slope)
        mean_x = covariance[0] * along_x + covariance[1] * along_y
        mean_y = covariance[1] * along_x + covariance[2] * along_y
        log = 2j * math.pi * waves + (along_x * mean_x + along_y * mean_y) / 2
        return _Gaussian(log - np.log(determinant) / 2, (mean_x, mean_y), covariance)

    def _within(self, inner: _Gaussian, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the integral of each Gaussian over the aperture, complex (point,).

        Each side of the aperture is a line or a circle that divides the plane into an open and a dark region. The
        integral over the whole plane is multiplied by a factor for each side near the centre of the Gaussian: the
        fraction of the Gaussian that lies in the open region of this side.

        The integral is the light of the pupil, smoothed by a convolution. Where the relief is steep, the convolution
        removes nearly all light. Only light that is diffracted at one of the sides remains, and it comes from points on
        this side. The factors of the other sides are therefore computed from the values of the Gaussian on the line
        along this side.

        inner: Gaussians around the points.
        x, y: positions of the points, the centres of the Gaussians, in radii of the pupil.
        """
        depth, across, down = np.stack([np.broadcast_arrays(*side.depth(x, y)) for side in self.sides], axis=1)
        mean, variance = inner.along(across, down)
        u = (depth * self.radius - mean) / np.sqrt(2 * variance)
        near = depth < REACH * self.width / self.radius
        each = np.arange(len(x))
        first = np.where(near, (-u * u).real, -np.inf).argmax(axis=0), each
        log, factor = _behind(u[first])
        steep = (-(u[first] ** 2)).real > 0
        common = inner.between((across[first], down[first]), (across, down)) * steep
        mean = mean + common * (depth[first] * self.radius - mean[first]) / variance[first]
        along = variance - common**2 / variance[first]
        along = np.where(np.abs(along) > PARALLEL * np.abs(variance), along, variance)
        u = (depth * self.radius - mean) / np.sqrt(2 * along)
        near[first] = False
        for own, mine in zip(u, near, strict=True):
            more, fraction = _behind(own[mine])
            log[mine] += more
            factor[mine] *= fraction
        found: np.ndarray = np.exp(inner.log + log) * factor
        return found


def _behind(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (a, b) with e^a b = erfc(-u)/2. Neither number overflows.

    The product is the fraction of a Gaussian that lies on one side of a line. u is the distance of the line from the
    mean, divided by √2 times the standard deviation. u may be complex.

    The scaled function w(z) = e^{-z²} erfc(-iz) is bounded in the upper half plane (Abramowitz & Stegun, 7.1.3).
    """
    from scipy.special import wofz

    outside = u.real < 0
    rest = wofz(1j * np.where(outside, -u, u)) / 2
    square = -u * u
    steep = square.real > 0
    ratio = np.exp(np.where(steep, -square, square))
    fraction = np.where(outside, rest, np.where(steep, ratio - rest, 1 - ratio * rest))
    return np.where(outside | steep, square, 0), fraction
