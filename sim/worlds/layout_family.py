"""Families of random layouts for the tasks navigation and maze, in three sets that have no layout in common.

An animal that is trained and judged in the same layouts may memorise them. A family therefore has a set for training, a
set for the selection of animals and policies, and a set for final results ("test"). A layout depends only on the
family's seed, on the layout's size and path width, on the name of its set and on its index in the set. A larger set
thus begins with the layouts of a smaller one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np

from optics.numerics.arguments import of_kind, one_of, whole
from optics.numerics.read_only import read_only
from sim.worlds.course import MOST_STEPS, Course
from sim.worlds.maze import draw_maze
from sim.worlds.random_course import draw_course

__all__ = ["MOST_LAYOUTS", "SETS", "TASKS_WITH_LAYOUTS", "LayoutFamily", "LayoutSet"]

SETS = ("training", "selection", "test")
MOST_LAYOUTS = 100  # largest allowed number of layouts in a set
ROWS, COLUMNS = (7, 31), (15, 99)  # smallest and largest allowed number of cells
PATH_WIDTHS = (1, 3)
_MOST_SEED = 2**128
_WALLS, _STRIPES = 0, 1  # purposes of a layout's random numbers


@dataclass(frozen=True)
class LayoutFamily:
    """Random courses or mazes in three disjoint sets, for `sim.build_world` and `sim.make_vec_env`.

    Courses fulfil the conditions of `sim.Course`: on the way to the goal, an agent never has to come back towards its
    start by more than 1.5 m.

    seed: seed of all layouts and of the stripes on their walls, 0 to 2¹²⁸
    n_training, n_selection, n_test: number of layouts in each set, 1 to 100
    rows, columns: number of cells of a layout along y (7 to 31) and x (15 to 99), including the outer wall. Both are
        odd, because mazes have rooms in every second row and column. A cell is 2 m wide.
    path_width: width of the paths of courses [cells], 1 or 3; corridors of mazes are always one cell wide
    episode_steps: number of actions after which an episode is truncated, 1 to 10⁹; None: the task's default

    Raises:
        ValueError: a value is not a whole number in its range, or `rows`, `columns` or `path_width` is even.
    """

    seed: int = 0
    n_training: int = 8
    n_selection: int = 8
    n_test: int = 8
    rows: int = 13
    columns: int = 39
    path_width: int = 3
    episode_steps: int | None = None

    def __post_init__(self) -> None:
        limits = {"seed": (0, _MOST_SEED), "rows": ROWS, "columns": COLUMNS, "path_width": PATH_WIDTHS}
        limits |= {f"n_{name}": (1, MOST_LAYOUTS) for name in SETS}
        if self.episode_steps is not None:
            limits["episode_steps"] = (1, MOST_STEPS)
        for name, (low, high) in limits.items():
            number = whole(f"LayoutFamily: {name}", getattr(self, name), low, high)
            object.__setattr__(self, name, number)
            if name in ("rows", "columns", "path_width") and number % 2 == 0:
                raise ValueError(f"LayoutFamily: {name} = {number}: must be odd, such as {number - 1}")

    @property
    def training(self) -> LayoutSet:
        """Layouts for training."""
        return LayoutSet(self, "training")

    @property
    def selection(self) -> LayoutSet:
        """Layouts in which policies and animals are compared and selected."""
        return LayoutSet(self, "selection")

    @property
    def test(self) -> LayoutSet:
        """Layouts for final results only. These layouts must not be used to select policies or animals."""
        return LayoutSet(self, "test")

    def number(self, name: str) -> int:
        """Return the number of layouts in the set of this name, "training", "selection" or "test".

        Raises:
            ValueError: there is no such set.
        """
        return int(getattr(self, f"n_{one_of('name', name, SETS)}"))

    def random(self, name: str, index: int, purpose: int) -> np.random.Generator:
        """Return the random number generator of one layout, for its walls (purpose 0) or its stripes (purpose 1).

        name: name of the layout's set, "training", "selection" or "test"
        index: index of the layout in the set

        Raises:
            ValueError: there is no such set, `index` is not a whole number from 0 to 99, or `purpose` is neither 0 nor
                1.
        """
        place = SETS.index(one_of("name", name, SETS))
        index, purpose = whole("index", index, 0, MOST_LAYOUTS - 1), whole("purpose", purpose, _WALLS, _STRIPES)
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(place, index, purpose)))


@dataclass(frozen=True)
class LayoutSet:
    """One of the three sets of layouts in a `sim.LayoutFamily`, for `sim.build_world` and `sim.make_vec_env`.

    family: the family of layouts that contains the set
    name: name of the set: "training", "selection" or "test"

    Raises:
        ValueError: the family is no LayoutFamily, or there is no such set.
    """

    family: LayoutFamily
    name: str

    def __post_init__(self) -> None:
        of_kind("LayoutSet: family", self.family, LayoutFamily, "sim.LayoutFamily(seed=0)")
        one_of("LayoutSet: name", self.name, SETS)

    def __len__(self) -> int:
        """Return the number of layouts."""
        return self.family.number(self.name)

    @property
    def mazes(self) -> tuple[np.ndarray, ...]:
        """Walls of the mazes in this set, boolean (row, column) each.

        Raises:
            ValueError: two mazes in the training, selection and test sets of the family are equal.
        """
        return _drawn(self.family, "maze")[self.name]

    @property
    def courses(self) -> tuple[Course, ...]:
        """The courses of this set.

        Raises:
            ValueError: two courses in the training, selection and test sets of the family are equal, or no course with
                the family's numbers of rows and columns was found.
        """
        return _drawn(self.family, "navigation")[self.name]

    def stripes(self) -> list[np.random.Generator]:
        """Return one new random number generator for each layout, for the stripes on the layout's walls."""
        return [self.family.random(self.name, index, _STRIPES) for index in range(len(self))]


def _course(family: LayoutFamily, rng: np.random.Generator) -> Course:
    return draw_course((family.rows, family.columns), rng, family.path_width)


def _maze(family: LayoutFamily, rng: np.random.Generator) -> np.ndarray:
    return read_only(draw_maze((family.rows, family.columns), rng))


_DRAW: Mapping[str, Callable[..., Any]] = MappingProxyType({"navigation": _course, "maze": _maze})
TASKS_WITH_LAYOUTS = tuple(_DRAW)


@lru_cache(maxsize=8)
def _drawn(family: LayoutFamily, task: str) -> Mapping[str, tuple[Any, ...]]:
    """Return the mazes or courses of a family, by the name of the set ("training", "selection" or "test").

    Raises:
        ValueError: two layouts have the same walls, or no course with the family's numbers of rows and columns was
            found.
    """
    draw = _DRAW[task]
    found: dict[str, tuple[Any, ...]] = {}
    known: dict[bytes, str] = {}
    for name in SETS:
        layouts = tuple(draw(family, family.random(name, i, _WALLS)) for i in range(family.number(name)))
        for index, layout in enumerate(layouts):
            walls = layout.walls if isinstance(layout, Course) else layout
            first, here = known.setdefault(walls.tobytes(), f"{name} {index}"), f"{name} {index}"
            if first != here:
                raise ValueError(
                    f"LayoutFamily: layouts {first} and {here} have the same walls: must differ; use another seed, "
                    "larger layouts or fewer of them"
                )
        found[name] = layouts
    return MappingProxyType(found)
