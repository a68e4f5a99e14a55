"""Checks of the settings of layouts. The layouts of a run are either all fixed or all random."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from evolve.config.checks import ConfigError
from evolve.config.settings import FAMILY, WorldConfig
from evolve.config.task_card import OF_COURSES, OF_FAMILY, OF_MAZES, PATH_WIDTH
from sim.worlds.catalog import COURSES

__all__ = ["check_layouts"]

CHOICES: Mapping[str, tuple[str, ...]] = {
    "course": COURSES,
    "evaluation_course": COURSES,
    "layouts": ("fixed", FAMILY),
    "selection_set": ("selection", "training"),
}


def check_layouts(world: WorldConfig) -> None:
    """Check the settings of layouts, the arrangements of walls in courses and mazes.

    The setting `world.layouts` determines whether layouts are fixed or random. Some settings affect only fixed layouts,
    and others only random ones. Settings without effect must have their defaults. A setting with a list of possible
    values, such as `world.course`, must have one of them. The numbers of rows and columns and the width of paths must
    be odd.

    Raises:
        ConfigError: one of these conditions is not met.
    """
    for name, known in CHOICES.items():
        if (word := getattr(world, name)) not in known:
            raise ConfigError(f"world.{name} = {word!r}: must be one of {', '.join(known)}", f"world.{name}")
    is_family = world.layouts == FAMILY
    for key in (*OF_MAZES, *OF_COURSES) if is_family else (*OF_FAMILY, PATH_WIDTH):
        if (value := _value(world, key)) != _value(WorldConfig, key):
            said = str(value).lower() if isinstance(value, bool) else value
            raise ConfigError(
                f"{key} = {said}: has no effect with world.layouts = {world.layouts}", key, "world.layouts"
            )
    for key in ("world.layout_rows", "world.layout_columns", PATH_WIDTH):
        if (cells := _value(world, key)) % 2 == 0:
            raise ConfigError(f"{key} = {cells}: must be odd, such as {cells - 1}", key)


def _value(world: Any, key: str) -> Any:
    return getattr(world, key.removeprefix("world."))
