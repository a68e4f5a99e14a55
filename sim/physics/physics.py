"""What moves the worlds of a batch: the protocol that tasks, environments and renderers rely on."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, Protocol

import mujoco
import numpy as np

from sim.scene.poses import Poses
from sim.scene.variation import Drawn

__all__ = ["Physics"]


class Physics(Protocol):
    """All worlds of a batch: where everything is, and how it moves on.

    model: that renderers are built of · n: number of worlds · seconds: that one action lasts
    chance: random streams of the worlds, set by whoever seeds them
    varied: names of geoms whose size, colour or material differs between worlds, and of their materials
    """

    model: mujoco.MjModel
    n: int
    seconds: float
    varied: Mapping[str, tuple[str, ...]]
    chance: Any

    @property
    def state(self) -> Any:
        """All worlds as they are now, in this physics' own type."""

    def begin(self, world: int, drawn: Mapping[str, Drawn]) -> None:
        """Reset one world before its task starts an episode; drawn: values of what varies between episodes."""

    def settle(self, worlds: np.ndarray) -> None:
        """Compute where everything is after the task has started episodes in these worlds."""

    def adopt_changed_model(self) -> bool:
        """Whether the first episode's start changed the model; each world then gets a model of its own."""

    def watch(self) -> None:
        """Remember what a task must not change during a step."""

    def check(self, whose: str) -> None:
        """Compare with what `watch` remembered.

        Raises:
            RuntimeError: the task changed the model that all worlds share.
        """

    def step(self, skipped: Collection[int]) -> dict[int, str]:
        """Move all worlds on by one action, except skipped ones; returns why worlds broke down, by world."""

    def poses(self) -> Poses:
        """Where everything is now."""

    def held(self) -> dict[str, np.ndarray]:
        """All that the future depends on, as arrays whose first axis is the world.

        Raises:
            RuntimeError: the model has features whose state MuJoCo does not report.
        """

    def hold(self, state: Mapping[str, np.ndarray], worlds: np.ndarray) -> None:
        """Inverse of `held`, for these worlds."""

    def close(self) -> None:
        """Stop threads."""
