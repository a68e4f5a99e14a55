"""Environments that Gymnasium creates from an id. Gymnasium's `max_episode_steps` sets the length of their episodes.

`gymnasium.make` passes this length only to its wrapper `TimeLimit`. The wrapper can end an episode earlier than the
wrapped environment does, but not later. The wrapped environment therefore sets no limit to the number of actions in an
episode. The only exception is a limit `episode_steps` that belongs to the world: a course (`sim.Course`, a drawing of
walls and starting positions) or a family of random layouts (`sim.LayoutFamily`) can have such a limit.
"""

from __future__ import annotations

from typing import Any

from optics.numerics.arguments import whole
from sim.envs.env import EyesEnv
from sim.envs.vector_env import EyesVectorEnv
from sim.tasks.task import Task
from sim.tasks.task_settings import MOST_STEPS
from sim.worlds.course import Course
from sim.worlds.layout_family import LayoutSet
from sim.worlds.navigation import course_named

ENDLESS = -1  # Gymnasium's value for episodes without truncation


class RegisteredEnv(EyesEnv):
    """An `EyesEnv` whose episodes are truncated by Gymnasium's wrapper `TimeLimit`.

    Raises:
        ValueError: an argument is invalid, or `episode_steps` was given instead of Gymnasium's `max_episode_steps`.
            All other errors of `EyesEnv` can occur as well.
    """

    def __init__(self, task: str | Task | type[Task], *args: Any, **options: Any) -> None:
        super().__init__(_begun(task), *args, **options, episode_steps=_steps(ENDLESS, options))


class RegisteredVectorEnv(EyesVectorEnv):
    """An `EyesVectorEnv` that truncates its episodes after `max_episode_steps` actions.

    Episodes are truncated earlier if the world itself has a smaller limit. This limit is the attribute `episode_steps`
    of a `sim.Course` (a drawing of walls and starting positions) or of a `sim.LayoutFamily` (random layouts).

    Raises:
        ValueError: an argument is invalid, or `episode_steps` was given instead of Gymnasium's `max_episode_steps`.
            All other errors of `EyesVectorEnv` can occur as well.
    """

    def __init__(
        self, num_envs: int = 1, *, task: str | Task | type[Task], max_episode_steps: int = ENDLESS, **options: Any
    ) -> None:
        super().__init__(num_envs, task=_begun(task), **options, episode_steps=_steps(max_episode_steps, options))


def _begun(task: str | Task | type[Task]) -> str | Task:
    return task() if isinstance(task, type) else task


def _steps(asked: int, options: dict[str, Any]) -> int:
    """Return the number of actions after which an episode is truncated.

    It is the requested number `asked`, or none if `asked` is -1. The options may contain a course (a drawing of walls)
    or a family of random layouts. If the course or the family has a limit `episode_steps`, the result does not exceed
    this limit.

    Raises:
        ValueError: `options` contains `episode_steps`, the number is out of range, or the course is unknown.
    """
    if "episode_steps" in options:
        raise ValueError(
            f"episode_steps = {options['episode_steps']!r}: must be left out if Gymnasium makes the environment; "
            "its name there is max_episode_steps"
        )
    course: str | Course | None = options.get("course")
    own = None if course is None else course_named(course).episode_steps
    if isinstance(layouts := options.get("layouts"), LayoutSet):
        own = layouts.family.episode_steps
    steps = MOST_STEPS if asked == ENDLESS else whole("max_episode_steps", asked, 1, MOST_STEPS)
    return min(steps, own or MOST_STEPS)
