"""The tasks by name. Whoever lists them (environments, Gymnasium's ids, configurations, reports) reads them here.

No MuJoCo here: command lines and `import gymnasium` list tasks without loading it.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

# Name -> what is asked of the agent: "evolve to ...".
TASKS: Mapping[str, str] = MappingProxyType(
    {
        "navigation": "follow a course between striped walls to its end",
        "detection": "reach the goal sphere, avoid two adversaries that differ in stripe orientation only",
        "tracking": "detection with goal and adversaries that move",
        "maze": "get as far as possible through a maze of striped corridors",
        "foraging": "reach the goal sphere, avoid an adversary that differs below 400 nm only",
    }
)

EPISODE_STEPS = 256  # actions, then the episode is truncated; as published
COURSES = ("short", "long")  # of navigation: names of the drawings in `sim.worlds.navigation`
