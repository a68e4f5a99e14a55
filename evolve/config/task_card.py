"""Properties of a task that are known without executing its code. Checks, warnings, tables and titles use them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from evolve.config.task_code import LABEL
from evolve.genome.genes import TILT
from sim.worlds.catalog import TASKS

__all__ = [
    "CARDS",
    "LAYOUTS",
    "OF_COURSES",
    "OF_FAMILY",
    "OF_LAYOUTS",
    "OF_MAZES",
    "OF_SLIDING_AGENTS",
    "OF_USER_TASKS",
    "PATH_WIDTH",
    "TaskCard",
    "card_of",
    "tasks_with",
]

# Settings that only some tasks have. OF_SLIDING_AGENTS are for tasks whose agent has a speed, a turning rate and
# contact with walls.
OF_SLIDING_AGENTS = (
    *("world.least_light", "world.wall_height", "learning.first_speed", "learning.contact_ramp"),
    "learning.least_return",
)
OF_MAZES = ("world.mazes", "world.unseen")
OF_COURSES = ("world.course", "world.evaluation_course")
PATH_WIDTH = "world.path_width"  # setting of a family's courses
OF_FAMILY = (
    *("world.family_seed", "world.training_layouts", "world.selection_layouts", "world.test_layouts"),
    *("world.layout_rows", "world.layout_columns", "world.layout_actions", "world.selection_set"),
)
LAYOUTS = "world.layouts"
OF_LAYOUTS = (LAYOUTS, *OF_FAMILY)
OF_USER_TASKS = ("world.encoded_textures",)  # built-in worlds have no image files
OPTIONAL_GENES = (TILT,)  # genes that only some tasks have


@dataclass(frozen=True)
class TaskCard:
    """Properties of a task.

    name: name of the task in directories and tables
    title: name of the task in headings
    aim: purpose of the eyes and brains in this task, as the end of the sentence "Eyes and brains evolved ..."
    settings: settings that this task has and some other tasks do not have
    genes: genes that this task has and some other tasks do not have
    grey: True if all surfaces of its world reflect all wavelengths equally; None: unknown
    has_file: True if the task is a class in a user's file
    """

    name: str
    title: str
    aim: str
    settings: tuple[str, ...] = ()
    genes: tuple[str, ...] = ()
    grey: bool | None = None
    has_file: bool = False

    def has_gene(self, name: str) -> bool:
        """Return whether animals in this task can have this gene."""
        return name not in OPTIONAL_GENES or name in self.genes


def _built_in(name: str, *settings: str) -> TaskCard:
    known = (*OF_SLIDING_AGENTS, *settings)
    return TaskCard(name, name.capitalize(), f"to {TASKS[name]}", known, grey=name != "foraging")


CARDS = {
    card.name: card
    for card in (
        _built_in("navigation", *OF_COURSES, *OF_LAYOUTS, PATH_WIDTH),
        _built_in("detection"),
        _built_in("tracking"),
        _built_in("maze", *OF_MAZES, *OF_LAYOUTS),
        _built_in("foraging"),
    )
}


def card_of(task: Any) -> TaskCard | None:
    """Return the card of a built-in task or of a user task "FILE.py:CLASS"; None if `task` is neither."""
    if not isinstance(task, str):
        return None
    if LABEL.fullmatch(task) is not None:
        name = task.rpartition(":")[2]
        return TaskCard(name, name, f"for {task}, a user task", OF_USER_TASKS, (TILT,), has_file=True)
    return CARDS.get(task)


def tasks_with(setting: str) -> list[str]:
    """Return the names of the built-in tasks that have this setting."""
    return [name for name, card in CARDS.items() if setting in card.settings]
