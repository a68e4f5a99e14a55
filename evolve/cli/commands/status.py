"""`evolve status` and `evolve list`: states of runs.

The states are read from the files in the run directories. The runs themselves are not affected.
"""

from __future__ import annotations

import json
import os
import statistics
import sys
import time
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from evolve.analysis.episode_failures import episode_failure_lines, episode_failures_of
from evolve.analysis.fitness_parts import fitness_text
from evolve.config.task_code import names_code
from evolve.runs.output import as_it_is, results, say
from evolve.search.successive_halving import finished
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from evolve.store.evaluation import shortened
from evolve.store.lock import holder

__all__ = ["listing", "standing", "standing_lines", "status"]

WATCH_S = 2.0  # [s] interval between two readings
SHOWN = 12  # number of the latest generations that are shown


def status(arguments: Namespace) -> int:
    """Print the state of a run; with --watch, print it again after each change until no process works on the run."""
    now = _read(arguments)
    if not arguments.watch:
        _show(arguments, now)
        return 0
    shown: dict[str, Any] | None = None
    while True:
        if now != shown:
            _show(arguments, now)
            shown = now
        if now["state"] != "running":
            return 0
        time.sleep(WATCH_S)
        now = _read(arguments)


def _read(arguments: Namespace) -> dict[str, Any]:
    return standing(Run.open(arguments.directory, before_damage=arguments.before_damage))


def listing(arguments: Namespace) -> int:
    """Print one line (or JSON object) for each run in a directory, the most recently changed last.

    The line of a run that cannot be read states the reason.
    """
    # os.path.exists returns False for an unreadable folder, which cannot be a run of this user. pathlib would raise.
    folders = [path for path in arguments.directory.iterdir() if os.path.exists(path / "config.toml")]
    found = [_standing_or_reason(path) for path in sorted(folders, key=lambda path: path.stat().st_mtime)]
    if arguments.json:
        say(json.dumps(found, indent=1, allow_nan=False, default=vars))
        return 0
    if not found:
        say(f"{arguments.directory}: contains no runs")
    width = max((len(one["directory"]) for one in found), default=0)
    for one in found:
        say(f"{one['directory']:<{width}}  {_in_one_line(one)}")
    return 0


def _standing_or_reason(path: Path) -> dict[str, Any]:
    try:
        return {name: value for name, value in standing(Run.open(path)).items() if name != "generations"}
    except Exception as error:  # an error in one directory must not hide the others
        reason = str(error) or type(error).__name__
        return {"directory": str(path), "state": "unreadable", "reason": shortened(" ".join(reason.split()))}


def _in_one_line(one: dict[str, Any]) -> str:
    if one["state"] == "unreadable":
        return f"unreadable: {one['reason']}"
    found = one["best"]
    best = "" if found is None else f", best fitness {fitness_text(found['fitness'], found['costs'])}"
    count = one["candidates"]
    return f"{one['task']:<11} {one['state']:<11} {count['evaluated']} of {count['planned']} candidates{best}"


def _show(arguments: Namespace, now: dict[str, Any]) -> None:
    """Print a state as text or as indented JSON.

    With --watch, JSON is printed on one line, and a terminal is cleared before text is printed.
    """
    if arguments.json:
        say(json.dumps(now, indent=None if arguments.watch else 2, allow_nan=False, default=vars), flush=True)
        return
    if now["notice"]:
        print(f"note: {now['notice']}", file=sys.stderr)
    if arguments.watch and results().isatty():
        print("\x1b[H\x1b[2J", end="", file=as_it_is(results()))
    say("\n".join(standing_lines(now)), flush=True)


def standing(run: Run) -> dict[str, Any]:
    """Return, by name, a run's state, its best candidate, and a summary of each generation.

    All values are JSON values, except that of "mishaps": a list of `EpisodeFailure` objects, whose fields are JSON
    values. The value of "state" is "running" if a process holds the lock of the run, else "finished" or "interrupted".

    Raises:
        OSError: the lock or config.toml cannot be read.
    """
    worker = holder(run.path)
    state = "running" if worker else "finished" if finished(run) else "interrupted"
    best = run.best
    return {
        "directory": str(run.path),
        "task": run.config.task,
        "state": state,
        "process": worker,
        "notice": run.notice,
        "lines_without_checksum": run.record.unchecked,
        "candidates": {
            "evaluated": len(run.candidates),
            "failed": sum(candidate.failure is not None for candidate in run.candidates),
            "planned": run.config.candidates,
        },
        "last_failure": next((c.failure for c in reversed(run.in_order_of_finish) if c.failure), None),
        "mishaps": episode_failures_of(run.candidates),
        "steps": sum(candidate.steps for candidate in run.candidates),
        "best": None if best is None else {"id": best.id, **_parts(best), "phenotype": best.phenotype.to_json()},
        "generations": _generations(run),
    }


def _parts(candidate: Candidate) -> dict[str, float]:
    return {"fitness": candidate.fitness, "task_fitness": candidate.task_fitness, "costs": candidate.costs}


def _generations(run: Run) -> list[dict[str, Any]]:
    members: dict[int, list[Candidate]] = {}
    for candidate in run.candidates:
        members.setdefault(candidate.generation, []).append(candidate)
    return [_generation(members.get(number, [])) for number in range(run.config.search.generations)]


def _generation(members: Sequence[Candidate]) -> dict[str, Any]:
    """Return, by name, numbers that describe a generation, as JSON values.

    "best", "task_fitness" (mean return) and "costs" belong to the best candidate: the fitness "best" is the mean return
    minus the costs. Without a successful candidate, all values except "evaluated" are None.
    """
    done = [candidate for candidate in members if candidate.failure is None]
    best = max(done, key=lambda candidate: (candidate.fitness, -candidate.id), default=None)
    return {
        "evaluated": len(members),
        "best": None if best is None else best.fitness,
        "task_fitness": None if best is None else best.task_fitness,
        "costs": None if best is None else best.costs,
        "median": statistics.median(candidate.fitness for candidate in done) if done else None,
    }


def standing_lines(now: dict[str, Any]) -> list[str]:
    """Return the state of a run, its best candidate and its latest generations as lines of text.

    now: result of the function `standing` for the run
    """
    count, best = now["candidates"], now["best"]
    by = f" by process {now['process']}" if now["process"] else ""
    failed = f", {count['failed']} failed" if count["failed"] else ""
    lines = [
        f"{now['directory']}: {now['task']}, {now['state']}{by}",
        f"{count['evaluated']} of {count['planned']} candidates evaluated{failed}, {now['steps']:,} steps trained",
    ]
    if unchecked := now["lines_without_checksum"]:
        lines.append(f"checksums: the first {unchecked} lines of the record have none (an older version wrote them)")
    if now["last_failure"]:
        lines.append(f"last failure: {now['last_failure']}")
    lines += episode_failure_lines(now["mishaps"])
    if best is not None:
        lines.append(f"best: candidate {best['id']}, fitness {fitness_text(best['fitness'], best['costs'])}")
    known = [(number, g) for number, g in enumerate(now["generations"]) if g["best"] is not None]
    if len(known) > SHOWN:
        lines.append(f"generations 0 to {known[-SHOWN][0] - 1}: best {max(g['best'] for _, g in known[:-SHOWN]):.4g}")
    for number, generation in known[-SHOWN:]:
        shown = fitness_text(generation["best"], generation["costs"])
        lines.append(f"generation {number}: best {shown}, median {generation['median']:.4g}")
    if now["state"] == "interrupted":
        task = f" --task {now['task']}" if names_code(now["task"]) else ""
        lines.append(f"continue: evolve resume {now['directory']}{task}")
    return lines
