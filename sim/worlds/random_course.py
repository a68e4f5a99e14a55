"""Random courses: paths that bend, split and join again.

On the way to the goal, an agent never has to come back towards its start by more than 1.5 m.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import scipy.ndimage

from sim.worlds.course import GOAL_COLUMNS, MOST_FALL, Cell, Course
from sim.worlds.layout import CELL

__all__ = ["draw_course"]

PATHS = 2  # centre lines per course; the areas between them are islands of walls
BEND = (2, 6)  # [cells] shortest and longest straight part of a centre line
STARTS_EVERY = 5  # [columns] distance between starts in training
MOST_TRIES = 1000  # number of attempts to draw a course
# Steps (rows, columns) of a centre line. None of them leads back towards the west.
_EAST = (0, 1)
_STEPS = ((1, 0), (1, 1), _EAST, (-1, 1), (-1, 0))


def draw_course(shape: tuple[int, int], rng: np.random.Generator, width: int = 3) -> Course:
    """Return a random course.

    Two centre lines lead from the same cell in the west to the goal in the east. Their straight parts have random
    directions and lengths. The free cells are those of the centre lines and, on wide paths, their four neighbours. On
    narrow paths, if a line goes on to a diagonal neighbour, one of the two cells beside this step is also free, so that
    the step cuts only one corner. Episodes start at the west end, and in training also along one of the centre lines.

    shape: number of cells (rows, columns)
    width: width of a path along x or y [cells]: 1 or 3

    Raises:
        ValueError: 1000 attempts give no course of this shape.
    """
    for _ in range(MOST_TRIES):
        row = int(rng.integers(2, shape[0] - 2))
        lines = [_center_line(row, shape, rng) for _ in range(PATHS)]
        try:
            return Course(_drawing(lines, shape, width))
        except ValueError:  # the distance from a start falls by more than MOST_FALL between the two lines
            continue
    raise ValueError(f"no course of {shape[0]} x {shape[1]} cells after {MOST_TRIES} attempts")


def _center_line(row: int, shape: tuple[int, int], rng: np.random.Generator) -> list[Cell]:
    """Return the cells of a centre line from the west end of a row to the column before the east border.

    A centre line is the middle of a path. The line hardly leads back towards its earlier cells (see `_hardly_falls`).
    """
    line, last = [(row, 1), (row, 2), (row, 3)], _EAST
    while line[-1][1] < shape[1] - 2:
        length = int(rng.integers(BEND[0], BEND[1] + 1))
        turns = [_STEPS[k] for k in rng.permutation(len(_STEPS)) if _STEPS[k] != last]
        for step in (*turns, _EAST):  # a line can always go on to the east
            part = _straight(line[-1], step, length, shape)
            if len(part) >= min(BEND[0], shape[1] - 2 - line[-1][1]) and _hardly_falls([*line, *part]):
                break
        line, last = [*line, *part], step
    return line


def _straight(cell: Cell, step: Cell, length: int, shape: tuple[int, int]) -> list[Cell]:
    """Return up to `length` cells that follow `cell` in the direction `step`.

    The cells are part of the centre line of a path. Cells in which it must not lie are left out: the two northernmost
    and the two southernmost rows, and the easternmost column.
    """
    cells = [(cell[0] + k * step[0], cell[1] + k * step[1]) for k in range(1, length + 1)]
    return [(r, c) for r, c in cells if 2 <= r < shape[0] - 2 and c < shape[1] - 1]


def _hardly_falls(line: list[Cell]) -> bool:
    """Return whether a line hardly leads back towards any of its earlier cells.

    An agent that follows the line from any one of its cells must never come back towards this cell by more than 1.5 m:
    its straight distance from the cell must stay within 1.5 m of the largest distance reached so far.
    """
    cells = np.array(line, float) * CELL
    apart = np.linalg.norm(cells[:, None] - cells[None], axis=-1)
    later = np.triu(apart)  # row: start, column: cell on the way
    return bool((np.maximum.accumulate(later, axis=1) - later)[np.triu_indices(len(line))].max() <= MOST_FALL)


def _drawing(lines: list[list[Cell]], shape: tuple[int, int], width: int) -> str:
    """Return the drawing of a course with these centre lines."""
    free = np.zeros(shape, bool)
    free[tuple(np.concatenate(lines).T)] = True
    if width > 1:
        free = scipy.ndimage.binary_dilation(free)
        free[[0, -1]], free[:, [0, -1]] = False, False
    else:
        for line in lines:
            for before, cell in pairwise(line):
                free[before[0], cell[1]] = True  # around the corner of a diagonal step
    signs = np.where(free, ".", "#")
    signs[:, 1][free[:, 1]] = "S"
    entered = {column: row for row, column in reversed(lines[0])}  # the first cell of the line in each column
    for column in range(STARTS_EVERY, shape[1] - 1 - GOAL_COLUMNS, STARTS_EVERY):
        signs[entered[column], column] = "s"
    return "\n".join("".join(row) for row in signs[::-1])
