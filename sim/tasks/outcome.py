"""The outcome of one action in all worlds: rewards, endings and changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import repeat
from typing import Any

import numpy as np

__all__ = ["NOWHERE", "Outcome", "RewardTerms", "Step"]

NOWHERE = np.empty(0, int)


class RewardTerms:
    """The named terms of a reward for each row: a single array for all terms, or a dictionary for each row.

    Rows are worlds. If several agents learn, the first agent of all worlds comes first.

    Raises:
        ValueError: the numbers of terms and names differ.
    """

    def __init__(self, names: Sequence[str], terms: np.ndarray) -> None:
        self.names, self.terms = tuple(names), terms  # (term, row)
        if len(self.names) != len(terms):
            raise ValueError(f"terms has {len(terms)} rows: must be {len(self.names)}, one for each of {self.names}")
        self._rows: list[dict[str, float]] | None = None

    @classmethod
    def of_rows(cls, rows: Sequence[Mapping[str, float]]) -> RewardTerms:
        """Collect terms that may have other names in each row."""
        names = list(dict.fromkeys(name for row in rows for name in row))
        found = cls(names, np.array([[row.get(name, 0.0) for row in rows] for name in names]).reshape(-1, len(rows)))
        found._rows = [dict(row) for row in rows]
        return found

    @property
    def total(self) -> np.ndarray:
        """Reward of each row."""
        if self._rows is not None:
            return np.array([float(sum(row.values())) for row in self._rows])
        return np.asarray(self.terms.sum(axis=0))

    @property
    def rows(self) -> list[dict[str, float]]:
        """Terms by name, for each row."""
        if self._rows is not None:
            return self._rows
        # Built without a Python loop, which takes a third of the time: this happens for every world in every step.
        return list(map(dict, map(zip, repeat(self.names), self.terms.T.tolist())))

    def __getitem__(self, name: str) -> np.ndarray:
        """Return one term, (row,)."""
        return np.asarray(self.terms[self.names.index(name)])


@dataclass(frozen=True)
class Outcome:
    """The outcome of one action, as returned by a task.

    terms: terms of the reward
    terminated, success: (row,) bool
    failure: reasons, by world, if worlds could not continue; their episodes end
    over: worlds whose episode ends although no learner's is terminated, (world,) bool; None: none
    changed: worlds in which the task moved bodies after the action
    info: additional entries of each row's `info`; None: no additions
    proprioception: entries of the observation besides eyes, by agent and name (world, number); None: call the task's
        method. Worlds whose numbers are NaN keep the previous ones.
    """

    terms: RewardTerms
    terminated: np.ndarray
    success: np.ndarray
    failure: Mapping[int, str] = field(default_factory=dict)
    over: np.ndarray | None = None
    changed: np.ndarray = field(default_factory=lambda: NOWHERE)
    info: Sequence[Mapping[str, Any]] | None = None
    proprioception: Sequence[Mapping[str, np.ndarray]] | None = None


@dataclass(frozen=True)
class Step:
    """One action of all worlds, before any world starts a new episode.

    state: state of the physics after the action
    terms: terms of the reward
    reward: sum of the terms (row,)
    terminated, truncated, success: (row,) bool
    changed: worlds that must be rendered again
    given_up: truncated because the sum of the episode's rewards is too low, (row,) bool
    failure: reasons, by world, if worlds could not continue
    info: additional entries of each row's `info`, or None
    """

    state: Any
    terms: RewardTerms
    reward: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray
    success: np.ndarray
    changed: np.ndarray
    given_up: np.ndarray
    failure: Mapping[int, str]
    info: Sequence[Mapping[str, Any]] | None

    @property
    def reward_terms(self) -> dict[str, np.ndarray]:
        """Terms (row,) by name."""
        return {name: self.terms[name] for name in self.terms.names}

    @property
    def done(self) -> np.ndarray:
        """Rows whose episode has ended, (row,) bool."""
        return self.terminated | self.truncated
