"""How a search numbers its candidates: ids run through all generations, `population` of them in each."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Place", "generation_ids"]


@dataclass(frozen=True)
class Place:
    """Where a candidate stands in a search: candidate `id` is number `index` of `generation`; all count from 0."""

    id: int
    generation: int
    index: int

    @classmethod
    def of(cls, candidate_id: int, population: int) -> Place:
        """The place of a candidate where every generation has `population` of them."""
        return cls(candidate_id, *divmod(candidate_id, population))


def generation_ids(generation: int, population: int) -> range:
    """Ids of a generation's candidates."""
    return range(generation * population, (generation + 1) * population)
