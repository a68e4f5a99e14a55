"""What became of one candidate."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

__all__ = ["Evaluation", "mishaps_in_all", "most_frequent"]

KINDS, LONGEST = 4, 300  # of mishaps that are told apart, and letters of each
OTHERS = "others"


@dataclass(frozen=True)
class Evaluation:
    """Outcome of one candidate's learning and evaluation episodes.

    fitness: mean of `returns`; -inf where the evaluation failed
    steps: agent steps trained
    seconds: wall time
    curve: (training steps, mean evaluation return), ...
    failure: one line that says what went wrong; None if nothing did
    mishaps: (what ended episodes in the middle of its life, in one line; how many), the most frequent first
    """

    fitness: float
    returns: tuple[float, ...] = ()
    success_rate: float = 0.0
    steps: int = 0
    seconds: float = 0.0
    curve: tuple[tuple[int, float], ...] = ()
    failure: str | None = None
    mishaps: tuple[tuple[str, int], ...] = ()

    @classmethod
    def failed(cls, failure: str, seconds: float = 0.0) -> Evaluation:
        """The evaluation of a candidate that has none, in one line."""
        return cls(fitness=-math.inf, seconds=seconds, failure=_in_one_line(failure))


def most_frequent(failures: Counter[str]) -> tuple[tuple[str, int], ...]:
    """Mishaps of as many kinds as a record has room for, and how many others there were."""
    told: Counter[str] = Counter()
    for failure, episodes in failures.items():
        told[_in_one_line(failure)[:LONGEST]] += episodes
    others = told.pop(OTHERS, 0)  # of mishaps that were ranked before
    ranked = sorted(told.items(), key=lambda item: (-item[1], item[0]))
    others += sum(episodes for _, episodes in ranked[KINDS:])
    return (*ranked[:KINDS], (OTHERS, others)) if others else tuple(ranked)


def mishaps_in_all(*mishaps: tuple[tuple[str, int], ...]) -> tuple[tuple[str, int], ...]:
    """Mishaps of several parts of a life as those of all of it."""
    counts: Counter[str] = Counter()
    for part in mishaps:
        counts.update(dict(part))
    return most_frequent(counts)


def _in_one_line(text: str) -> str:
    told = text.encode(errors="backslashreplace").decode()  # a file's name in it may be no text at all
    return " ".join(told.split())
