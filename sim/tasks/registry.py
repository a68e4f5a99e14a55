"""Built-in tasks by name."""

from __future__ import annotations

from typing import Any

from sim.tasks.built_in import AgentTask
from sim.tasks.find_goal import FindGoal
from sim.tasks.find_way import FindWay
from sim.worlds.catalog import TASKS
from sim.worlds.world import World

__all__ = ["task_of"]


def task_of(world: World, mode: str = "training", **settings: Any) -> AgentTask:
    """Return the task of a built-in world; settings: see `AgentTask`.

    Raises:
        ValueError: the world belongs to no known task.
    """
    if world.task not in TASKS:
        raise ValueError(f"task = {world.task!r}: must be one of {', '.join(map(repr, TASKS))}")
    return (FindGoal if world.objects else FindWay)(world, mode, **settings)
