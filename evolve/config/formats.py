"""Formats of a run's config.toml, and conversion of former formats.

1   Files of this format do not state a format number. The task "navigation" is a maze, and `learning.rays_per_eye`
    limits the number of rays in training.
2   This is the current format. The task "navigation" is a course, the task "maze" is a maze, and
    `learning.rays_per_receptor` limits the number of rays in training.

In files of both formats, some settings may be missing. Without `learning.least_epochs`, the number of passes per update
is constant. Without `search.active`, CMA-ES also learns from the worse candidates. Without `world.encoded_textures`,
the textures of user tasks are as MuJoCo's compiler resolves them.

A run of a former format can be opened, replayed and reported; its settings keep their original meaning. Its training
runs cannot be continued, because light is computed differently.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from evolve.config.checks import ConfigError
from evolve.config.task_code import names_code

__all__ = ["FORMAT", "LAST_OF_FORMER", "format_of", "task_then", "upgraded"]

FORMAT = 2
LAST_OF_FORMER = "f4d9978"  # last commit that can continue runs of format 1

Tree = dict[str, Any]


def format_of(tree: Mapping[str, Any]) -> int:
    """Return the format of a run's config.toml.

    Raises:
        ConfigError: the format is unknown.
    """
    number = tree.get("format", 1)
    if type(number) is not int or not 1 <= number <= FORMAT:
        raise ConfigError(
            f"format = {number!r}: must be a whole number up to {FORMAT}; a newer rhabdom may read this file", "format"
        )
    return number


def upgraded(tree: Mapping[str, Any]) -> Tree:
    """Return the settings of a run after converting them from the run's format to the current one."""
    number = format_of(tree)
    now = {key: value for key, value in tree.items() if key != "format"}
    if isinstance(learning := now.get("learning"), dict):
        now["learning"] = _learning_then(learning, number)
    if isinstance(search := now.get("search"), dict) and "optimizer" in search:
        now["search"] = {"active": True, **search}
    if isinstance(world := now.get("world"), dict) and names_code(now.get("task")):
        now["world"] = {"encoded_textures": False, **world}
    if number == 1 and "task" in now:
        now["task"] = task_then(now["task"])
    return now


def _learning_then(learning: Tree, number: int) -> Tree:
    gone = ("rays_per_eye",) if number == 1 else ()
    then = {key: value for key, value in learning.items() if key not in gone}
    if "n_epochs" in then:
        then.setdefault("least_epochs", then["n_epochs"])
    return then


def task_then(task: Any) -> Any:
    """Return the current name of the task that a file of format 1 names."""
    return "maze" if task == "navigation" else task
