"""Rays of a pupil in geometrical optics. Approximate methods predict their errors from the rays' hit points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.apertures.aperture import Aperture
from optics.elements.wavefront_slopes import Slopes

__all__ = ["MARGIN", "Rays", "brightness", "disk_area", "mismatch"]

CELLS = 32  # choice: number of cells along each side of the area that rays hit
ACROSS = 65  # choice: largest number of rays along a diameter
# Choice: safety factor on predicted model errors, which are estimated from a few rays. test_fresnel.py and
# test_geometric.py check for random pupils that predictions with this factor exceed the true errors.
MARGIN = 1.4


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays from points (x, y) of the aperture to points (to_x, to_y) of a plane behind it. Lengths in m.

    norm, determinant: half the squared Frobenius norm, and the determinant, of the gradient of the map from (x, y) to
        (to_x, to_y).
    """

    x: np.ndarray
    y: np.ndarray
    to_x: np.ndarray
    to_y: np.ndarray
    norm: np.ndarray
    determinant: np.ndarray

    @cached_property
    def most(self) -> np.ndarray:
        """Largest magnification at each ray, over all directions in the aperture.

        It is the larger singular value of the Jacobian matrix of the map from a point of the aperture to the point that
        the ray hits.
        """
        root = np.sqrt(np.maximum(np.square(self.norm) - np.square(self.determinant), 0))
        found: np.ndarray = np.sqrt(self.norm + root)
        return found

    @cached_property
    def least(self) -> np.ndarray:
        """Smallest magnification at each ray, over all directions in the aperture.

        It is the smaller singular value of the Jacobian matrix of the map from a point of the aperture to the point
        that the ray hits.
        """
        return np.abs(self.determinant) / np.maximum(self.most, 1e-30)

    @classmethod
    def from_slopes(cls, slopes: Slopes, aperture: Aperture, distance: float, medium_n: float) -> Rays:
        """Return the rays that propagate, those for which the sine of the angle between ray and axis is below 1.

        Let p be the local slope of the wavefront, already divided by the index of the medium. The angle θ between the
        ray and the axis then satisfies tan θ = p/√(1 - p²).
        """
        step = max(1, (slopes.grid.shape[0] - 1) // (ACROSS - 1))
        centred = slice(slopes.grid.shape[0] // 2 % step, None, step)
        x, y = np.meshgrid(slopes.grid.x[centred], slopes.grid.y[centred])
        px, py = (slope[centred, centred] / medium_n for slope in (slopes.along_x, slopes.along_y))
        squared = px * px + py * py
        tangent = distance / np.sqrt(np.maximum(1 - squared, 1e-6))
        to_x, to_y = x + tangent * px, y + tangent * py
        inside = aperture.contains(x / slopes.radius, y / slopes.radius) & (squared < 1 - 1e-6)
        pitch = step * slopes.grid.dx
        (yx, xx), (yy, xy) = ([part[inside] for part in np.gradient(to, pitch)] for to in (to_x, to_y))
        norm = (xx * xx + yy * yy + xy * xy + yx * yx) / 2
        return cls(x[inside], y[inside], to_x[inside], to_y[inside], norm, xx * yy - xy * yx)

    def __len__(self) -> int:
        return len(self.x)

    @property
    def folded(self) -> bool:
        """True if several rays may reach the same point of the plane behind the aperture."""
        return len(self) > 0 and float(np.sign(self.determinant.min())) < float(np.sign(self.determinant.max()))

    @property
    def image_area(self) -> float:
        """Area [m²] that the rays' hit points cover, see `disk_area`."""
        return disk_area(self.to_x, self.to_y)

    def densest(self) -> list[tuple[float, float]]:
        """Return two points (x, y) [m]: the median of all hit points, and the mean of those in the densest region.

        The area that rays hit is divided into CELLS by CELLS equal rectangles. The densest region is the rectangle with
        the most hit points.
        """
        counts, x, y = np.histogram2d(self.to_x, self.to_y, CELLS)
        i, j = np.unravel_index(counts.argmax(), counts.shape)
        within = (self.to_x >= x[i]) & (self.to_x <= x[i + 1]) & (self.to_y >= y[j]) & (self.to_y <= y[j + 1])
        middle = float(self.to_x[within].mean()), float(self.to_y[within].mean())
        return [(float(np.median(self.to_x)), float(np.median(self.to_y))), middle]

    def some(self, most: int) -> Rays:
        """Return `most` evenly spread rays, or all rays if there are fewer.

        From one selected ray to the next, the position in the list of rays advances by 0.618 of the list's length (the
        golden section), and continues at the start after the end. The selected rays therefore do not align with the
        rows of the grid.
        """
        turns = (np.arange(min(most, len(self))) + 0.5) * (math.sqrt(5) - 1) / 2
        chosen = ((turns % 1) * len(self)).astype(int) if most < len(self) else slice(None)
        parts = (self.x, self.y, self.to_x, self.to_y, self.norm, self.determinant)
        return Rays(*(part[chosen] for part in parts))


def disk_area(x: np.ndarray, y: np.ndarray) -> float:
    """Return the area of a uniform disk with the same mean square distance from its centre as the given points."""
    return 2 * math.pi * float(np.var(x) + np.var(y)) if len(x) else 0.0


def brightness(area: float, cell: float) -> float:
    """Return the sum of squared samples of a PSF, times the area `cell` [m²] of a sample, in 1/m².

    The PSF has unit power, spread over `area` [m²]. If samples resolve it, the result is 1/area. Coarse samples may hit
    the maximum of the PSF without resolving it, and then the maximum alone determines the result. The maximum is taken
    to be π²/4 times the mean 1/area, as in an Airy pattern.
    """
    area = max(area, 1e-30)
    return max(1.0, (math.pi**2 / 4) ** 2 * cell / area) / area


def mismatch(wrong: float, exact: float) -> float:
    """Return the relative L2 error of a wrong PSF that hardly overlaps the exact PSF, times a safety factor.

    wrong, exact: `brightness` of the wrong and of the exact PSF.
    """
    return MARGIN * math.sqrt(1 + wrong / exact)
