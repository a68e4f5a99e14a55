"""A task of one's own: a robot with eyes, how an episode begins, and what a step is worth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from sim.physics.controls import controls_of
from sim.tasks.task_settings import TaskSettings

if TYPE_CHECKING:
    from sim.tasks.encounter import Frozen


class Task(TaskSettings):
    """A task of one world at a time, in plain Python; only `model`, `mounts` and `rewards` have no default.

    The settings are those of `TaskSettings`, and one more:

    others: animals in the same world that do not learn, see `sim.Frozen`; each has a body, actuators and eyes of its
        own in the one model. Then an episode begins with everybody's `reset`, in turn, and ends as soon as anybody's
        `terminated` says so: it is truncated for those whose own does not

    Where the task evolves (`evolve run FILE.py:CLASS`), every animal has eyes of its own, where `place` puts them; a
    class without arguments is needed for that.

    What fails in a method ends its world's episode; in `reset`, and in `feels` there, it is a RuntimeError for all,
    since a world that cannot begin has no episode.

    Methods are called for one world at a time, with its mjData after mj_forward. One task serves all worlds: what an
    episode must remember belongs into mjData (`userdata`, say), not into the task. A `sim.BatchTask` has the same
    methods for arrays of all worlds, which is faster.
    """

    others: Sequence[Frozen] = ()

    def reset(self, data: mujoco.MjData, rng: np.random.Generator) -> None:
        """Begin an episode: change what mj_resetData has left. `data.model` may be changed, too, for the episode."""

    def act(self, data: mujoco.MjData, action: np.ndarray) -> None:
        """Take an action in [-1, 1], (n_actions,); here: each control of its actuators over the whole of its range."""
        model, mine = data.model, controls_of(data.model, self.actuators)
        limited = model.actuator_ctrllimited[mine].astype(bool)
        low, high = np.where(limited[:, None], model.actuator_ctrlrange[mine], [-1.0, 1.0]).T
        data.ctrl[mine] = low + (high - low) * (action + 1) / 2

    def rewards(self, data: mujoco.MjData) -> Mapping[str, float]:
        """What the step that led here is worth, by named terms; the reward is their sum."""
        raise NotImplementedError

    def terminated(self, data: mujoco.MjData) -> bool:
        """Whether the episode ends here."""
        return False

    def succeeded(self, data: mujoco.MjData) -> bool:
        """Whether what was to be done is done: `info["is_success"]`."""
        return False

    def feels(self, data: mujoco.MjData) -> np.ndarray:
        """What the animal knows beside what it sees, (k,); here: nothing."""
        return np.zeros(0)


def named_terms(task: Task, data: mujoco.MjData, whose: str = "") -> dict[str, float]:
    """Its rewards; whose: what a message begins with.

    Raises:
        ValueError: they are no finite numbers by name.
    """
    terms: Any = task.rewards(data)
    if not isinstance(terms, Mapping):
        raise ValueError(f"{whose}rewards returned {terms!r}: must be numbers by name, such as {{'progress': 0.1}}")
    for name, value in terms.items():
        if not np.isscalar(value) or not np.isfinite(value):
            raise ValueError(f"{whose}rewards: {name!r} is {value!r}: must be one finite number")
    return {str(name): float(value) for name, value in terms.items()}
