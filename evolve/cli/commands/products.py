"""`evolve replay`, `report` and `export`: what can be made from a run."""

from __future__ import annotations

from argparse import Namespace

from evolve.store.directory import Run
from optics.numerics import backend

__all__ = ["export", "replay", "report"]


def replay(arguments: Namespace) -> int:
    """Let an agent play one episode again: a table here, and a page that plays it."""
    run = _open(arguments)
    from evolve.report.replay import write_replay

    for path in write_replay(run, arguments.candidate, arguments.seed, arguments.rrd):
        print(f"replay: {path}")
    return 0


def report(arguments: Namespace) -> int:
    """Write the report."""
    run = _open(arguments)
    from evolve.report.write import write

    print(f"report: {write(run)}")
    return 0


def export(arguments: Namespace) -> int:
    """Write what an agent saw, one EXR file per frame."""
    run = _open(arguments)
    from evolve.report.exr_export import export_run

    files = export_run(run, arguments.candidate, arguments.seed)
    print(f"EXR files: {len(files)} in {files[0].parent}, the first: {files[0].name}")
    return 0


def _open(arguments: Namespace) -> Run:
    """The run, on a machine that can see."""
    run = Run.open(arguments.directory)
    backend.require()
    return run
