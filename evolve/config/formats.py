"""Formats of a run's config.toml: which one is written, and how former ones are read.

1   no number in the file. The task "navigation" was a maze, and `learning.rays_per_eye` limited the rays in training.
2   "navigation" is a course, "maze" the maze, and `learning.rays_per_receptor` limits the rays.

Runs of both formats may lack `learning.least_epochs`: theirs did as many passes throughout. They may lack
`search.active`: their CMA-ES learnt from the worse candidates, too.

A run of a former format is opened, replayed and reported on as what it was. Its trainings cannot be carried on, because
their light was another.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from evolve.config.checks import ConfigError

__all__ = ["FORMAT", "LAST_OF_FORMER", "format_of", "task_then", "upgraded"]

FORMAT = 2
LAST_OF_FORMER = "f4d9978"  # the last commit that continues runs of format 1

Tree = dict[str, Any]


def format_of(tree: Mapping[str, Any]) -> int:
    """Of a run's config.toml.

    Raises:
        ConfigError: it is none that is known.
    """
    number = tree.get("format", 1)
    if type(number) is not int or not 1 <= number <= FORMAT:
        raise ConfigError(
            f"format = {number!r}: must be a whole number up to {FORMAT}, or a newer rhabdom reads it", "format"
        )
    return number


def upgraded(tree: Mapping[str, Any]) -> Tree:
    """A run's settings as this version names them."""
    number = format_of(tree)
    now = {key: value for key, value in tree.items() if key != "format"}
    if isinstance(learning := now.get("learning"), dict):
        now["learning"] = _learning_then(learning, number)
    if isinstance(search := now.get("search"), dict) and "optimizer" in search:
        now["search"] = {"active": True, **search}
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
    """Today's name of a task of format 1."""
    return "maze" if task == "navigation" else task
