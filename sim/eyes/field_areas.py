"""Rectangles of the visual field that cover what an eye behind a pupil sees, and how much of each receptor's field lies
in each.

A receptor's signal is the sum over rectangles of the mean light in one times the share of its field in it: exact where
nothing but the field changes within a rectangle. Where fields are hardly wider than receptors, as behind a lens in
focus, one rectangle per receptor does: sharp fields are the rectangles themselves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim.eyes.receptive_fields import ReceptiveFields

# Chosen: of all receptors' light, what may come from beyond either side of the lattice, at most; it is then looked for
# within. Behind a lens in focus, a quarter as wide as the retina, that is .012 for 1 x 4 receptors and .004 for
# 15 x 15: these have no rim, and one would change their errors by less than a tenth.
BEYOND = 0.015


@dataclass(frozen=True)
class FieldAreas:
    """A lattice of rectangles, row by row.

    edges: of its rows and of its columns, from the eye's axis [receptor pitches], y down
    """

    edges: tuple[np.ndarray, np.ndarray]

    @classmethod
    def of(cls, fields: ReceptiveFields, parts: tuple[float, float], beyond: float = BEYOND) -> FieldAreas:
        """Each receptor's square in so many rows and columns, and as many more around them as its light comes from, but
        for such a share beyond either side. Half a row is one that two receptors share; those at the ends may reach
        beyond the last receptors."""
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
        """x right, y down [receptor pitches], (rectangle, 2)."""
        y, x = ((e[1:] + e[:-1]) / 2 for e in self.edges)
        return np.stack(np.broadcast_arrays(x[None], y[:, None]), axis=-1).reshape(-1, 2)

    @property
    def size(self) -> tuple[float, float]:
        """Of a rectangle, width and height [receptor pitches]."""
        y, x = self.edges
        return float(x[1] - x[0]), float(y[1] - y[0])

    def weights(self, fields: ReceptiveFields, receptors: np.ndarray) -> np.ndarray:
        """What each rectangle's mean counts for some receptors (row by row), (plane, receptor, rectangle); a receptor's
        sum to its field's power."""
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
    """Rectangles that n receptors in a line take."""
    return math.ceil(n * per_receptor - 1e-9)


def _rim(profile: np.ndarray, line: tuple[int, float], cells: int, beyond: float) -> int:
    """How many rectangles lie before the first receptor's: so few that no more than this share of the light of a line
    of receptors comes from before; profile: of a receptor's field along that line, line: its receptors, and rectangles
    of each."""
    n, per_receptor = line
    # Of a field that begins so many cells before the line's first receptor, what is before that, per receptor.
    before = np.concatenate([[0.0], np.cumsum(profile)])
    start = (len(profile) - cells) / 2
    overhang = (_within(n, per_receptor) / per_receptor - n) / 2
    rims = np.arange(max(per_receptor, 1) * len(profile)) / per_receptor + overhang
    ends = start - cells * (np.arange(n)[:, None] + rims)
    lost = np.interp(ends, np.arange(len(before)), before).mean(axis=0)
    return int(np.argmax(lost <= beyond))


def _shares(edges: np.ndarray, centre: float, size: int, cells: int) -> np.ndarray:
    """How much of each of a field's cells lies between edges, (rectangle, cell); centre: of the field, edges' units."""
    places = (edges - centre) * cells + size / 2
    return np.diff(np.clip(places[:, None] - np.arange(size), 0, 1), axis=0)
