"""Gymnasium ids, one for each task: `gymnasium.make("rhabdom/Detection-v0")`.

`import sim` registers them, and so does Gymnasium itself in "sim:rhabdom/Detection-v0". `gymnasium.make_vec` has all
worlds in one kernel.
"""

from __future__ import annotations

import gymnasium

from sim.worlds.catalog import TASKS

IDS = {f"rhabdom/{task.capitalize()}-v0": task for task in TASKS}


def register() -> None:
    """Make the ids known; twice is once. Episodes are truncated by the environment itself."""
    for id_, task in IDS.items():
        if id_ not in gymnasium.registry:
            gymnasium.register(
                id_,
                entry_point="sim.envs.env:EyesEnv",
                vector_entry_point="sim.envs.vector_env:EyesVectorEnv",
                kwargs={"task": task},
            )
