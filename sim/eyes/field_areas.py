"""Rectangles of the visual field for an eye behind a pupil, and the share of each receptor's field in each of them.

A receptor's signal is a sum over rectangles: the mean light in a rectangle times the share of the receptive field in
it. The result is exact if only the field, and not the light, varies within a rectangle. If fields are hardly wider than
receptors, as behind a lens in focus, one rectangle per receptor is enough, since sharp fields are the rectangles
themselves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim.eyes.receptive_fields import ReceptiveFields

# Chosen: the largest share of all receptors' light that may come from beyond either side of the lattice. This light is
# then attributed to the rectangles within. Behind a lens in focus, a quarter as wide as the retina, the share is 0.012
# for 1 x 4 receptors and 0.004 for 15 x 15. These lattices have no rim, and a rim would change their errors by less
# than a tenth.
BEYOND = 0.015


@dataclass(frozen=True)
class FieldAreas:
    """A lattice of rectangles, row by row.

    edges: edges of its rows and of its columns, relative to the eye's axis [receptor pitches], y down
    """

    edges: tuple[np.ndarray, np.ndarray]

    @classmethod
    def from_fields(cls, fields: ReceptiveFields, parts: tuple[float, float], beyond: float = BEYOND) -> FieldAreas:
        """Divide each receptor's square into rows and columns, and add a rim of rectangles around the receptors.

        The rim is wide enough that at most the share `beyond` of the light comes from beyond it, on either side. With
        half a row per receptor, two receptors share a row; the outermost rows may then reach beyond the outermost
        receptors.

        parts: rows and columns per receptor
        """
        found = []
        for axis, (n, per_receptor) in enumerate(zip(fields.resolution, parts, strict=True)):
            field = fields.field.sum(axis=2 - axis)
            profile = np.mean(field / field.sum(axis=-1, keepdims=True), axis=0)
            ends = profile, profile[::-1]
            lower, upper = (_rim(end, (n, per_receptor), fields.cells, beyond) for end in ends)
            within = _within(n, per_receptor)
            found.append((np.arange(-lower, within + upper + 1) - within / 2) / per_receptor)
        return cls((found[0], found[1]))

    @property
    def middles(self) -> np.ndarray:
        """Centres of the rectangles, x right, y down [receptor pitches], (rectangle, 2)."""
        y, x = ((e[1:] + e[:-1]) / 2 for e in self.edges)
        return np.stack(np.broadcast_arrays(x[None], y[:, None]), axis=-1).reshape(-1, 2)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of a rectangle [receptor pitches]."""
        y, x = self.edges
        return float(x[1] - x[0]), float(y[1] - y[0])

    def weights(self, fields: ReceptiveFields, receptors: np.ndarray) -> np.ndarray:
        """Return the weights of the rectangles' mean light for some receptors (numbered row by row), (plane, receptor,
        rectangle). A receptor's weights sum to the power of its field."""
        size, cells = fields.field.shape[1], fields.cells
        rows, columns = np.divmod(receptors, fields.resolution[1])
        down, across = (
            {i: _shares(e, i + 0.5 - n / 2, size, cells) for i in np.unique(places)}
            for e, n, places in zip(self.edges, fields.resolution, (rows, columns), strict=True)
        )
        in_columns = {j: fields.field @ shares.T for j, shares in across.items()}
        found = np.stack([down[i] @ in_columns[j] for i, j in zip(rows, columns, strict=True)], axis=1)
        found = found.reshape(*found.shape[:2], -1)
        found *= fields.power[:, None, None] / found.sum(axis=2, keepdims=True)
        return found


def _within(n: int, per_receptor: float) -> int:
    """Number of rectangles that n receptors in a line occupy."""
    return math.ceil(n * per_receptor - 1e-9)


def _rim(profile: np.ndarray, line: tuple[int, float], cells: int, beyond: float) -> int:
    """Number of rectangles before the first receptor's rectangle.

    It is the smallest number that leaves at most the share `beyond` of a line's light outside.

    profile: profile of a receptor's field along the line
    line: number of receptors in the line, and rectangles per receptor
    """
    n, per_receptor = line
    # Share of a field's power in its first cells, as a function of their number.
    before = np.concatenate([[0.0], np.cumsum(profile)])
    start = (len(profile) - cells) / 2
    overhang = (_within(n, per_receptor) / per_receptor - n) / 2
    rims = np.arange(max(per_receptor, 1) * len(profile)) / per_receptor + overhang
    ends = start - cells * (np.arange(n)[:, None] + rims)
    lost = np.interp(ends, np.arange(len(before)), before).mean(axis=0)
    return int(np.argmax(lost <= beyond))


def _shares(edges: np.ndarray, centre: float, size: int, cells: int) -> np.ndarray:
    """Return the share of each of a field's cells that lies between successive edges, (rectangle, cell); centre: centre
    of the field, in units of the edges."""
    places = (edges - centre) * cells + size / 2
    return np.diff(np.clip(places[:, None] - np.arange(size), 0, 1), axis=0)
