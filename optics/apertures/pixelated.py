"""Quadrature over an opening that is tiled by pixels, for integrands that jump or bend at the borders between pixels.

One such integrand contains the phase of a relief of pixels, which jumps at their borders. Another one contains the
derivative of a spline with respect to one of its samples. This derivative bends at the knots of the spline, because it
is a different polynomial in every cell between knots. For such an integrand, "pixels" means these cells.

Pixels that lie wholly inside have Gauss-Legendre nodes. If the opening's edge cuts a pixel, there are two methods.
`PixelatedAperture.nodes` divides the cut pixel into panels, which are horizontal bands (see `strips`). Panels begin and
end at the heights at which the edge enters or leaves the pixel. If the nodes must lie on rows and columns, cut pixels
have the same nodes as whole pixels, and `PixelatedAperture.weights` returns weights that integrate the interpolating
polynomial over the open part of each pixel.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import log10, pi

import numpy as np

from optics.apertures.aperture import Aperture, Nodes, SoftAperture
from optics.apertures.outline import Outline
from optics.apertures.soft_edge import SoftEdge
from optics.apertures.strips import strips
from optics.numerics.interpolation import lagrange_basis
from optics.numerics.quadrature import gauss_legendre, gauss_legendre_count, harmonics

__all__ = ["PixelatedAperture"]

MOMENT_DIGITS = 8.0  # choice: digits of the integrals of polynomials over the open part of a cut pixel
# Choice: largest number of nodes along a pixel. With more, cut pixels would need too many integrals of polynomials.
MOST_NODES = 32


@dataclass(frozen=True)
class PixelatedAperture(Aperture):
    """An opening tiled by count x count pixels that fill [-1, 1]², for integrals over the opening.

    The functions that are integrated may jump or bend at the borders between pixels.

    borders: ascending borders between pixels, from -1 to 1, the same along x and along y. None: all pixels are squares
        of the same size.
    fixed: number of quadrature nodes along a side of a pixel. None: each call of `nodes` chooses the number according
        to its arguments `cycles`, the highest spatial frequency, and `digits`, the accuracy.
    """

    opening: Aperture
    count: int
    borders: tuple[float, ...] | None = None
    fixed: int | None = None

    @staticmethod
    def squares(opening: Aperture, count: int) -> PixelatedAperture:
        """Return the opening tiled by count x count square pixels of the same size.

        Repeated calls return the same object. The object stores which pixels the opening's edge cuts, so this is
        computed only once, even if many pupils have this opening.
        """
        return _squares(opening, count)

    @classmethod
    def between(cls, opening: Aperture, borders: tuple[float, ...], fixed: int | None = None) -> PixelatedAperture:
        """Return the opening tiled by pixels of different sizes.

        borders: ascending borders between pixels, from -1 to 1, the same along x and along y.
        fixed: see `PixelatedAperture`.
        """
        return cls(opening, len(borders) - 1, borders, fixed)

    @property
    def area(self) -> float:
        return self.opening.area

    @property
    def rotationally_symmetric(self) -> bool:
        return False

    @property
    def half_widths(self) -> tuple[float, float]:
        return self.opening.half_widths

    @property
    def outline(self) -> Outline:
        return self.opening.outline

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.opening.contains(x, y)

    def nodes_across(self, cycles: float, digits: float) -> int | None:
        """Return the number of nodes along a side of a pixel if all nodes lie on rows and columns through the square.

        The number is the field `fixed` if that is not None. Otherwise it is large enough for the accuracy of the nodes
        that `nodes` returns for the same arguments. None: more than 32 nodes would be needed.
        """
        if self.fixed is not None:
            return self.fixed
        turns = np.array(pi * cycles * self.widest)
        across = max(
            gauss_legendre_count(cycles * self.widest, digits + 0.3),
            int(harmonics(turns, max(digits + 0.3 + log10(self.cut_share), 0.3))) if self.cut_share else 1,
        )
        return across if across <= MOST_NODES else None

    @cached_property
    def cut_share(self) -> float:
        """Upper bound of the fraction of the area that lies in pixels cut by the edge."""
        return min(1.0, float(np.prod(self._widths[self._cut], axis=1).sum()) / self.area)

    @property
    def widest(self) -> float:
        """Largest width of a pixel."""
        return float(self._widths.max())

    def rows(self, across: int) -> np.ndarray:
        """Return the positions [pupil radii] of the rows of nodes, in ascending order, array (row,).

        There are `across` rows of nodes in each row of pixels. The columns have the same positions.

        across: number of nodes along a side of a pixel.
        """
        u, _ = gauss_legendre(across)
        return (self._centres[:, None] + (u - 0.5) * self._widths[:, None]).ravel()

    def weights(self, across: int) -> np.ndarray:
        """Return the quadrature weight [squared pupil radii] of each node, array (row, column).

        across: number of nodes along a side of a pixel.
        """
        return _weights(self, across)

    @cached_property
    def _widths(self) -> np.ndarray:
        return np.full(self.count, 2 / self.count) if self.borders is None else np.diff(self.borders)

    @cached_property
    def _centres(self) -> np.ndarray:
        if self.borders is not None:
            return np.asarray(self.borders[:-1]) + self._widths / 2
        centres: np.ndarray = (np.arange(self.count) + 0.5) * (2 / self.count) - 1
        return centres

    @cached_property
    def _near(self) -> np.ndarray:
        """Mask of the pixels that the opening's edge may cut, (row, column)."""
        half = np.maximum.outer(self._widths, self._widths) / 2
        return self.outline.near(self._centres[None, :], self._centres[:, None], half)

    @cached_property
    def _whole(self) -> np.ndarray:
        """Mask of the pixels that lie wholly within the opening, (row, column)."""
        return self.contains(self._centres[None, :], self._centres[:, None]) & ~self._near

    @cached_property
    def _cut(self) -> np.ndarray:
        """Row and column of each pixel that the opening's edge may cut, array (pixel, 2)."""
        return np.argwhere(self._near)

    def node_count(self, cycles: float, digits: float) -> int | None:
        return None if self.fixed is None else int(np.count_nonzero(self._whole | self._near)) * self.fixed**2

    def _nodes(self, cycles: float, digits: float) -> Nodes:
        if self.fixed is not None:
            return self._matrix_nodes(self.fixed)
        u, weight = gauss_legendre(gauss_legendre_count(cycles * self.widest, digits + 0.3))
        row, column = np.nonzero(self._whole)
        (along, height), (across, width) = (
            (self._centres[place][:, None, None], self._widths[place][:, None, None]) for place in (row, column)
        )
        shape = len(row), len(u), len(u)
        parts = [
            (
                np.broadcast_to(across + (u - 0.5) * width, shape).ravel(),
                np.broadcast_to(along + (u - 0.5)[:, None] * height, shape).ravel(),
                (np.outer(weight, weight) * (height * width)).ravel(),
            ),
            *(piece for at in self._cut for piece in self._pieces(at, cycles, digits)),
        ]
        x, y, size = (np.concatenate(column) for column in zip(*parts, strict=True))
        return Nodes(x, y, size)

    def _matrix_nodes(self, across: int) -> Nodes:
        """Return the rows and columns of nodes as single nodes, without the nodes of closed pixels."""
        used = np.kron(self._whole | self._near, np.ones((across, across), dtype=bool))
        x, y = np.meshgrid(at := self.rows(across), at)
        return Nodes(x[used], y[used], self.weights(across)[used])

    def _pieces(
        self, at: np.ndarray, cycles: float, digits: float, degree: int = 0
    ) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Yield x, y and weights of the quadrature nodes in one of the pixels through which the opening's edge runs.

        Nodes lie only in the part of the pixel that is within the opening. This part is divided into panels, which are
        horizontal bands, at the heights at which the edge enters or leaves the pixel, and at the heights of the
        corners, tops and bottoms of the edge.

        at: (row, column) of the pixel.
        cycles, digits, degree: see `strips`.
        """
        bottom, left = self._centres[at] - self._widths[at] / 2
        height, width = self._widths[at]
        box = float(left), float(left + width), float(bottom), float(bottom + height)
        return strips(self.outline, box, cycles, digits, degree)

    def _softened(self, edge: SoftEdge) -> SoftAperture:
        raise TypeError("jumps between pixels have no band limit: a soft edge does not make a grid accurate")


@lru_cache(maxsize=16)
def _squares(opening: Aperture, count: int) -> PixelatedAperture:
    return PixelatedAperture(opening, count)


@lru_cache(maxsize=8)
def _weights(aperture: PixelatedAperture, across: int) -> np.ndarray:
    u, weight = gauss_legendre(across)
    widths, count = aperture._widths, aperture.count
    weights = np.zeros((count, across, count, across))
    rows, columns = np.nonzero(aperture._whole)
    weights[rows, :, columns, :] = np.outer(weight, weight) * (widths[rows] * widths[columns])[:, None, None]
    for row, column in aperture._cut:
        # The integrals are exact for the Lagrange polynomials of the nodes, which have degree across - 1 in x and in y.
        total = np.zeros((across, across))
        for x, y, size in aperture._pieces(np.array([row, column]), 0.0, MOMENT_DIGITS, across - 1):
            in_x, in_y = (
                lagrange_basis((at - aperture._centres[k]) / widths[k] + 0.5, u) for at, k in ((x, column), (y, row))
            )
            total += in_y * size @ in_x.T
        weights[row, :, column, :] = total
    side = count * across
    return weights.reshape(side, side)
