"""Gymnasium ids, one for each task: `gymnasium.make("rhabdom/Detection-v0")`.

`import sim` registers them.
"""

from __future__ import annotations

import gymnasium

from sim.worlds.catalog import TASKS

IDS = {f"rhabdom/{task.capitalize()}-v0": task for task in TASKS}


def register() -> None:
    """Make the ids known; twice is once. Episodes are truncated by the environment itself."""
    for id_, task in IDS.items():
        if id_ not in gymnasium.registry:
            gymnasium.register(id_, entry_point="sim.envs.env:EyesEnv", kwargs={"task": task})
