"""`evolve status`: how a run stands, read from its record alone."""

from __future__ import annotations

import json
import statistics
import sys
from argparse import Namespace
from typing import Any

from evolve.lock import holder
from evolve.store import Run

__all__ = ["status"]


def status(arguments: Namespace) -> int:
    """Print how a run stands."""
    run = Run.open(arguments.directory)
    standing = _standing(run)
    if arguments.json:
        print(json.dumps(standing, indent=2, allow_nan=False))
        return 0
    if run.notice:
        print(f"note: {run.notice}", file=sys.stderr)
    print("\n".join(_lines(standing)))
    return 0


def _standing(run: Run) -> dict[str, Any]:
    worker = holder(run.path)
    state = "running" if worker else "finished" if run.finished else "interrupted"
    best = run.best
    return {
        "directory": str(run.path),
        "task": run.config.task,
        "state": state,
        "process": worker,
        "candidates": {
            "evaluated": len(run.candidates),
            "failed": sum(candidate.failure is not None for candidate in run.candidates),
            "planned": run.config.candidates,
        },
        "steps": sum(candidate.steps for candidate in run.candidates),
        "best": None
        if best is None
        else {"id": best.id, "fitness": best.fitness, "phenotype": best.phenotype.to_json()},
        "generations": [_generation(run, number) for number in range(run.config.search.generations)],
    }


def _generation(run: Run, number: int) -> dict[str, Any]:
    members = run.generation(number)
    fitness = [candidate.fitness for candidate in members if candidate.failure is None]
    return {
        "evaluated": len(members),
        "best": max(fitness, default=None),
        "median": statistics.median(fitness) if fitness else None,
    }


def _lines(standing: dict[str, Any]) -> list[str]:
    count, best = standing["candidates"], standing["best"]
    by = f" by process {standing['process']}" if standing["process"] else ""
    failed = f", {count['failed']} failed" if count["failed"] else ""
    lines = [
        f"{standing['directory']}: {standing['task']}, {standing['state']}{by}",
        f"{count['evaluated']} of {count['planned']} candidates evaluated{failed}, {standing['steps']:,} steps trained",
    ]
    if best is not None:
        lines.append(f"best: candidate {best['id']}, fitness {best['fitness']:.4g}")
    for number, generation in enumerate(standing["generations"]):
        if generation["best"] is not None:
            lines.append(f"generation {number}: best {generation['best']:.4g}, median {generation['median']:.4g}")
    if standing["state"] == "interrupted":
        lines.append(f"continue: evolve resume {standing['directory']}")
    return lines
