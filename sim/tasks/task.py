"""User tasks for one world at a time: a robot with eyes, the start of an episode, and the reward of a step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from optics.numerics.arguments import shown
from sim.physics.controls import controls_of
from sim.tasks.task_settings import TaskSettings

if TYPE_CHECKING:
    from sim.tasks.encounter import Frozen


class Task(TaskSettings):
    """A task of one world at a time, in plain Python. A subclass must define `model`, `mounts` and `rewards`.

    The settings are those of `TaskSettings`, and this one:

    others: animals in the same world that do not learn, see `sim.Frozen`. Each has its own body, actuators and eyes in
        the same model. At the start of an episode, `reset` of every animal is called in turn. As soon as `terminated`
        of one animal returns True, the episode ends for all animals; for the other animals it counts as truncated.

    If `evolve` optimizes the eyes for this task (`evolve run FILE.py:CLASS`), every candidate has its own eyes, at the
    mounts that the task's method `place` returns. The class must then have no required arguments.

    If a method raises an exception or returns an invalid value, the episode of this world ends, and `info["failure"]`
    is the reason. In contrast, an error in `reset`, or in `proprioception` during a reset, ends the simulation of all
    worlds with a RuntimeError, because no episode can start.

    Methods are called for one world at a time, with its mjData after mj_forward. One task object is used for
    all worlds. Variables of an episode must therefore be stored in mjData (for example in `userdata`), not in the task.
    A `sim.BatchTask` has the same methods, but one call handles all worlds at once. It is therefore faster.
    """

    others: Sequence[Frozen] = ()

    def reset(self, data: mujoco.MjData, rng: np.random.Generator) -> None:
        """Set the state of the world at the start of an episode.

        This method is called after mj_resetData. By default, it leaves the state as mj_resetData set it. A
        change of `data.model` applies to this episode only.

        rng: random number generator of the world
        """

    def act(self, data: mujoco.MjData, action: np.ndarray) -> None:
        """Apply an action, (n_actions,), with values in [-1, 1].

        The default maps [-1, 1] to the full range of each control of the task's actuators; a control without limits
        gets the value itself.
        """
        model, mine = data.model, controls_of(data.model, self.actuators)
        limited = model.actuator_ctrllimited[mine].astype(bool)
        low, high = np.where(limited[:, None], model.actuator_ctrlrange[mine], [-1.0, 1.0]).T
        data.ctrl[mine] = low + (high - low) * (action + 1) / 2

    def rewards(self, data: mujoco.MjData) -> Mapping[str, float]:
        """Return the terms of the reward for the last action, finite numbers by name. The reward is their sum."""
        raise NotImplementedError

    def terminated(self, data: mujoco.MjData) -> bool:
        """Return whether the episode ends after this action. If a task returns None here, this counts as False."""
        return False

    def succeeded(self, data: mujoco.MjData) -> bool:
        """Return whether the task is accomplished. If a task returns None here, this counts as False.

        The result is stored as `info["is_success"]`.
        """
        return False

    def proprioception(self, data: mujoco.MjData) -> np.ndarray:
        """Return the part of the animal's observation that does not come from eyes; by default, no values.

        The part consists of finite numbers, (k,), and k is the same at every call.
        """
        return np.zeros(0)


def named_terms(task: Task, data: mujoco.MjData, whose: str = "") -> dict[str, float]:
    """Return the terms of the reward by name, after checking them.

    whose: beginning of the error message

    Raises:
        ValueError: the task did not return finite numbers by name.
    """
    terms: Any = task.rewards(data)
    if not isinstance(terms, Mapping):
        raise ValueError(f"{whose}rewards returned {terms!r}: must be numbers by name, such as {{'progress': 0.1}}")
    for name, value in terms.items():
        if not _is_finite(value):
            raise ValueError(f"{whose}rewards: {name!r} is {shown(value)}: must be one finite number")
    return {str(name): float(value) for name, value in terms.items()}


def condition(where: str, returned: Any) -> bool:
    """Convert the return value of a method to a truth value; None counts as False.

    where: the method, for the error message

    Raises:
        ValueError: the method returned text, or several values.
    """
    try:
        if not isinstance(returned, str | bytes):
            return bool(returned)
    except ValueError:
        pass  # NumPy refuses arrays of several values
    raise ValueError(f"{where} returned {shown(returned)}: must be True or False")


def _is_finite(value: Any) -> bool:
    try:
        return isinstance(value, Real | np.bool_) and math.isfinite(float(value))
    except OverflowError:  # an int beyond the range of floats
        return False
