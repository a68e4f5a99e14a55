"""Formats of a run's config.toml, and conversion of older formats.

1   Files of this format do not state a format number. The task "navigation" is a maze, and `learning.rays_per_eye`
    limits the number of rays in training.
2   The task "navigation" is a course, the task "maze" is a maze, and `learning.rays_per_receptor` limits the number of
    rays in training. Pupils are rotated by 180° relative to the axes that the Optical Society of America (OSA) has
    standardised. If such a run is continued, its pupils remain rotated (`eye.pupil_turned`).
3   This is the current format. Pupils have the axes of the OSA.

In files of formats 1 and 2, some settings may be missing. Without `learning.least_epochs`, the number of passes per
update is constant. Without `search.active`, CMA-ES also learns from the worse candidates. Without
`world.encoded_textures`, MuJoCo's compiler decides which textures of user tasks contain linear light.

Runs of older formats can be opened, replayed and reported; their settings keep the original meaning. Runs of format 1
cannot be continued, because light is now computed differently.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from evolve.config.checks import ConfigError
from evolve.config.task_code import names_code

__all__ = ["FORMAT", "LAST_OF_FORMER", "OLDEST_CONTINUED", "format_of", "in_own_axes", "task_then", "upgraded"]

FORMAT = 3
OLDEST_CONTINUED = 2
LAST_OF_FORMER = "f4d9978"  # last commit that can continue runs of format 1

Tree = dict[str, Any]


def format_of(tree: Mapping[str, Any]) -> int:
    """Return the format of a run's config.toml, whose content is `tree`; 1 if it states none.

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
    """Return the settings of a run, converted from their format to the current one.

    Raises:
        ConfigError: the format is unknown.
    """
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
    return in_own_axes(now, number)


def in_own_axes(tree: Mapping[str, Any], number: int) -> Tree:
    """Return the settings of a run, extended such that pupils keep the axes that they had when the run was written.

    In files of formats 1 and 2, pupils are rotated by 180° relative to the current format. Settings from such a file
    get `eye.pupil_turned` = True, unless they contain this setting.

    tree: settings of the run
    number: number of the format of the file with these settings
    """
    eye = tree.get("eye", {})
    if number > 2 or not isinstance(eye, dict):
        return dict(tree)
    return {**tree, "eye": {"pupil_turned": True, **eye}}


def _learning_then(learning: Tree, number: int) -> Tree:
    gone = ("rays_per_eye",) if number == 1 else ()
    then = {key: value for key, value in learning.items() if key not in gone}
    if "n_epochs" in then:
        then.setdefault("least_epochs", then["n_epochs"])
    return then


def task_then(task: Any) -> Any:
    """Return the name that a task from a file of format 1 has now.

    The task that was called "navigation" is now called "maze". All other names are unchanged.
    """
    return "maze" if task == "navigation" else task
