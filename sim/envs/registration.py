"""Gymnasium ids: `gymnasium.make("rhabdom/Detection-v0")`, Foraging-v0, Navigation-v0, Tracking-v0.

`import sim` registers them.
"""

from __future__ import annotations

import gymnasium

# Spelled out rather than taken from sim.worlds.world, which would load MuJoCo whenever Gymnasium is imported.
IDS = {
    "rhabdom/Detection-v0": "detection",
    "rhabdom/Foraging-v0": "foraging",
    "rhabdom/Navigation-v0": "navigation",
    "rhabdom/Tracking-v0": "tracking",
}


def register() -> None:
    """Make the ids known; twice is once. Episodes are truncated by the environment itself."""
    for id_, task in IDS.items():
        if id_ not in gymnasium.registry:
            gymnasium.register(id_, entry_point="sim.envs.env:EyesEnv", kwargs={"task": task})
