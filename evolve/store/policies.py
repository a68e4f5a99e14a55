"""Checks that the files of trained policies match the record."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from evolve.store.candidate import Candidate
from evolve.store.checksums import digest
from evolve.store.record import RunError

__all__ = ["lost", "require_policy"]

SHOWN = 5  # maximum number of ids in a message
REMEDY = "restore the file from a copy of the run; only replay, report and export need it"


def lost(candidates: Iterable[Candidate], where: Callable[[int], Path]) -> str | None:
    """Return a message about recorded policies whose files are missing; None if all files exist.

    where: function that returns the path of a candidate's policy
    """
    gone = [c.id for c in candidates if c.policy is not None and not where(c.id).exists()]
    if not gone:
        return None
    names = ", ".join(map(str, gone[:SHOWN])) + (", ..." if len(gone) > SHOWN else "")
    return f"{where(gone[0]).parent}: policies of {len(gone)} candidates are lost ({names}): {REMEDY}"


def require_policy(candidate: Candidate, path: Path) -> None:
    """Check that a file is the policy with which a candidate was evaluated.

    If the record contains no checksum of the policy, as in older records, the content of the file is not checked.

    Raises:
        RunError: the file is missing or has a different content, or the candidate has failed.
        OSError: the file cannot be read.
    """
    if candidate.failure is not None:  # if a file exists, it is the policy of an earlier rung
        raise RunError(f"candidate {candidate.id} has no policy, as it failed: {candidate.failure}")
    found = digest(path)
    if found is None and candidate.policy is None:
        raise RunError(f"no policy at {path}, and none is on record: choose another candidate")
    if found is None:
        raise RunError(f"no policy at {path}: {REMEDY}")
    if candidate.policy is not None and found != candidate.policy:
        raise RunError(f"{path} is not the policy with which candidate {candidate.id} was evaluated: {REMEDY}")
