"""Checks of the calls of an environment: their order, their seeds and their actions. All environments use these checks.

A batch accepts an action that is not finite: the action ends the episode of its world, and the other worlds continue
(`sim.tasks.simulation`). An environment of one world refuses such an action with a ValueError.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from optics.numerics.arguments import shown, without_derivative
from optics.numerics.number_types import real_array

CLOSED = "the environment is closed: make a new one"
NOT_BEGUN = "the worlds have not begun: call reset first"


class CallOrder:
    """The calls that an environment accepts next.

    Actions and images are possible only if the last reset was completed. After `expect_wait`, an action is pending
    until `take`. After `close`, only another `close` is accepted.
    """

    def __init__(self) -> None:
        self.closed = self._begun = self._pending = False

    def require_open(self) -> None:
        """Refuse a call after `close`, or while an action is pending.

        Raises:
            RuntimeError: the environment is closed, or `step_wait` must come first.
        """
        if self.closed:
            raise RuntimeError(CLOSED)
        if self._pending:
            raise RuntimeError("step_async has started an action: call step_wait first")

    def require_begun(self) -> None:
        """Refuse a call before the first reset, after `close`, or while an action is pending.

        Raises:
            RuntimeError: there has been no reset yet, the environment is closed, or `step_wait` must come first.
        """
        self.require_open()
        if not self._begun:
            raise RuntimeError(NOT_BEGUN)

    def start_reset(self) -> None:
        """Record that a reset has started.

        Raises:
            RuntimeError: the environment is closed, or an action is pending.
        """
        self.require_open()
        self._begun = False

    def finish_reset(self) -> None:
        """Record that the reset is complete, so that actions are accepted."""
        self._begun = True

    def expect_wait(self) -> None:
        """Record that an action is pending."""
        self._pending = True

    def take(self) -> None:
        """Record that the pending action is being taken.

        Raises:
            RuntimeError: no action is pending, or the environment is closed.
        """
        pending, self._pending = self._pending, False
        self.require_begun()
        if not pending:
            raise RuntimeError("no action is pending: call step_async before step_wait")

    def close(self) -> None:
        """Refuse all later calls."""
        self.closed = True


def seed_of(name: str, seed: Any) -> int | None:
    """Return a seed as an int, or None; ValueError unless it is None or a whole number of at least 0."""
    if seed is None:
        return None
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise ValueError(f"{name} = {shown(seed)}: must be a whole number, at least 0, or None")
    return int(seed)


def actions_of(name: str, actions: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return actions as a float32 array. Finite numbers beyond the range of float32 are limited to it.

    name: the actions' name in messages, such as "actions"
    shape: required shape of the actions

    Raises:
        ValueError: the actions are not real numbers, are masked, or have another shape.
    """
    if not (type(actions) is np.ndarray and actions.dtype == np.float32):
        given = real_array(name, without_derivative(name, actions))  # policies may compute in half precision
        if given is None:
            raise ValueError(f"{name} = {shown(actions)}: must be real numbers")
        exact, largest = given.astype(np.float64), np.finfo(np.float32).max
        actions = np.where(np.isinf(exact), exact, np.clip(exact, -largest, largest)).astype(np.float32)
    if actions.shape != shape:
        raise ValueError(f"{name} has shape {actions.shape}: must be {shape}")
    return np.asarray(actions)


def one_worlds_action(name: str, action: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return the action for an environment of one world as a float32 array. For the arguments, see `actions_of`.

    Raises:
        ValueError: the action is not finite, or `actions_of` refuses it.
    """
    taken = actions_of(name, action, shape)
    if not np.isfinite(taken).all():
        raise ValueError(f"{name} = {shown(taken.tolist())}: must be finite")
    return taken
