"""The built-in tasks by name. Environments, Gymnasium's ids, configurations and reports use this table.

This module does not import MuJoCo, so that command lines and `import gymnasium` can list tasks without loading it.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

# Name of each task, and the aim of its agent, which completes "evolve to ...".
TASKS: Mapping[str, str] = MappingProxyType(
    {
        "navigation": "follow a course between striped walls to its end",
        "detection": "reach the goal sphere and avoid two adversaries, whose stripes have another orientation",
        "tracking": "reach a moving goal sphere and avoid moving adversaries, whose stripes have another orientation",
        "maze": "get as far as possible through a maze of striped corridors",
        "foraging": "reach the goal sphere and avoid two adversaries, which differ only below 400 nm",
    }
)

SUBSTEPS = 10  # number of the model's timesteps per action, as published
EPISODE_STEPS = 256  # number of actions after which an episode is truncated; as published
COURSES = ("short", "long")  # names of navigation's drawings in `sim.worlds.navigation`
