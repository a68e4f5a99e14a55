"""The maze: random corridors between striped walls, from a start in the west to a goal in the east."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from sim.worlds.layout import CELL, Layout, Starts, add_floor, cell_centers
from sim.worlds.striped_walls import add_striped_walls

# Number of cells (rows, columns). Both are odd: cells with two odd coordinates are rooms, and a cell between two
# adjacent rooms is either a wall or an opening.
MAZE = (13, 39)
START_COLUMNS = 4  # the agent starts in the free cells west of this column
GOAL_COLUMNS = 3  # the goal consists of the free cells in the last columns before the outer wall

_NEIGHBORS = ((0, 2), (0, -2), (2, 0), (-2, 0))


def add_layout(spec: mujoco.MjSpec, mazes: Sequence[np.ndarray], rngs: Sequence[np.random.Generator]) -> Layout:
    """Add mazes of equal size, which lie next to each other from south to north and are not connected.

    Each episode starts in one of the mazes, so that an agent learns a behaviour that works in all of them.

    mazes: walls of each maze, boolean (row, column)
    rngs: random number generators that draw the stripes on the walls: one for all mazes, or one for each maze
    """
    walls = np.concatenate(mazes)
    shape = walls.shape
    add_floor(spec, (shape[1] * CELL, shape[0] * CELL))
    add_striped_walls(spec, walls, rngs)
    rows, columns = np.nonzero(~walls)
    start = columns < START_COLUMNS
    right = shape[1] * CELL / 2 - CELL
    return Layout(
        objects=(),
        starts=Starts(cell_centers(columns[start], rows[start], shape)),
        object_spawn=np.empty((0, 2)),
        goal_region=np.array(
            [right - GOAL_COLUMNS * CELL, CELL - shape[0] * CELL / 2, right, shape[0] * CELL / 2 - CELL]
        ),
    )


def draw_maze(shape: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    """Return the walls of a maze without dead ends, boolean (row, column).

    A depth-first walk connects all rooms, which are the cells with odd row and column, into a tree. Every dead end then
    gets a second opening, so that an agent in a corridor never has to turn back.

    shape: number of cells (rows, columns), both odd
    """
    walls = np.ones(shape, dtype=bool)
    walls[1, 1] = False
    path = [(1, 1)]
    while path:
        room = path[-1]
        closed = [n for n in _rooms_next_to(room, shape) if walls[n]]
        if not closed:
            path.pop()
            continue
        room_next = closed[rng.integers(len(closed))]
        walls[_between(room, room_next)] = walls[room_next] = False
        path.append(room_next)
    for row in range(1, shape[0], 2):
        for column in range(1, shape[1], 2):
            _open_dead_end(walls, (row, column), rng)
    return walls


def _open_dead_end(walls: np.ndarray, room: tuple[int, int], rng: np.random.Generator) -> None:
    shape = (walls.shape[0], walls.shape[1])
    shut = [d for n in _rooms_next_to(room, shape) if walls[d := _between(room, n)]]
    doors = len(_rooms_next_to(room, shape)) - len(shut)
    if doors < 2:
        walls[shut[rng.integers(len(shut))]] = False


def _rooms_next_to(room: tuple[int, int], shape: tuple[int, int]) -> list[tuple[int, int]]:
    near = [(room[0] + dr, room[1] + dc) for dr, dc in _NEIGHBORS]
    return [(r, c) for r, c in near if 0 < r < shape[0] - 1 and 0 < c < shape[1] - 1]


def _between(a: tuple[int, int], b: tuple[int, int]) -> tuple[int, int]:
    return (a[0] + b[0]) // 2, (a[1] + b[1]) // 2
