"""Failures that ended episodes of training or evaluation, mostly failures of methods of a user task."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from evolve.store.candidate import Candidate

__all__ = ["EpisodeFailure", "episode_failure_lines", "episode_failures_of"]


@dataclass(frozen=True)
class EpisodeFailure:
    """A failure that ended one or more episodes of training or evaluation.

    said: message of the failure
    episodes: number of episodes that ended with this message
    candidates: number of candidates with such episodes
    """

    said: str
    episodes: int
    candidates: int


def episode_failures_of(candidates: Iterable[Candidate]) -> list[EpisodeFailure]:
    """Return the failures that ended the candidates' episodes in training or evaluation, the most frequent first."""
    episodes, affected = Counter[str](), Counter[str]()
    for candidate in candidates:
        for said, number in candidate.episode_failures:
            episodes[said] += number
            affected[said] += 1
    ranked = sorted(episodes, key=lambda said: (-episodes[said], said))
    return [EpisodeFailure(said, episodes[said], affected[said]) for said in ranked]


def episode_failure_lines(found: Sequence[EpisodeFailure]) -> list[str]:
    """Return a list with one line that summarises the failures; [] if there are none.

    found: failures, the most frequent first
    """
    if not found:
        return []
    number, most = sum(one.episodes for one in found), found[0]
    whose = f"{most.episodes:,} episodes of {most.candidates} candidate{'s' * (most.candidates > 1)}"
    return [f"failed episodes: {number:,}; most frequent failure ({whose}): {most.said}"]
