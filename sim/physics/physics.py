"""Protocol of the physics of a batch of worlds, on which tasks, environments and renderers rely."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, Protocol

import mujoco
import numpy as np

from sim.scene.poses import Poses
from sim.scene.variation import Drawn

__all__ = ["MOST_THREADS", "MOST_WORLDS", "Physics"]

MOST_WORLDS, MOST_THREADS = 1_000_000, 2**16  # chosen limits; higher numbers would exceed any computer


class Physics(Protocol):
    """All worlds of a batch, with their motion and their poses.

    model: model for which renderers are built
    n: number of worlds
    seconds: duration of one action [s]
    frames: number of equally spaced moments of an action at which receptors with dynamics see the worlds. The last one
        is the end of the action. The number is 1 or another divisor of `substeps`.
    passed: poses at these moments of the last action, except at its end, so there are `frames` - 1
    substeps: number of physics steps per action
    chance: random streams of the worlds, set whenever the worlds are seeded
    varied: names of geoms whose size, colour or material differs between worlds, with the materials that they may have
    """

    model: mujoco.MjModel
    n: int
    seconds: float
    substeps: int
    frames: int
    passed: list[Poses]
    varied: Mapping[str, tuple[str, ...]]
    chance: Any

    @property
    def state(self) -> Any:
        """Current state of all worlds, in the type that this kind of physics uses."""

    def start_episode(self, world: int, drawn: Mapping[str, Drawn]) -> None:
        """Reset one world before its task starts an episode.

        drawn: values of the varied quantities in this episode, by name
        """

    def settle(self, worlds: np.ndarray) -> None:
        """Compute the poses after the task has started episodes in these worlds."""

    def adopt_changed_model(self) -> bool:
        """Give each world its own model if the task changed the model at the start of the first episode.

        Return True if this call gave the worlds their own models.
        """

    def watch(self) -> None:
        """Store the settings of the model that a task must not change during a step."""

    def check(self, whose: str) -> None:
        """Compare the settings of the model with the settings stored by `watch`.

        whose: beginning of the error message

        Raises:
            RuntimeError: the task changed the model that several worlds share.
        """

    def step(self, skipped: Collection[int]) -> dict[int, str]:
        """Advance all worlds except the skipped ones by one action; return the worlds that fail, with the reasons."""

    def poses(self) -> Poses:
        """Return the current poses."""

    def get_state(self) -> dict[str, np.ndarray]:
        """Return the arrays on which future steps depend, by name; the first axis of each array is the world.

        Raises:
            RuntimeError: the model has features whose state MuJoCo does not report.
        """

    def set_state(self, state: Mapping[str, np.ndarray], worlds: np.ndarray) -> None:
        """Restore a state from `get_state` in these worlds."""

    def close(self) -> None:
        """Stop all threads."""
