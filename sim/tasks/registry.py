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
    """Return the task that belongs to a built-in world.

    settings: further arguments of `AgentTask`

    Raises:
        ValueError: the task of the world is unknown.
    """
    if world.task not in TASKS:
        raise ValueError(f"task = {world.task!r}: must be one of {', '.join(map(repr, TASKS))}")
    return (FindGoal if world.objects else FindWay)(world, mode, **settings)
