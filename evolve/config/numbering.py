"""Numbering of candidates. Ids are consecutive over all generations."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Place", "generation_ids"]


@dataclass(frozen=True)
class Place:
    """Place of a candidate in a search. All numbers count from 0.

    id: number of the candidate in the run
    generation: number of its generation
    index: number of the candidate in its generation
    """

    id: int
    generation: int
    index: int

    @classmethod
    def from_id(cls, candidate_id: int, population: int) -> Place:
        """Return the place (generation, and index in it) of a candidate.

        population: number of candidates in each generation
        """
        return cls(candidate_id, *divmod(candidate_id, population))


def generation_ids(generation: int, population: int) -> range:
    """Return the ids of a generation's candidates; every generation has `population` candidates."""
    return range(generation * population, (generation + 1) * population)
