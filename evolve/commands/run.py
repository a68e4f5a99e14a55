"""`evolve run` and `evolve resume`."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

from evolve.commands import INTERRUPTED
from evolve.config import RunConfig
from evolve.config_source import assemble
from evolve.executors import LocalExecutor
from evolve.loop import evolve
from evolve.progress import watcher
from evolve.store import Run, next_directory
from evolve.versions import present, record_start, recorded
from evolve.worker import evaluate_candidate, prepare_device
from optics import backend

__all__ = ["resume", "start"]


def start(arguments: Namespace) -> int:
    """Begin a run and carry it to its end."""
    flags = [f"{name}={value}" for name in ("seed", "workers") if (value := getattr(arguments, name)) is not None]
    config = assemble(arguments.task, arguments.preset, arguments.config, [*arguments.set, *flags])
    backend.require()
    run = Run.create(arguments.out or next_directory(config.task, arguments.preset), config)
    print(f"{run.path}: {_plan(config)}", flush=True)
    with run.lock():
        return _carry(run)


def resume(arguments: Namespace) -> int:
    """Carry an interrupted run to its end."""
    run = Run.open(arguments.directory)
    backend.require()
    with run.lock():
        run.repair()
        if run.notice:
            print(f"note: {run.notice}", file=sys.stderr)
        if run.finished:
            print(f"{run.path}: all {run.config.candidates} candidates have been evaluated")
            return _finish(run)
        _note_changes(run.path)
        record_start(run.path, len(run.candidates))
        print(f"{run.path}: {len(run.candidates)} of {run.config.candidates} candidates are on record", flush=True)
        return _carry(run)


def _carry(run: Run) -> int:
    """Carry a run whose lock is held to its end; on Ctrl-C say how to go on. Nothing needs saving: it is on record."""
    try:
        with LocalExecutor(evaluate_candidate, run.config.workers, prepare_device) as executor, watcher(run) as watch:
            evolve(run, executor, watch)
    except KeyboardInterrupt:
        print(
            f"\nevolve: interrupted; {len(run.candidates)} of {run.config.candidates} candidates are on record. "
            f"Continue with: evolve resume {run.path}",
            file=sys.stderr,
        )
        return INTERRUPTED
    return _finish(run)


def _finish(run: Run) -> int:
    """Write report and EXR files, and name them; 1 if no candidate could be evaluated."""
    failures = [candidate for candidate in run.candidates if candidate.failure]
    if run.best is None:
        print(f"evolve: every candidate failed; the last: {failures[-1].failure}", file=sys.stderr)
        return 1
    print(f"best: candidate {run.best.id}, fitness {run.best.fitness:.4g}, success rate {run.best.success_rate:.0%}")
    if failures:
        print(f"failed: {len(failures)} of {len(run.candidates)} candidates; the last: {failures[-1].failure}")
    print("writing report and EXR files ...", flush=True)
    from evolve import episode, export, report

    best = episode.record(run)
    page, frames = report.write(run, best), export.export_episode(best, run.path / "exr")
    print(f"run directory: {run.path}")
    print(f"report: {page}")
    print(f"EXR files: {len(frames)} in {frames[0].parent}, the first: {frames[0].name}")
    return 0


def _plan(config: RunConfig) -> str:
    search, steps = config.search, config.learning.total_steps
    genes = sum(use.open for use in config.genome.values())
    return (
        f"{config.task}, {search.generations} generations x {search.population} candidates x {steps:,} steps, "
        f"{genes} genes open"
    )


def _note_changes(path: Path) -> None:
    """Say which software differs from when the run began; numbers may differ with it."""
    then, now = recorded(path), present()
    changed = [f"{name} {now[name]} (was {then[name]})" for name in now if name in then and then[name] != now[name]]
    if changed:
        print(f"note: other software than when the run began: {', '.join(changed)}", file=sys.stderr)
