"""What ended episodes in the middle of candidates' lives: methods of a task of one's own that failed, most often."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from evolve.store.candidate import Candidate

__all__ = ["Mishap", "mishaps_of", "mishaps_told"]


@dataclass(frozen=True)
class Mishap:
    """What was said, in how many episodes, of how many candidates."""

    said: str
    episodes: int
    candidates: int


def mishaps_of(candidates: Iterable[Candidate]) -> list[Mishap]:
    """The most frequent first."""
    episodes, lives = Counter[str](), Counter[str]()
    for candidate in candidates:
        for said, number in candidate.mishaps:
            episodes[said] += number
            lives[said] += 1
    ranked = sorted(episodes, key=lambda said: (-episodes[said], said))
    return [Mishap(said, episodes[said], lives[said]) for said in ranked]


def mishaps_told(found: Sequence[Mishap]) -> list[str]:
    """In one line, or none where there were none."""
    if not found:
        return []
    number, most = sum(one.episodes for one in found), found[0]
    whose = f"{most.episodes:,}, of {most.candidates} candidate{'s' * (most.candidates > 1)}"
    return [f"episodes that failed: {number:,}; most often ({whose}): {most.said}"]
