"""Lines of descent. If a candidate has several parents, its line follows the parent with the nearest genome."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from evolve.store.candidate import Candidate

__all__ = ["descent", "nearest_parent"]


def nearest_parent(candidate: Candidate, known: Mapping[int, Candidate]) -> Candidate | None:
    """Return the recorded parent with the smallest Euclidean distance between genomes; None if no parent is recorded.

    If several parents have the same distance, the one with the lowest id is returned. Candidates of CMA-ES have many
    parents, because CMA-ES samples a generation around a weighted mean of the better half of the previous generation.

    known: candidates on record, by id
    """
    parents = [known[candidate_id] for candidate_id in sorted(candidate.parents) if candidate_id in known]
    distances = [float(np.linalg.norm(candidate.vector - parent.vector)) for parent in parents]
    return parents[int(np.argmin(distances))] if parents else None


def descent(candidate: Candidate, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return a candidate's line of descent, from its earliest recorded ancestor to the candidate itself.

    candidates: recorded candidates, in which the ancestors are looked up
    """
    known = {other.id: other for other in candidates}
    line = [candidate]
    while (parent := nearest_parent(line[-1], known)) is not None and parent not in line:
        line.append(parent)
    return line[::-1]
