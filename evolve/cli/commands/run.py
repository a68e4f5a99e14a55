"""`evolve run` and `evolve resume`."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from contextlib import nullcontext
from typing import Any

from evolve.analysis.mishaps import mishaps_of, mishaps_told
from evolve.cli.commands import INTERRUPTED
from evolve.cli.commands.products import REPORT, Products, finished_products, open_page
from evolve.cli.progress import Bar, Events, Lines, Silent, Watchers, watcher
from evolve.cli.run_plan import RunPlan, steps_each
from evolve.cli.start_from import starts_from
from evolve.cli.tensorboard import TensorBoardWriter, require_tensorboard
from evolve.config.assemble import assemble
from evolve.config.lint import lint
from evolve.config.run_config import ConfigError, RunConfig
from evolve.genome.phenotype import repaired
from evolve.search.dask_executor import DaskExecutor
from evolve.search.local_executor import LocalExecutor
from evolve.search.loop import evolve
from evolve.search.scheduler import Scheduler
from evolve.search.search import Search
from evolve.search.successive_halving import finished
from evolve.search.worker import evaluate_candidate, prepare_device
from evolve.store.candidate import Candidate
from evolve.store.directory import Run, next_directory
from evolve.store.versions import altered, present, record_start, recorded
from optics.numerics import device

__all__ = ["resume", "start"]


def start(arguments: Namespace) -> int:
    """Begin a run and carry it to its end."""
    scheduler = _scheduler(arguments)
    if arguments.tensorboard:
        require_tensorboard()
    flags = [f"{name}={value}" for name in ("seed", "workers") if (value := getattr(arguments, name)) is not None]
    starts = starts_from(arguments.start_from) if arguments.start_from else None
    config = assemble(
        arguments.task, arguments.preset, arguments.config, [*arguments.set, *flags], starts, arguments.scale
    )
    Search(config)  # an unknown optimizer, say, is refused before anything is written
    device.make_ready()
    if config.own_task is not None:
        _try(config)
    preset = arguments.preset.removesuffix(f"-{config.task}")
    if arguments.dry_run:
        directory = arguments.out or next_directory(config.task_name, preset)
        return _show(RunPlan.of(config, directory), arguments.json)
    notes = (
        [] if arguments.json or arguments.quiet else lint(config)
    )  # looks at the world, which takes its time: nothing is begun yet
    origin = starts.name.removeprefix("--from ") if starts else None
    run = Run.create(arguments.out, config, origin) if arguments.out else Run.create_next(config, preset, origin)
    if not arguments.json:
        for note in notes:
            print(f"note: {note}", file=sys.stderr)
        print(f"{run.path}: {_plan(config)}", flush=True)
    with run.lock():
        return _carry(run, arguments, scheduler)


def resume(arguments: Namespace) -> int:
    """Carry an interrupted run to its end."""
    scheduler = _scheduler(arguments)
    if arguments.tensorboard:
        require_tensorboard()
    run = Run.open(arguments.directory, arguments.task)
    device.make_ready()
    with run.lock():
        run.repair()
        if run.notice and not arguments.quiet:
            print(f"note: {run.notice}", file=sys.stderr)
        if finished(run):
            run.forget_trainings(candidate.id for candidate in run.candidates)
            if not arguments.json:
                print(f"{run.path}: all {run.config.candidates} candidates have been evaluated")
            return _already_finished(run, arguments)
        run.require_present_format()
        if run.config.own_task is not None:
            _try(run.config)
        if not arguments.quiet:
            _note_changes(run)
        record_start(run.path, len(run.candidates))
        if not arguments.json:
            print(
                f"{run.path}: {len(run.candidates)} of {run.config.candidates} candidates are on record",
                flush=True,
            )
        return _carry(run, arguments, scheduler)


def _try(config: RunConfig) -> None:
    """A task of one's own, before anything is written."""
    from evolve.learning.task_trial import try_task

    try_task(config)


def _show(plan: RunPlan, as_json: bool) -> int:
    """The plan, with what this machine makes of it; nothing is begun."""
    if not as_json:
        print("measuring this machine's pace ...", file=sys.stderr, flush=True)
    plan = plan.measured()
    print(json.dumps(plan.record(), indent=1) if as_json else "\n".join(plan.lines()))
    return 0


def _carry(run: Run, arguments: Namespace, scheduler: Scheduler | None) -> int:
    """Carry a run whose lock is held to its end; on Ctrl-C say how to go on. Nothing needs saving: it is on record."""
    try:
        with (
            _executor(run, scheduler) as executor,
            _watcher(run, executor.count, arguments) as watch,
            TensorBoardWriter(run) if arguments.tensorboard else nullcontext() as tensorboard,
        ):
            evolve(run, executor, Watchers([watch, *([tensorboard] if tensorboard else [])]))
    except KeyboardInterrupt:
        own = f" --task {arguments.task}" if run.config.own is not None else ""
        print(
            f"\nevolve: interrupted; {len(run.candidates)} of {run.config.candidates} candidates are on record. "
            f"Continue with: evolve resume {run.path}{own}",
            file=sys.stderr,
        )
        return INTERRUPTED
    if not arguments.json:
        print(watch.tally.closing())
    return _finish(run, arguments)


def _already_finished(run: Run, arguments: Namespace) -> int:
    """What a run that was killed at its very end still lacks; nothing where all is there."""
    page, frames = run.path / REPORT, sorted((run.path / "exr").glob("*.exr"))
    if not page.is_file() or not frames:
        return _finish(run, arguments)
    if not arguments.json:
        print(f"nothing is left to do; report: {page}")
    elif run.best is not None:
        print(json.dumps(_finished_event(run, run.best, Products(page, frames))))
    open_page(page, arguments)
    return 0


def _watcher(run: Run, workers: int, arguments: Namespace) -> Bar | Events | Lines | Silent:
    if arguments.quiet:
        return Silent(run, sys.stderr, workers)
    return watcher(run, sys.stdout if arguments.json else sys.stderr, workers, arguments.json)


def _executor(run: Run, scheduler: Scheduler | None) -> DaskExecutor | LocalExecutor:
    if scheduler is not None:
        return DaskExecutor(scheduler)
    return LocalExecutor(evaluate_candidate, run.config.workers, prepare_device)


def _scheduler(arguments: Namespace) -> Scheduler | None:
    """Only Dask has one, and needs one: it must be there before anything is begun."""
    files = arguments.tls_ca_file, arguments.tls_cert, arguments.tls_key
    wanted = arguments.scheduler is not None
    if (arguments.executor == "dask") != wanted or (any(files) and not wanted):
        raise ConfigError("--executor dask needs --scheduler ADDRESS, and no other executor takes one")
    if not wanted:
        return None
    if getattr(arguments, "workers", None) is not None:
        raise ConfigError("--workers: is for this machine's processes; of Dask's workers all take part that are there")
    scheduler = Scheduler(arguments.scheduler, *files)
    if not getattr(arguments, "dry_run", False):
        scheduler.require_answer()
    return scheduler


def _finish(run: Run, arguments: Namespace) -> int:
    """Write report and EXR files, and name them; 1 if no candidate could be evaluated."""
    failures = [candidate for candidate in run.candidates if candidate.failure]
    if run.best is None:
        print(f"evolve: every candidate failed; the last one: {failures[-1].failure}", file=sys.stderr)
        return 1
    if not arguments.json:
        print("\n".join(_outcome(run, run.best, failures)))
        print("writing report and EXR files ...", flush=True)
    made = finished_products(run, shown=not (arguments.json or arguments.quiet))
    print(json.dumps(_finished_event(run, run.best, made)) if arguments.json else "\n".join(made.lines(run)))
    open_page(made.report, arguments)
    return 0


def _finished_event(run: Run, best: Candidate, made: Products) -> dict[str, Any]:
    return {"event": "finished", "best": best.id, "fitness": best.fitness, **made.record(run)}


def _outcome(run: Run, best: Candidate, failures: list[Candidate]) -> list[str]:
    """The best candidate, how many failed, what failed in episodes, and how many genomes did not fit together as they
    were."""
    lines = [f"best: candidate {best.id}, fitness {best.fitness:.4g}, success rate {best.success_rate:.0%}"]
    if failures:
        lines.append(
            f"failed: {len(failures)} of {len(run.candidates)} candidates; the last one: {failures[-1].failure}"
        )
    lines += mishaps_told(mishaps_of(run.candidates))
    changed = [names for candidate in run.candidates if (names := repaired(candidate.vector, run.config))]
    if changed:
        genes = ", ".join(sorted({name for names in changed for name in names}))
        lines.append(
            f"repaired, because parts would overlap: {len(changed)} of {len(run.candidates)} candidates ({genes})"
        )
    return lines


def _plan(config: RunConfig) -> str:
    search = config.search
    genes = sum(use.open for use in config.genome.values())
    return (
        f"{config.task}, {search.generations} generations x {search.population} candidates x {steps_each(config)} steps"
        f"{f' in up to {search.rungs} budget stages' if search.rungs > 1 else ''}, "
        f"{genes} genes open"
    )


def _note_changes(run: Run) -> None:
    """Say which software differs from when the run began, and whether settings do; numbers may differ with them."""
    if altered(run.path):
        print(
            f"note: config.toml has changed since the last start. Candidates from {len(run.candidates)} on are "
            "trained and evaluated with other settings than those before",
            file=sys.stderr,
        )
    then, now = recorded(run.path), present()
    changed = [f"{name} {now[name]} (was {then[name]})" for name in now if name in then and then[name] != now[name]]
    if changed:
        print(f"note: the software has changed since this run began: {', '.join(changed)}", file=sys.stderr)
