"""Courses: paths between walls, on which an agent never has to come back towards its start by more than 1.5 m.

Navigation rewards an increase of the distance from the start. If the path leads back towards the start, this reward
has a local optimum that no agent ever leaves (docs/concepts/physics.md). In a course, an agent that approaches the goal
can therefore always go on to the goal without coming more than 1.5 m (MOST_FALL) closer to the start than it is. These
distances are measured in a straight line.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.numerics.arguments import of_kind, whole
from optics.numerics.read_only import read_only
from sim.worlds.layout import CELL, cell_centers

Cell = tuple[int, int]  # row, column

# [m] largest allowed decrease of the distance from the start, on the way from any reachable position to the goal
MOST_FALL = 1.5
GOAL_COLUMNS = 3  # the goal consists of the free cells in the last columns before the outer wall
LOOK_AHEAD = 3  # number of cells of the shortest path from which its direction is computed
MOST_STEPS = 10**9  # largest allowed number of actions in an episode
_WALL, _FREE, _START, _TRAINING_START = "#.Ss"


@dataclass(frozen=True)
class Course:
    """Walls and starting positions, given as a drawing. Each line is a row of cells of 2 m, with north at the top.

    drawing: "#": wall; ".": free cell; "S": free cell in which episodes may start; "s": free cell in which episodes may
        start in training only. The free cells in the last three columns before the outer wall are the goal
    episode_steps: number of actions after which an episode is truncated, 1 to 10⁹; None: the task's default

    Attributes and methods count the rows of cells from the south.

    Raises:
        ValueError: the lines differ in length, contain another character or have a free cell in the border; there is no
            "S"; a start lies in the goal or has no suitable path to it; or an argument has a wrong type or range. On a
            suitable path, an agent never has to come back towards its start by more than 1.5 m (in a straight line).
    """

    drawing: str
    episode_steps: int | None = None

    def __post_init__(self) -> None:
        of_kind("course: drawing", self.drawing, str, "'######\\n#S...#\\n######'")
        lines = self.drawing.split()
        if len({len(line) for line in lines}) != 1 or (signs := set(self.drawing) - set("#.Ss \n")):
            what = "lines differ in length" if len({len(line) for line in lines}) != 1 else f"signs {sorted(signs)}"
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
                f"course: start in cell {start} is in the goal, the free cells of the last {GOAL_COLUMNS} columns "
                "before the outer wall: must be west of it"
            )
        if not np.isfinite(self.way[start]):
            raise ValueError(f"course: start in cell {start} has no path to the goal")
        fall, at = self.fall(start)
        if fall > MOST_FALL:
            raise ValueError(
                f"course: after cell {at}, the distance from the start in cell {start} has to fall by {fall:.2g} m: "
                f"must be at most {MOST_FALL:g} m"
            )

    @cached_property
    def signs(self) -> np.ndarray:
        """Characters of `drawing`, (row, column). Row 0 is in the south, which is the last line of the drawing."""
        return read_only(np.array([list(line) for line in reversed(self.drawing.split())]))

    @cached_property
    def walls(self) -> np.ndarray:
        """Cells that are walls, boolean (row, column)."""
        return read_only(self.signs == _WALL)

    @property
    def starts(self) -> list[Cell]:
        """Cells (row, column) in which evaluation episodes may start."""
        return _cells(self.signs == _START)

    @property
    def training_starts(self) -> list[Cell]:
        """Cells (row, column) in which training episodes may start."""
        return _cells(np.isin(self.signs, (_START, _TRAINING_START)))

    @cached_property
    def goal(self) -> np.ndarray:
        """True for cells of the course that belong to the goal, boolean (row, column)."""
        goal = ~self.walls
        goal[:, : -1 - GOAL_COLUMNS] = False
        return read_only(goal)

    @cached_property
    def way(self) -> np.ndarray:
        """Length of the shortest path from every cell to the goal [m], (row, column); infinite without a path."""
        way = np.where(self.goal, 0.0, np.inf)
        queue = [(0.0, cell) for cell in _cells(self.goal)]
        while queue:
            length, cell = heapq.heappop(queue)
            for other in self._next_to(cell):
                longer = length + _apart(cell, other)
                if longer < way[other] - 1e-9:
                    way[other] = longer
                    heapq.heappush(queue, (longer, other))
        return read_only(way)

    def heading(self, cell: Cell) -> float:
        """Return the direction of the shortest path from a cell to the goal [rad], counterclockwise from east.

        It points to the cell that is 3 steps (LOOK_AHEAD) further along the path, or to the first cell of the goal. In
        the goal, the direction is 0.
        """
        ahead = cell
        for _ in range(LOOK_AHEAD):
            ahead = min([ahead, *self._next_to(ahead)], key=lambda other: float(self.way[other]))
        return float(np.arctan2(ahead[0] - cell[0], ahead[1] - cell[1]))

    def fall(self, start: Cell) -> tuple[float, Cell]:
        """Return how far an agent must come back towards a start on the way to the goal [m], and after which cell.

        The method considers all cells that an agent can reach if each of its steps, from the start on, brings it closer
        to the goal along the shortest path (`way`). From each of these cells, the agent takes the path to the goal that
        stays as far away from the start as possible. The agent comes back by the distance between start and cell, minus
        the smallest distance between the start and this path. The result is the largest of these differences, and the
        cell for which it was computed.
        """
        ease = self._ease(start)
        return max((_apart(start, cell) - float(ease[cell]), cell) for cell in self._ahead(start))

    def _apart_from(self, start: Cell) -> np.ndarray:
        """Return an array (row, column) of the distances of all cells from a start [m]."""
        rows, columns = np.indices(self.walls.shape)
        return np.asarray(CELL * np.hypot(rows - start[0], columns - start[1]))

    def _ease(self, start: Cell) -> np.ndarray:
        """Return how close to the start an agent must come on the way from each cell to the goal [m], (row, column).

        The agent takes the path that stays as far away from the start as possible. The result is the smallest distance
        between this path and the start; -1 if there is no path to the goal.
        """
        ease, apart = np.full(self.walls.shape, -1.0), self._apart_from(start)
        queue = [(-float(apart[cell]), cell) for cell in _cells(self.goal)]
        for negative, cell in queue:
            ease[cell] = -negative
        heapq.heapify(queue)
        while queue:
            negative, cell = heapq.heappop(queue)
            for other in self._next_to(cell):
                least = min(-negative, float(apart[other]))
                if least > ease[other]:
                    ease[other] = least
                    heapq.heappush(queue, (-least, other))
        return ease

    def _ahead(self, start: Cell) -> set[Cell]:
        """Return all cells that an agent can reach from the start if each step brings it closer to the goal.

        Closeness is the length of the shortest path to the goal (`way`).
        """
        seen, waiting = {start}, [start]
        while waiting:
            cell = waiting.pop()
            for other in self._next_to(cell):
                if self.way[other] < self.way[cell] and other not in seen:
                    seen.add(other)
                    waiting.append(other)
        return seen

    def _next_to(self, cell: Cell) -> tuple[Cell, ...]:
        """Return the free cells that an agent can enter next. A diagonal step must not cut the corner of a wall."""
        if cell not in self._neighbors:
            row, column = cell
            self._neighbors[cell] = tuple(
                (r, c)
                for r in (row - 1, row, row + 1)
                for c in (column - 1, column, column + 1)
                if (r, c) != cell and not (self.walls[r, c] or self.walls[row, c] or self.walls[r, column])
            )
        return self._neighbors[cell]

    @cached_property
    def _neighbors(self) -> dict[Cell, tuple[Cell, ...]]:
        """Cache of the method `_next_to`: for each cell, the free cells that an agent can enter next."""
        return {}

    def places(self, cells: list[Cell]) -> np.ndarray:
        """Return the centres (x, y) of one or more cells [m], (n, 2). The origin is the centre of the course."""
        rows, columns = np.array(cells).T
        return cell_centers(columns, rows, (self.walls.shape[0], self.walls.shape[1]))


def _cells(chosen: np.ndarray) -> list[Cell]:
    return [(int(row), int(column)) for row, column in np.argwhere(chosen)]


def _apart(a: Cell, b: Cell) -> float:
    return float(CELL * np.hypot(a[0] - b[0], a[1] - b[1]))
