"""Evaluation: the outcome of one candidate's training and evaluation."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

__all__ = ["Evaluation", "escaped", "most_frequent", "shortened", "total_episode_failures"]

KINDS, LONGEST = 4, 300  # maximum number of different messages that are stored, and of characters in each
LONGEST_FAILURE = 1000  # maximum number of characters of the message of a failed candidate
OTHERS = "others"  # message under which all other failures are counted


@dataclass(frozen=True)
class Evaluation:
    """Outcome of one candidate's training run and evaluation episodes.

    fitness: mean of `returns`; -inf if the candidate failed
    returns: return of each evaluation episode
    success_rate: fraction of the evaluation episodes that were solved
    steps: number of agent steps in training
    seconds: wall time of training and evaluation [s]
    curve: learning curve: (training steps, mean return) of each evaluation during training. The policy with the highest
        mean return is kept. The episodes of these evaluations are not among those of `returns`
    failure: message in one line; None if the candidate did not fail
    episode_failures: (message in one line, number of episodes that ended with it), the most frequent first. The last
        entry may be the total of all other messages, see `most_frequent`
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
        """Return the evaluation of a candidate that failed; the message is put on one line and shortened.

        seconds: wall time until the failure [s]
        """
        return cls(fitness=-math.inf, seconds=seconds, failure=shortened(_in_one_line(failure)))


def most_frequent(failures: Counter[str]) -> tuple[tuple[str, int], ...]:
    """Return at most 4 messages with their numbers of episodes, the most frequent first.

    If there are other messages, their total number of episodes follows under the name "others". Messages are put on one
    line and cut to 300 characters; messages that are then equal are counted together.

    failures: number of episodes that ended with each message
    """
    counts: Counter[str] = Counter()
    for failure, episodes in failures.items():
        counts[_in_one_line(failure)[:LONGEST]] += episodes
    others = counts.pop(OTHERS, 0)  # failures that an earlier call has summarised
    ranked = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
    others += sum(episodes for _, episodes in ranked[KINDS:])
    return (*ranked[:KINDS], (OTHERS, others)) if others else tuple(ranked)


def total_episode_failures(*parts: tuple[tuple[str, int], ...]) -> tuple[tuple[str, int], ...]:
    """Sum the episode failures over several parts of a training run, and shorten the sums with `most_frequent`."""
    counts: Counter[str] = Counter()
    for part in parts:
        counts.update(dict(part))
    return most_frequent(counts)


def escaped(text: str) -> str:
    """Return a text with escapes in place of lone surrogates, which represent invalid bytes in file names."""
    return text.encode(errors="backslashreplace").decode()


def shortened(failure: str) -> str:
    """Return the message of a failure with at most 1000 characters; long messages lose their middle."""
    if len(failure) <= LONGEST_FAILURE:
        return failure
    half = LONGEST_FAILURE // 2 - 4
    return f"{failure[:half]} [...] {failure[-half:]}"


def _in_one_line(text: str) -> str:
    return " ".join(escaped(text).split())
