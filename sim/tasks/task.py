"""User tasks for one world at a time: a robot with eyes, the beginning of an episode, and the reward of a step."""

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
    """A task of one world at a time, in plain Python. Only `model`, `mounts` and `rewards` have no default.

    In addition to the settings of `TaskSettings`, there is one more:

    others: animals in the same world that do not learn, see `sim.Frozen`. Each has its own body, actuators and eyes in
        the same model. An episode begins with the `reset` of every animal, in turn. It ends for all as soon as one
        animal's `terminated` is true, and is truncated for animals whose own is false.

    If the task evolves (`evolve run FILE.py:CLASS`), every candidate has its own eyes, at the places that `place`
    returns. The class must then have no required arguments.

    A method that fails ends its world's episode. In `reset`, and in `proprioception` during a reset, a failure is a
    RuntimeError for all worlds, since a world that cannot begin has no episode.

    Methods are called for one world at a time, with its mjData after mj_forward. One task serves all worlds, so the
    memory of an episode must be stored in mjData (for example in `userdata`) and not in the task. A `sim.BatchTask` has
    the same methods for arrays of all worlds, which is faster.
    """

    others: Sequence[Frozen] = ()

    def reset(self, data: mujoco.MjData, rng: np.random.Generator) -> None:
        """Start an episode: change the state after mj_resetData. `data.model` may also be changed, for this episode."""

    def act(self, data: mujoco.MjData, action: np.ndarray) -> None:
        """Take an action in [-1, 1], (n_actions,); default: map each value to the full range of one of the actuators'
        controls."""
        model, mine = data.model, controls_of(data.model, self.actuators)
        limited = model.actuator_ctrllimited[mine].astype(bool)
        low, high = np.where(limited[:, None], model.actuator_ctrlrange[mine], [-1.0, 1.0]).T
        data.ctrl[mine] = low + (high - low) * (action + 1) / 2

    def rewards(self, data: mujoco.MjData) -> Mapping[str, float]:
        """Return the named terms of the last step's reward; the reward is their sum."""
        raise NotImplementedError

    def terminated(self, data: mujoco.MjData) -> bool:
        """Return whether the episode ends here."""
        return False

    def succeeded(self, data: mujoco.MjData) -> bool:
        """Return whether the task is accomplished: `info["is_success"]`."""
        return False

    def proprioception(self, data: mujoco.MjData) -> np.ndarray:
        """Return the animal's observation other than signals of eyes, (k,); default: nothing."""
        return np.zeros(0)


def named_terms(task: Task, data: mujoco.MjData, whose: str = "") -> dict[str, float]:
    """Return the named rewards of a task; whose: beginning of the message.

    Raises:
        ValueError: not finite numbers by name.
    """
    terms: Any = task.rewards(data)
    if not isinstance(terms, Mapping):
        raise ValueError(f"{whose}rewards returned {terms!r}: must be numbers by name, such as {{'progress': 0.1}}")
    for name, value in terms.items():
        if not np.isscalar(value) or not np.isfinite(value):
            raise ValueError(f"{whose}rewards: {name!r} is {value!r}: must be one finite number")
    return {str(name): float(value) for name, value in terms.items()}
