"""The outcome of one action in all worlds: rewards, ends of episodes, and worlds that changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import repeat
from typing import Any

import numpy as np

from optics.numerics.arguments import is_sized, one_of, shown

__all__ = ["NOWHERE", "Outcome", "RewardTerms", "Step"]

NOWHERE = np.empty(0, int)


class RewardTerms:
    """The named terms of the reward, with one value of each term per row. A row is one learning agent in one world.

    If one agent learns, the rows are the worlds. If several agents learn, the rows of the first agent in all worlds
    come first, then those of the second agent. The values are stored in one array (term, row). If rows have terms of
    different names, use the constructor `of_rows`, which stores a dictionary for each row besides the array.

    names: names of the terms
    terms: values of the terms, (term, row)

    Raises:
        ValueError: `names` is not a sequence of names, or `terms` is not a 2-D array of numbers, (name, row).
    """

    def __init__(self, names: Sequence[str], terms: np.ndarray) -> None:
        # Built-in tasks pass tuples in each step, which need no further check.
        if not isinstance(names, tuple) and (isinstance(names, str) or not is_sized(names)):
            raise ValueError(f"names = {shown(names)}: must be the names of the terms, such as ('goal',)")
        self.names, self.terms = tuple(names), terms  # (term, row)
        is_table = isinstance(terms, np.ndarray) and terms.ndim == 2 and terms.dtype.kind in "biuf"
        if not is_table or len(terms) != len(self.names):
            raise ValueError(f"terms = {shown(terms)}: must be numbers (term, row), one term for each of {self.names}")
        self._rows: list[dict[str, float]] | None = None

    @classmethod
    def of_rows(cls, rows: Sequence[Mapping[str, float]]) -> RewardTerms:
        """Return the terms of one or more rows. The names of the terms may differ between rows.

        A row is one learning agent in one world.

        rows: terms by name, for each row; a term that a row lacks is 0 in `terms`

        Raises:
            ValueError: there are no rows, or a row is not a mapping.
        """
        try:
            names = list(dict.fromkeys(name for row in rows for name in row))
            terms = np.array([[row.get(name, 0.0) for row in rows] for name in names]).reshape(-1, len(rows))
        except (TypeError, AttributeError, ValueError):
            raise ValueError(
                f"rows = {shown(rows)}: must be the terms of each row, such as [{{'goal': 1.0}}]"
            ) from None
        found = cls(names, terms)
        found._rows = [dict(row) for row in rows]
        return found

    @property
    def total(self) -> np.ndarray:
        """Reward of each row, (row,)."""
        if self._rows is not None:
            return np.array([float(sum(row.values())) for row in self._rows])
        return np.asarray(self.terms.sum(axis=0))

    @property
    def rows(self) -> list[dict[str, float]]:
        """Values of the terms by name, a dictionary for each row. A row is one learning agent in one world."""
        if self._rows is not None:
            return self._rows
        # These dictionaries are built for every world in every step. This form takes a third of the time of a loop.
        return list(map(dict, map(zip, repeat(self.names), self.terms.T.tolist())))

    def __getitem__(self, name: str) -> np.ndarray:
        """Return the values of one term, (row,); ValueError if there is no term of this name."""
        if not isinstance(name, str) or name not in self.names:
            one_of("term", name, self.names)
        return np.asarray(self.terms[self.names.index(name)])


@dataclass(frozen=True)
class Outcome:
    """The outcome of one action in all worlds. The method `judge` of a task returns it.

    A row is one learning agent in one world. The rows of the first agent in all worlds come first, then those of the
    second agent.

    The environment raises a ValueError if an array has another shape than stated here, if a term is not finite, or if
    an index does not belong to a world.

    terms: terms of the reward
    terminated: True if the task ends the episode, (row,) bool
    success: True if the task is accomplished, (row,) bool
    failure: the worlds that could not continue, by index, each with the reason; the episodes of these worlds end
    over: True if the task ends the episode of a world, even if `terminated` is False in all rows of this world,
        (world,) bool. For example, an animal that does not learn may end the episode; such an animal has no row. None:
        False in all worlds
    changed: indices of the worlds in which the task moved bodies after the action, (k,) int
    info: additional entries of each row's `info`; None: no additions
    proprioception: part of the observation that does not come from eyes, for each agent and by name, (world, value);
        a world whose values are NaN keeps its previous values. None: the task's method `all_proprioception` is
        called.
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
    """Result of one action in all worlds, before any world starts a new episode.

    state: state of the physics after the action
    terms: terms of the reward
    reward: sum of the terms (row,)
    terminated: True if the task ended the episode, (row,) bool
    truncated: True if the episode ended for another reason, such as its number of actions, (row,) bool
    success: True if the task is accomplished, (row,) bool
    changed: indices of the worlds that must be rendered again, (k,) int
    given_up: True if the episode was truncated because the sum of its rewards is too low, (row,) bool
    failure: the worlds that could not continue, by index, each with the reason
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
        """Terms of the reward by name, each an array (row,). A row is one learning agent in one world."""
        return {name: self.terms[name] for name in self.terms.names}

    @property
    def done(self) -> np.ndarray:
        """True for rows whose episode has ended, (row,) bool."""
        return self.terminated | self.truncated
