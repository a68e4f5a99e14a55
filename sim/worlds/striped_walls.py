"""Walls that fill cells of a grid, built from boxes with stripes. Each box has a random stripe frequency."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from sim.worlds import materials
from sim.worlds.layout import CELL, add_wall, cell_centers

# Maximum number of cells in one box. A new stripe frequency therefore begins at least every 8 m.
LONGEST_WALL = 4

# Stripe periods along a wall [m]. The end faces of a box are one cell long. They have as many stripes as its long
# sides, because MuJoCo repeats a texture equally often on all faces.
STRIPE_PERIODS = (4.0, 2.0, 1.0, 2 / 3)


def add_striped_walls(spec: mujoco.MjSpec, walls: np.ndarray, rngs: Sequence[np.random.Generator]) -> None:
    """Add the walls of a grid as boxes, each with a random stripe frequency.

    walls: cells that are walls, boolean (row, column)
    rngs: random number generators. The rows of the grid are divided into as many equal parts as there are generators,
        and each generator draws the stripes of one part
    """
    materials.add_texture(spec, "stripes", materials.stripes((8, 256), 2, axis=1))
    for i, period in enumerate(STRIPE_PERIODS):
        materials.add_textured(spec, f"stripes_{i}", "stripes", repeat=(2 / period, 1), uniform=True)
    rows, number = len(walls) // len(rngs), 0
    for part, rng in enumerate(rngs):
        south = part * rows
        for row, column, n_rows, n_columns in merge_walls(walls[south : south + rows], LONGEST_WALL):
            at = np.array(column + (n_columns - 1) / 2), np.array(south + row + (n_rows - 1) / 2)
            frequency = rng.integers(len(STRIPE_PERIODS))
            size = n_columns * CELL, n_rows * CELL
            add_wall(spec, f"wall_{number}", cell_centers(*at, walls.shape), size, f"stripes_{frequency}")
            number += 1


def merge_walls(walls: np.ndarray, longest: int) -> list[tuple[int, int, int, int]]:
    """Return disjoint straight runs of at most `longest` cells that together cover all wall cells.

    Each run is (row, column, number of rows, number of columns). The algorithm is greedy: from the first uncovered
    cell, it compares a run along the row with a run along the column, and uses the longer one.
    """
    left = walls.copy()
    runs = []
    for row, column in np.argwhere(walls):
        if not left[row, column]:
            continue
        along = _run_length(left[row, column : column + longest])
        across = _run_length(left[row : row + longest, column])
        rows, columns = (1, along) if along >= across else (across, 1)
        left[row : row + rows, column : column + columns] = False
        runs.append((int(row), int(column), rows, columns))
    return runs


def _run_length(cells: np.ndarray) -> int:
    return len(cells) if cells.all() else int(np.argmin(cells))
