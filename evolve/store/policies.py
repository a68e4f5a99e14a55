"""Whether trained policies are still those that the record speaks of."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from pathlib import Path

from evolve.store.candidate import Candidate
from evolve.store.record import RunError
from evolve.store.regular_files import read

__all__ = ["digest", "lost", "require_policy"]

SHOWN = 5  # ids in a line, at most
REMEDY = "put the file back from a copy of the run; nothing else needs it but replay, report and export"


def digest(path: Path) -> str | None:
    """SHA-256 of a policy's file; None if there is none.

    Raises:
        OSError: it cannot be read, or is no regular file.
    """
    try:
        return hashlib.sha256(read(path)).hexdigest()
    except FileNotFoundError:
        return None


def lost(candidates: Iterable[Candidate], where: Callable[[int], Path]) -> str | None:
    """One line on policies that the record knows and the directory has not; None if it has all of them."""
    gone = [c.id for c in candidates if c.policy is not None and not where(c.id).exists()]
    if not gone:
        return None
    names = ", ".join(map(str, gone[:SHOWN])) + (", ..." if len(gone) > SHOWN else "")
    return f"{where(gone[0]).parent}: policies of {len(gone)} candidates are lost ({names}): {REMEDY}"


def require_policy(candidate: Candidate, path: Path) -> None:
    """The policy with which a candidate was evaluated, and no other.

    Raises:
        RunError: it is lost, or another one is in its place, or there never was one.
    """
    if candidate.failure is not None:  # a file there is of an earlier budget stage, and nothing is known of its fitness
        raise RunError(f"candidate {candidate.id} has no policy, as it failed: {candidate.failure}")
    found = digest(path)
    if found is None and candidate.policy is None:
        raise RunError(f"no policy at {path}, and the record names none that was kept: choose another candidate")
    if found is None:
        raise RunError(f"no policy at {path}: {REMEDY}")
    if candidate.policy is not None and found != candidate.policy:
        raise RunError(f"{path} is not the policy with which candidate {candidate.id} was evaluated: {REMEDY}")
