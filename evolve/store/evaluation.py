"""Outcome of one candidate."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

__all__ = ["Evaluation", "most_frequent", "total_episode_failures"]

KINDS, LONGEST = 4, 300  # maximum number of different failures, and of characters of each
OTHERS = "others"


@dataclass(frozen=True)
class Evaluation:
    """Outcome of one candidate's training run and evaluation episodes.

    fitness: mean of `returns`; -inf if the evaluation failed
    steps: agent steps trained
    seconds: wall time
    curve: (training steps, mean evaluation return), ...
    failure: message in one line; None if nothing failed
    episode_failures: (message in one line, number of episodes that it ended), the most frequent first
    """

    fitness: float
    returns: tuple[float, ...] = ()
    success_rate: float = 0.0
    steps: int = 0
    seconds: float = 0.0
    curve: tuple[tuple[int, float], ...] = ()
    failure: str | None = None
    episode_failures: tuple[tuple[str, int], ...] = ()

    @classmethod
    def failed(cls, failure: str, seconds: float = 0.0) -> Evaluation:
        """Return the evaluation of a candidate that failed."""
        return cls(fitness=-math.inf, seconds=seconds, failure=_in_one_line(failure))


def most_frequent(failures: Counter[str]) -> tuple[tuple[str, int], ...]:
    """Return the most frequent failures, up to `KINDS`, followed by the number of all others."""
    told: Counter[str] = Counter()
    for failure, episodes in failures.items():
        told[_in_one_line(failure)[:LONGEST]] += episodes
    others = told.pop(OTHERS, 0)  # from earlier calls of this function
    ranked = sorted(told.items(), key=lambda item: (-item[1], item[0]))
    others += sum(episodes for _, episodes in ranked[KINDS:])
    return (*ranked[:KINDS], (OTHERS, others)) if others else tuple(ranked)


def total_episode_failures(*mishaps: tuple[tuple[str, int], ...]) -> tuple[tuple[str, int], ...]:
    """Return the failures of several parts of a training run combined."""
    counts: Counter[str] = Counter()
    for part in mishaps:
        counts.update(dict(part))
    return most_frequent(counts)


def _in_one_line(text: str) -> str:
    told = text.encode(errors="backslashreplace").decode()  # a file's name in it may contain invalid text
    return " ".join(told.split())
