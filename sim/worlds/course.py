"""A course: a way through a grid of cells on which an agent that keeps getting farther from its start arrives.

Navigation rewards distance from the start. Where the way falls back towards the start, that reward has a local optimum,
and nobody ever leaves it (docs/concepts/physics.md). On a course it nowhere falls back by more than MOST_FALL.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.numerics.arguments import of_kind, whole
from sim.worlds.layout import CELL, cell_centers

Cell = tuple[int, int]  # row, column

MOST_FALL = 1.5  # [m] by which the distance from the start may have to fall on the way on, wherever an agent has got to
GOAL_COLUMNS = 3  # the free cells of the last columns but the outer wall are the goal
LOOK_AHEAD = 3  # cells on the shortest way: where they lead is the way's direction
MOST_STEPS = 10**9  # of an episode
_WALL, _FREE, _START, _TRAINING_START = "#.Ss"


@dataclass(frozen=True)
class Course:
    """Walls, and where to start from, as a drawing: a line per row of cells, north on top.

    drawing: "#" a wall, "." free, "S" free and a start, "s" a start in training only
    episode_steps: actions, then an episode is truncated; None: as many as everywhere

    Raises:
        ValueError: lines of different lengths, another sign, an open border, no start, a start in the goal or from
            which there is no way to it, one on whose way the distance from it falls by more than MOST_FALL, or
            episode_steps that are not a whole number above 0.
    """

    drawing: str
    episode_steps: int | None = None

    def __post_init__(self) -> None:
        of_kind("course: drawing", self.drawing, str, "'######\\n#S...#\\n######'")
        lines = self.drawing.split()
        if len({len(line) for line in lines}) != 1 or (signs := set(self.drawing) - set("#.Ss \n")):
            what = "all lines must be as long" if len({len(line) for line in lines}) != 1 else f"signs {sorted(signs)}"
            raise ValueError(f"course: {what}; must be lines of '#', '.', 'S' and 's'")
        border = np.ones(self.walls.shape, bool)
        border[1:-1, 1:-1] = False
        if not self.walls[border].all():
            row, column = np.argwhere(border & ~self.walls)[0]
            raise ValueError(f"course: cell ({row}, {column}) of its border is free: must be a wall")
        if not self.starts:
            raise ValueError("course: no start: must have an 'S'")
        if self.episode_steps is not None:
            steps = whole("course: episode_steps", self.episode_steps, 1, MOST_STEPS)
            object.__setattr__(self, "episode_steps", steps)
        for start in self.training_starts:
            self._check(start)

    def _check(self, start: Cell) -> None:
        if self.goal[start]:
            raise ValueError(
                f"course: start in cell {start} is in the goal, the free cells of the last {GOAL_COLUMNS} columns but "
                "the outer wall: must be west of it"
            )
        if not np.isfinite(self.way[start]):
            raise ValueError(f"course: start in cell {start} has no way to the goal")
        fall, at = self.fall(start)
        if fall > MOST_FALL:
            raise ValueError(
                f"course: from cell {at} on, the distance from the start in cell {start} has to fall by {fall:.2g} m: "
                f"must be at most {MOST_FALL:g} m"
            )

    @cached_property
    def signs(self) -> np.ndarray:
        """The drawing's, (row, column), row 0 in the south."""
        return np.array([list(line) for line in reversed(self.drawing.split())])

    @cached_property
    def walls(self) -> np.ndarray:
        """Boolean (row, column)."""
        walls: np.ndarray = self.signs == _WALL
        return walls

    @property
    def starts(self) -> list[Cell]:
        """Where episodes begin in evaluation."""
        return _cells(self.signs == _START)

    @property
    def training_starts(self) -> list[Cell]:
        """Where episodes begin in training."""
        return _cells(np.isin(self.signs, (_START, _TRAINING_START)))

    @cached_property
    def goal(self) -> np.ndarray:
        """Cells of the goal, boolean (row, column)."""
        goal = ~self.walls
        goal[:, : -1 - GOAL_COLUMNS] = False
        return goal

    @cached_property
    def way(self) -> np.ndarray:
        """Length of the shortest way to the goal from every cell [m], (row, column); infinite where there is none."""
        way = np.where(self.goal, 0.0, np.inf)
        queue = [(0.0, cell) for cell in _cells(self.goal)]
        while queue:
            length, cell = heapq.heappop(queue)
            for other in self._next_to(cell):
                longer = length + _apart(cell, other)
                if longer < way[other] - 1e-9:
                    way[other] = longer
                    heapq.heappush(queue, (longer, other))
        return way

    def heading(self, cell: Cell) -> float:
        """Direction of the shortest way from a cell [rad]."""
        ahead = cell
        for _ in range(LOOK_AHEAD):
            ahead = min([ahead, *self._next_to(ahead)], key=lambda other: float(self.way[other]))
        return float(np.arctan2(ahead[0] - cell[0], ahead[1] - cell[1]))

    def fall(self, start: Cell) -> tuple[float, Cell]:
        """The most by which the distance from a start has to fall between some cell ahead of it and the goal [m], on
        the easiest way there; and that cell."""
        ease = self._ease(start)
        return max((_apart(start, cell) - float(ease[cell]), cell) for cell in self._ahead(start))

    def _ease(self, start: Cell) -> np.ndarray:
        """Of the ways from a cell to the goal, the one whose least distance from the start is largest: that distance
        [m], (row, column)."""
        ease = np.full(self.walls.shape, -1.0)
        queue = [(-_apart(start, cell), cell) for cell in _cells(self.goal)]
        for negative, cell in queue:
            ease[cell] = -negative
        heapq.heapify(queue)
        while queue:
            negative, cell = heapq.heappop(queue)
            for other in self._next_to(cell):
                least = min(-negative, _apart(start, other))
                if least > ease[other]:
                    ease[other] = least
                    heapq.heappush(queue, (-least, other))
        return ease

    def _ahead(self, start: Cell) -> set[Cell]:
        """Cells to which ways lead from the start that come nearer to the goal with every cell."""
        seen, waiting = {start}, [start]
        while waiting:
            cell = waiting.pop()
            for other in self._next_to(cell):
                if self.way[other] < self.way[cell] and other not in seen:
                    seen.add(other)
                    waiting.append(other)
        return seen

    def _next_to(self, cell: Cell) -> Iterator[Cell]:
        """Free cells that an agent can enter next, also diagonally, but not past a wall's corner."""
        row, column = cell
        for r in (row - 1, row, row + 1):
            for c in (column - 1, column, column + 1):
                if (r, c) != cell and not (self.walls[r, c] or self.walls[row, c] or self.walls[r, column]):
                    yield r, c

    def places(self, cells: list[Cell]) -> np.ndarray:
        """Centres of cells [m], (n, 2)."""
        rows, columns = np.array(cells).T
        return cell_centers(columns, rows, (self.walls.shape[0], self.walls.shape[1]))


def _cells(chosen: np.ndarray) -> list[Cell]:
    return [(int(row), int(column)) for row, column in np.argwhere(chosen)]


def _apart(a: Cell, b: Cell) -> float:
    return float(CELL * np.hypot(a[0] - b[0], a[1] - b[1]))
