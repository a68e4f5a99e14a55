"""Gymnasium ids, one for each task: `gymnasium.make("rhabdom/Detection-v0")`.

`import sim` registers the ids. With the id "sim:rhabdom/Detection-v0", Gymnasium itself imports `sim` first.
`gymnasium.make_vec` renders all worlds with one kernel.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium

from sim.worlds.catalog import EPISODE_STEPS, TASKS

if TYPE_CHECKING:
    from sim.tasks.task import Task

IDS = {f"rhabdom/{task.capitalize()}-v0": task for task in TASKS}


def register() -> None:
    """Register Gymnasium's id of each built-in task, unless it is already registered."""
    for id_, task in IDS.items():
        if id_ not in gymnasium.registry:
            _register(id_, EPISODE_STEPS, {"task": task})


def register_task(id_: str, task: Task | type[Task], **options: Any) -> None:
    """Register a user task, for `gymnasium.make` and `gymnasium.make_vec`.

    An existing registration of the id is replaced.

    id_: id of the form "NAME-vN" or "NAMESPACE/NAME-vN", such as "FindBall-v0"
    task: the task, or its class; its `episode_steps` is the length of episodes, unless `gymnasium.make` receives
        `max_episode_steps`
    options: arguments of `sim.make_vec_env`, such as memory. They are checked when an environment is made

    Raises:
        ValueError: `id_` is not text, `task` is not a `sim.Task`, or its `episode_steps` is invalid.
        Error: the id has an invalid form. This exception is a `gymnasium.error.Error`.
    """
    from optics.numerics.arguments import of_kind, shown, whole
    from sim.tasks.task import Task
    from sim.tasks.task_settings import MOST_STEPS

    if not isinstance(task, Task) and not (isinstance(task, type) and issubclass(task, Task)):
        raise ValueError(f"register_task: task = {shown(task)}: must be a sim.Task, or its class")
    of_kind("register_task: id_", id_, str, "'FindBall-v0'")
    episode_steps = whole("register_task: episode_steps", task.episode_steps, 1, MOST_STEPS)
    gymnasium.registry.pop(id_, None)
    _register(id_, episode_steps, {"task": task, **options})


def _register(id_: str, episode_steps: int, options: dict[str, Any]) -> None:
    """Register the Gymnasium id of a task.

    Callers of Gymnasium's functions can pass `max_episode_steps` for another length of episodes.
    """
    gymnasium.register(
        id_,
        entry_point="sim.envs.registered_env:RegisteredEnv",
        vector_entry_point="sim.envs.registered_env:RegisteredVectorEnv",
        max_episode_steps=episode_steps,
        kwargs=options,
    )
