"""Records of the searches for eyes: groups that are complete, with the settings of the plan."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from evolve.store.directory import Run
from experiments.eye_searches import KINDS, Search, searches
from experiments.planned_searches import finished_run

__all__ = ["complete_groups"]


def complete_groups(folder: Path, seeds: Sequence[int]) -> list[tuple[Search, Run]]:
    """Return the searches of the complete kinds, with their records. A kind is complete if all its searches are.

    seeds: seeds of the searches that are expected, except random searches, which have only one seed

    Raises:
        ValueError: a record has other settings than the plan, or no kind is complete.
        RunError: a record is damaged.
    """
    expected = [one for one in searches() if one.kind == "random" or one.seed in seeds]
    records = {search: finished_run(folder, search.planned) for search in expected}
    lacking = {kind: [one.name for one in expected if one.kind == kind and records[one] is None] for kind in KINDS}
    found = [(one, run) for one, run in records.items() if run is not None and not lacking[one.kind]]
    if not found:
        names = ", ".join(name for kind in KINDS for name in lacking[kind])
        raise ValueError(f"{folder}: no group of searches is complete; missing or unfinished: {names}")
    return found
