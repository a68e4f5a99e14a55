"""Quadrature over an opening that is tiled by square pixels, for integrands that jump between pixels.

Pixels that lie wholly inside have Gauss-Legendre nodes. Pixels that the opening's edge cuts can be treated in two ways.
`PixelatedAperture.nodes` divides them into panels at the points where the edge enters and leaves them (see `strips`).
If the nodes must lie on rows and columns, cut pixels have the same nodes as whole pixels, and
`PixelatedAperture.weights` returns weights that integrate the interpolating polynomial over the open part of each
pixel.
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
    """An opening tiled by count x count square pixels that fill [-1, 1]². The integrand may jump at their borders."""

    opening: Aperture
    count: int

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
        """Nodes along a pixel that make rows and columns as accurate as `nodes`; None if there would be too many."""
        # Upper bound on the fraction of the area that lies in cut pixels.
        share = min(1.0, len(self._cut) * self._pitch**2 / self.area)
        turns = np.array(pi * cycles * self._pitch)
        across = max(
            gauss_legendre_count(cycles * self._pitch, digits + 0.3),
            int(harmonics(turns, max(digits + 0.3 + log10(share), 0.3))) if share else 1,
        )
        return across if across <= MOST_NODES else None

    def rows(self, across: int) -> np.ndarray:
        """Positions of the rows (and of the columns) of nodes in units of R, in ascending order, (count x across,)."""
        u, _ = gauss_legendre(across)
        return (self._centres[:, None] + (u - 0.5) * self._pitch).ravel()

    def weights(self, across: int) -> np.ndarray:
        """Weights of the nodes [R²], (row, column)."""
        return _weights(self, across)

    @cached_property
    def _pitch(self) -> float:
        return 2 / self.count

    @cached_property
    def _centres(self) -> np.ndarray:
        centres: np.ndarray = (np.arange(self.count) + 0.5) * self._pitch - 1
        return centres

    @cached_property
    def _near(self) -> np.ndarray:
        """Mask of the pixels that the edge may cut, (row, column)."""
        return self.outline.near(self._centres[None, :], self._centres[:, None], self._pitch / 2)

    @cached_property
    def _whole(self) -> np.ndarray:
        """Mask of the pixels that lie inside, (row, column)."""
        return self.contains(self._centres[None, :], self._centres[:, None]) & ~self._near

    @cached_property
    def _cut(self) -> np.ndarray:
        """Index (row, column) of each pixel that may be cut."""
        return np.argwhere(self._near)

    def _nodes(self, cycles: float, digits: float) -> Nodes:
        u, weight = gauss_legendre(gauss_legendre_count(cycles * self._pitch, digits + 0.3))
        row, column = np.nonzero(self._whole)
        along, across = (self._centres[place][:, None, None] for place in (row, column))
        offset = (u - 0.5) * self._pitch
        shape = len(row), len(u), len(u)
        parts = [
            (
                np.broadcast_to(across + offset, shape).ravel(),
                np.broadcast_to(along + offset[:, None], shape).ravel(),
                np.broadcast_to(np.outer(weight, weight) * self._pitch**2, shape).ravel(),
            ),
            *(piece for at in self._cut for piece in self._pieces(at, cycles, digits)),
        ]
        x, y, size = (np.concatenate(column) for column in zip(*parts, strict=True))
        return Nodes(x, y, size)

    def _pieces(
        self, at: np.ndarray, cycles: float, digits: float, degree: int = 0
    ) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Yield x, y and weights of the nodes in each panel of a cut pixel's open part: see `strips`."""
        bottom, left = self._centres[at] - self._pitch / 2
        box = float(left), float(left + self._pitch), float(bottom), float(bottom + self._pitch)
        return strips(self.outline, box, cycles, digits, degree)

    def _softened(self, edge: SoftEdge) -> SoftAperture:
        raise TypeError("jumps between pixels have no band limit: a soft edge does not make a grid accurate")


@lru_cache(maxsize=4)
def _weights(aperture: PixelatedAperture, across: int) -> np.ndarray:
    u, weight = gauss_legendre(across)
    pitch, count = aperture._pitch, aperture.count
    weights = np.zeros((count, across, count, across))
    rows, columns = np.nonzero(aperture._whole)
    weights[rows, :, columns, :] = np.outer(weight, weight) * pitch**2
    for row, column in aperture._cut:
        # The integrals are exact for the Lagrange polynomials of the nodes, which have degree across - 1 in x and in y.
        total = np.zeros((across, across))
        for x, y, size in aperture._pieces(np.array([row, column]), 0.0, MOMENT_DIGITS, across - 1):
            in_x, in_y = (
                lagrange_basis((at - aperture._centres[k]) / pitch + 0.5, u) for at, k in ((x, column), (y, row))
            )
            total += in_y * size @ in_x.T
        weights[row, :, column, :] = total
    side = count * across
    return weights.reshape(side, side)
