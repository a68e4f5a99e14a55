"""Records of the searches for eyes: groups that are complete, with the settings of the plan."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from evolve.config.assemble import to_toml
from evolve.config.run_config import RunConfig
from evolve.search.successive_halving import finished
from evolve.store.directory import Run
from experiments.eye_searches import KINDS, Search, searches

__all__ = ["complete_groups"]


def complete_groups(folder: Path, seeds: Sequence[int]) -> list[tuple[Search, Run]]:
    """Return the searches of each kind whose searches are all complete, with their records.

    seeds: seeds of the searches that are expected, except random searches, which have only one seed

    Raises:
        ValueError: a record has other settings than the plan, or no kind is complete.
        RunError: a record is damaged.
    """
    expected = [one for one in searches() if one.kind == "random" or one.seed in seeds]
    records = {search: _finished(folder, search) for search in expected}
    lacking = {kind: [one.name for one in expected if one.kind == kind and records[one] is None] for kind in KINDS}
    found = [(one, run) for one, run in records.items() if run is not None and not lacking[one.kind]]
    if not found:
        names = ", ".join(name for kind in KINDS for name in lacking[kind])
        raise ValueError(f"{folder}: no group of searches is complete; missing or unfinished: {names}")
    return found


def _finished(folder: Path, search: Search) -> Run | None:
    """Return the record of a finished search; None if it is missing or unfinished."""
    path = folder / search.name
    if not path.exists():
        return None
    run = Run.open(path)
    others = _different(run.config, search.config)
    if others:
        raise ValueError(f"{path}: has other settings than the plan: {', '.join(others)}")
    return run if finished(run) else None


def _different(config: RunConfig, planned: RunConfig) -> list[str]:
    """Return the names of the settings in which two configurations differ, apart from the number of workers."""
    one, other = (_settings(tomllib.loads(to_toml(replace(each, workers=0)))) for each in (config, planned))
    return sorted(name for name in one.keys() | other.keys() if one.get(name) != other.get(name))


def _settings(table: dict[str, object], above: str = "") -> dict[str, object]:
    """Return the values of nested tables by their names, such as "search.population"."""
    found: dict[str, object] = {}
    for name, value in table.items():
        found |= _settings(value, f"{above}{name}.") if isinstance(value, dict) else {f"{above}{name}": value}
    return found
