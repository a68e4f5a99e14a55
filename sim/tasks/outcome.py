"""What one action of all worlds was worth, and where it led."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import repeat
from typing import Any

import numpy as np

__all__ = ["NOWHERE", "Outcome", "RewardTerms", "Step"]

NOWHERE = np.empty(0, int)


class RewardTerms:
    """The named terms of a reward, for each row: one array for all terms, or a dictionary for each row.

    Rows are worlds; if several agents learn, the first agent of all worlds comes first.

    Raises:
        ValueError: another number of terms than of names.
    """

    def __init__(self, names: Sequence[str], terms: np.ndarray) -> None:
        self.names, self.terms = tuple(names), terms  # (term, row)
        if len(self.names) != len(terms):
            raise ValueError(f"terms has {len(terms)} rows: must be {len(self.names)}, one for each of {self.names}")
        self._rows: list[dict[str, float]] | None = None

    @classmethod
    def of_rows(cls, rows: Sequence[Mapping[str, float]]) -> RewardTerms:
        """Of terms that may have other names in each row."""
        names = list(dict.fromkeys(name for row in rows for name in row))
        found = cls(names, np.array([[row.get(name, 0.0) for row in rows] for name in names]).reshape(-1, len(rows)))
        found._rows = [dict(row) for row in rows]
        return found

    @property
    def total(self) -> np.ndarray:
        """The reward of each row."""
        if self._rows is not None:
            return np.array([float(sum(row.values())) for row in self._rows])
        return np.asarray(self.terms.sum(axis=0))

    @property
    def rows(self) -> list[dict[str, float]]:
        """Terms by name, of each row."""
        if self._rows is not None:
            return self._rows
        # Without Python's loop: this is done for every world in every step, and takes a third of the time so.
        return list(map(dict, map(zip, repeat(self.names), self.terms.T.tolist())))

    def __getitem__(self, name: str) -> np.ndarray:
        """One term, (row,)."""
        return np.asarray(self.terms[self.names.index(name)])


@dataclass(frozen=True)
class Outcome:
    """What a task makes of one action.

    terms: of the reward · terminated, success: (row,) bool
    failure: why worlds could not go on, by world; their episodes end
    over: worlds whose episode ends although no learner's is terminated, (world,) bool; None: none
    changed: worlds in which the task put bodies elsewhere after the action
    info: more entries of each row's `info`; None: no more
    feels: what agents know beside what they see, by agent and name (world, number); None: the task's `feels` says it.
        Worlds whose numbers are NaN keep the previous ones
    """

    terms: RewardTerms
    terminated: np.ndarray
    success: np.ndarray
    failure: Mapping[int, str] = field(default_factory=dict)
    over: np.ndarray | None = None
    changed: np.ndarray = field(default_factory=lambda: NOWHERE)
    info: Sequence[Mapping[str, Any]] | None = None
    feels: Sequence[Mapping[str, np.ndarray]] | None = None


@dataclass(frozen=True)
class Step:
    """One action of all worlds, before any world starts a new episode.

    state: of the physics after the action · terms: of the reward · reward: their sum (row,)
    terminated, truncated, success: (row,) bool · changed: worlds that must be rendered again
    given_up: truncated because the rewards of the episode add up to too little, (row,) bool
    failure: why worlds could not go on, by world · info: more entries of each row's `info`, or None
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
        """Each term (row,) by its name."""
        return {name: self.terms[name] for name in self.terms.names}

    @property
    def done(self) -> np.ndarray:
        """Rows whose episode has ended, (row,) bool."""
        return self.terminated | self.truncated
