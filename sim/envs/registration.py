"""Gymnasium ids, one for each task: `gymnasium.make("rhabdom/Detection-v0")`.

`import sim` registers them, and so does Gymnasium itself in "sim:rhabdom/Detection-v0". `gymnasium.make_vec` has all
worlds in one kernel.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium

from sim.worlds.catalog import EPISODE_STEPS, TASKS

if TYPE_CHECKING:
    from sim.tasks.task import Task

IDS = {f"rhabdom/{task.capitalize()}-v0": task for task in TASKS}


def register() -> None:
    """Make the ids known; twice is once."""
    for id_, task in IDS.items():
        if id_ not in gymnasium.registry:
            _register(id_, EPISODE_STEPS, {"task": task})


def register_task(id_: str, task: Task | type[Task], **options: Any) -> None:
    """Give a task of one's own an id, for `gymnasium.make` and `gymnasium.make_vec`; twice is the last time.

    id_: such as "FindBall-v0"
    task: it, or its class; without `max_episode_steps`, episodes are as long as it says
    options: as in `sim.make_vec_env`, such as memory

    Raises:
        ValueError: it is no task, or says no length.
    """
    from optics.numerics.arguments import whole
    from sim.tasks.task import Task
    from sim.tasks.task_settings import MOST_STEPS

    if not isinstance(task, Task) and not (isinstance(task, type) and issubclass(task, Task)):
        raise ValueError(f"register_task: task = {task!r:.80}: must be a sim.Task, or its class")
    gymnasium.registry.pop(id_, None)
    _register(id_, whole("register_task: episode_steps", task.episode_steps, 1, MOST_STEPS), {"task": task, **options})


def _register(id_: str, episode_steps: int, options: dict[str, Any]) -> None:
    """Gymnasium's `TimeLimit` truncates episodes, so that who makes the environment may say another number."""
    gymnasium.register(
        id_,
        entry_point="sim.envs.registered_env:RegisteredEnv",
        vector_entry_point="sim.envs.registered_env:RegisteredVectorEnv",
        max_episode_steps=episode_steps,
        kwargs=options,
    )
