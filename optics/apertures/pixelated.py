"""Quadrature over an opening tiled by square pixels, for integrands that jump between pixels.

Whole pixels have Gauss-Legendre nodes. Pixels cut by the opening's edge are divided into panels with smooth ends at the
points where the edge enters and leaves them (`strips`; `PixelatedAperture.nodes`). If nodes must lie on a grid of rows
and columns, cut pixels use the nodes of whole ones. Their weights integrate the interpolating polynomial over the open
part of the pixel (`PixelatedAperture.weights`).
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

MOMENT_DIGITS = 8.0  # choice: accuracy of the moments of a cut pixel
# Choice, nodes along a pixel: with more, cut pixels would need too many moments.
MOST_NODES = 32


@dataclass(frozen=True)
class PixelatedAperture(Aperture):
    """An opening over which a wave jumps at the borders of count x count square pixels that fill [-1, 1]²."""

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
        """Nodes along each pixel that make rows and columns as accurate as `nodes`; None if too many are needed."""
        share = min(1.0, len(self._cut) * self._pitch**2 / self.area)  # share that interpolation affects
        turns = np.array(pi * cycles * self._pitch)
        across = max(
            gauss_legendre_count(cycles * self._pitch, digits + 0.3),
            int(harmonics(turns, max(digits + 0.3 + log10(share), 0.3))) if share else 1,
        )
        return across if across <= MOST_NODES else None

    def rows(self, across: int) -> np.ndarray:
        """Positions of rows and columns of nodes, ascending, in units of R, (count x across,)."""
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
        """Yield x, y and weights over each panel of the open part of a cut pixel: see `strips`."""
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
        # Exact for the Lagrange polynomials of the nodes, which have degree across - 1 in x and in y.
        total = np.zeros((across, across))
        for x, y, size in aperture._pieces(np.array([row, column]), 0.0, MOMENT_DIGITS, across - 1):
            in_x, in_y = (
                lagrange_basis((at - aperture._centres[k]) / pitch + 0.5, u) for at, k in ((x, column), (y, row))
            )
            total += in_y * size @ in_x.T
        weights[row, :, column, :] = total
    side = count * across
    return weights.reshape(side, side)
