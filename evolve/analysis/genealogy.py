"""Who came from whom: the record names each candidate's parents; a line of descent follows the nearest of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from evolve.store.candidate import Candidate

__all__ = ["descent", "nearest_parent"]


def nearest_parent(candidate: Candidate, known: Mapping[int, Candidate]) -> Candidate | None:
    """Of its parents on record, the one whose genome is nearest (Euclid, the earliest of several); None without any.

    CMA-ES makes a generation from the mean of the better half of the last, so there each candidate has many.
    """
    parents = [known[candidate_id] for candidate_id in sorted(candidate.parents) if candidate_id in known]
    distances = [float(np.linalg.norm(candidate.vector - parent.vector)) for parent in parents]
    return parents[int(np.argmin(distances))] if parents else None


def descent(candidate: Candidate, candidates: Sequence[Candidate]) -> list[Candidate]:
    """From the first of its line to the candidate itself."""
    known = {other.id: other for other in candidates}
    line = [candidate]
    while (parent := nearest_parent(line[-1], known)) is not None and parent not in line:
        line.append(parent)
    return line[::-1]
