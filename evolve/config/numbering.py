"""Numbering of candidates: ids run through all generations, with `population` ids in each."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Place", "generation_ids"]


@dataclass(frozen=True)
class Place:
    """Place of a candidate in a search: candidate `id` is number `index` of `generation`; all count from 0."""

    id: int
    generation: int
    index: int

    @classmethod
    def from_id(cls, candidate_id: int, population: int) -> Place:
        """Return the place of a candidate if every generation has `population` candidates."""
        return cls(candidate_id, *divmod(candidate_id, population))


def generation_ids(generation: int, population: int) -> range:
    """Return the ids of a generation's candidates."""
    return range(generation * population, (generation + 1) * population)
