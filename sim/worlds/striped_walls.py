"""Walls of grid cells as boxes with stripes, whose frequency changes from box to box."""

from __future__ import annotations

import mujoco
import numpy as np

from sim.worlds import materials
from sim.worlds.layout import CELL, add_wall, cell_centers

LONGEST_WALL = 4  # cells in one box: a new stripe frequency at least every 8 m

# Stripe periods along a wall [m]. A box's end faces, which are one cell long, have as many stripes as its whole sides,
# since MuJoCo repeats a texture equally often on all faces.
STRIPE_PERIODS = (4.0, 2.0, 1.0, 2 / 3)


def add_striped_walls(spec: mujoco.MjSpec, walls: np.ndarray, rng: np.random.Generator) -> None:
    """Add the walls, boolean (row, column), each box with a stripe frequency drawn by `rng`."""
    materials.add_texture(spec, "stripes", materials.stripes((8, 256), 2, axis=1))
    for i, period in enumerate(STRIPE_PERIODS):
        materials.add_textured(spec, f"stripes_{i}", "stripes", repeat=(2 / period, 1), uniform=True)
    for i, (row, column, n_rows, n_columns) in enumerate(merge_walls(walls, LONGEST_WALL)):
        center = cell_centers(np.array(column + (n_columns - 1) / 2), np.array(row + (n_rows - 1) / 2), walls.shape)
        frequency = rng.integers(len(STRIPE_PERIODS))
        add_wall(spec, f"wall_{i}", center, (n_columns * CELL, n_rows * CELL), f"stripes_{frequency}")


def merge_walls(walls: np.ndarray, longest: int) -> list[tuple[int, int, int, int]]:
    """Cover wall cells by disjoint straight runs of at most `longest` cells: (row, column, rows, columns) each.

    The algorithm is greedy: of the two runs that start in the first uncovered cell, it uses the longer one.
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
