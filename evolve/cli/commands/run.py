"""`evolve run` and `evolve resume`."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

from evolve.analysis.episode_failures import episode_failure_lines, episode_failures_of
from evolve.analysis.fitness_parts import fitness_text
from evolve.cli.commands import INTERRUPTED
from evolve.cli.commands.products import REPORT, Products, finished_products, open_page
from evolve.cli.run_plan import RunPlan, steps_each
from evolve.cli.tensorboard import TensorBoardWriter, require_tensorboard
from evolve.config.lint import lint
from evolve.config.run_config import ConfigError, RunConfig
from evolve.genome.phenotype import repaired
from evolve.runs.begin import RunRequest, prepare_run
from evolve.runs.carry_on import Workers, carry_on, local_workers
from evolve.runs.output import results, say
from evolve.runs.progress import Bar, Events, Lines, Silent, Tally, Watchers, watcher
from evolve.runs.resume import resuming
from evolve.search.dask_executor import DaskExecutor
from evolve.search.scheduler import Scheduler
from evolve.store.candidate import Candidate
from evolve.store.checksums import harmed
from evolve.store.directory import EXR, Run

__all__ = ["resume", "start"]


def start(arguments: Namespace) -> int:
    """Start a run and continue it to its end. With --dry-run, only print its plan."""
    if arguments.dry_run:
        _refuse_without_run(arguments)
    scheduler = _scheduler(arguments)
    if arguments.tensorboard:
        require_tensorboard()
    prepared = prepare_run(_request(arguments), tried=not arguments.dry_run)
    if arguments.dry_run:
        return _show(RunPlan.from_config(prepared.config, prepared.directory(arguments.out)), arguments.json)
    # `lint` may build the task's world, which takes time, so it is called before the run directory is created.
    notes = [] if arguments.json or arguments.quiet else lint(prepared.config)
    with prepared.create(Run, arguments.out) as run:
        if not arguments.json:
            for note in notes:
                _note(note)
            say(f"{run.path}: {_plan(run.config)}", flush=True)
        return _carry_on(run, arguments, scheduler)


def resume(arguments: Namespace) -> int:
    """Continue an interrupted run to its end; for a finished run, write missing files of its results."""
    scheduler = _scheduler(arguments)
    if arguments.tensorboard:
        require_tensorboard()
    run = Run.open(arguments.directory, arguments.task, arguments.before_damage)
    with resuming(run, _silence if arguments.quiet else _note) as unfinished:
        if not arguments.json:
            state = f"{len(run.candidates)} of {run.config.candidates} candidates are on record"
            done = f"all {run.config.candidates} candidates have been evaluated"
            say(f"{run.path}: {state if unfinished else done}", flush=True)
        return _carry_on(run, arguments, scheduler) if unfinished else _already_finished(run, arguments)


def _refuse_without_run(arguments: Namespace) -> None:
    """Refuse options that have no effect with `--dry-run`, because no run starts.

    Raises:
        ConfigError: such an option was given.
    """
    for name in ("open", "tensorboard", "quiet", "scheduler"):
        if getattr(arguments, name):
            raise ConfigError(f"--{name}: must be left out with --dry-run, which prints the plan for this machine only")


def _request(arguments: Namespace) -> RunRequest:
    """Return the choices on the command line from which the settings of a new run are assembled."""
    flags = [f"{name}={value}" for name in ("seed", "workers") if (value := getattr(arguments, name)) is not None]
    return RunRequest(
        arguments.task,
        arguments.preset,
        arguments.config,
        [*arguments.set, *flags],
        arguments.scale,
        arguments.start_from,
    )


def _note(text: str) -> None:
    print(f"note: {text}", file=sys.stderr)


def _silence(text: str) -> None:
    """Ignore a note."""


def _show(plan: RunPlan, as_json: bool) -> int:
    """Measure how fast this machine trains, and print the plan of a run with the predicted time.

    The run is not started.
    """
    if not as_json:
        print("measuring this machine's pace ...", file=sys.stderr, flush=True)
    plan = plan.measured()
    say(json.dumps(plan.record(), indent=1) if as_json else "\n".join(plan.lines()))
    return 0


class _Shown:
    """Watchers: objects that the search informs about the progress of a run.

    One watcher shows the progress in the form that the arguments select. If the arguments request it, another one
    writes files for TensorBoard.
    """

    def __init__(self, arguments: Namespace) -> None:
        self._arguments = arguments
        self.tally: Tally | None = None

    @contextmanager
    def watched(self, run: Run, workers: int) -> Iterator[Watchers]:
        with (
            _watcher(run, workers, self._arguments) as shown,
            TensorBoardWriter(run) if self._arguments.tensorboard else nullcontext() as tensorboard,
        ):
            self.tally = shown.tally
            yield Watchers([shown, *([tensorboard] if tensorboard else [])])


def _carry_on(run: Run, arguments: Namespace, scheduler: Scheduler | None) -> int:
    """Continue a run, whose lock this process holds, to its end.

    After Ctrl-C, print how to continue. No file needs to be written then, because the record is always complete.
    """
    shown = _Shown(arguments)
    try:
        carry_on(run, shown.watched, _workers(scheduler, _silence if arguments.quiet else _note))
    except KeyboardInterrupt:
        own = f" --task {arguments.task}" if run.config.code is not None else ""
        print(
            f"\nevolve: interrupted; {len(run.candidates)} of {run.config.candidates} candidates are on record. "
            f"Continue with: evolve resume {run.path}{own}",
            file=sys.stderr,
        )
        return INTERRUPTED
    if shown.tally is not None and not arguments.json:
        say(shown.tally.closing())
    return _finish(run, arguments)


def _already_finished(run: Run, arguments: Namespace) -> int:
    """Write the report and EXR files of a finished run if they are missing, or if EXR files are damaged.

    They are missing, for example, if the run was killed after its last evaluation.
    """
    page, frames = run.path / REPORT, sorted((run.path / EXR).glob("*.exr"))
    if not page.is_file() or not frames or harmed(run.path / EXR):
        return _finish(run, arguments)
    if not arguments.json:
        say(f"nothing is left to do; report: {page}")
    elif run.best is not None:
        say(json.dumps(_finished_event(run, run.best, Products(page, frames))))
    open_page(page, arguments)
    return 0


def _watcher(run: Run, workers: int, arguments: Namespace) -> Bar | Events | Lines | Silent:
    if arguments.quiet:
        return Silent(run, sys.stderr, workers)
    return watcher(run, results() if arguments.json else sys.stderr, workers, arguments.json)


def _workers(
    scheduler: Scheduler | None, note: Callable[[str], None]
) -> Callable[[RunConfig], AbstractContextManager[Workers]]:
    """Return a function that starts the workers: Dask's if there is a scheduler, else local processes."""
    return local_workers if scheduler is None else lambda config: DaskExecutor(scheduler, note=note)


def _scheduler(arguments: Namespace) -> Scheduler | None:
    """Return the Dask scheduler after a check that it answers; None if the workers are local processes.

    Raises:
        ConfigError: options contradict each other, the address is malformed, or certificates are missing or invalid.
        ExecutorError: the scheduler does not answer, or Dask is not installed.
    """
    files = arguments.tls_ca_file, arguments.tls_cert, arguments.tls_key
    wanted = arguments.scheduler is not None
    if (arguments.executor == "dask") != wanted or (any(files) and not wanted):
        raise ConfigError("--executor dask needs --scheduler ADDRESS, and no other executor takes one")
    if not wanted:
        return None
    if getattr(arguments, "workers", None) is not None:
        raise ConfigError("--workers: is for this machine's processes; with Dask, all available workers take part")
    scheduler = Scheduler(arguments.scheduler, *files)
    scheduler.require_answer()
    return scheduler


def _finish(run: Run, arguments: Namespace) -> int:
    """Write the report and the EXR files, print their paths and return 0.

    If every candidate failed, only print the last failure, and return 1.
    """
    failures = [candidate for candidate in run.candidates if candidate.failure]
    if run.best is None:
        print(f"evolve: every candidate failed; the last failure: {failures[-1].failure}", file=sys.stderr)
        return 1
    if not arguments.json:
        say("\n".join(_outcome(run, run.best, failures)))
        say("writing report and EXR files ...", flush=True)
    made = finished_products(run, shown=not (arguments.json or arguments.quiet))
    say(json.dumps(_finished_event(run, run.best, made)) if arguments.json else "\n".join(made.lines(run)))
    open_page(made.report, arguments)
    return 0


def _finished_event(run: Run, best: Candidate, made: Products) -> dict[str, Any]:
    parts = {"fitness": best.fitness, "task_fitness": best.task_fitness, "costs": best.costs}
    return {"event": "finished", "best": best.id, **parts, **made.record(run)}


def _outcome(run: Run, best: Candidate, failures: list[Candidate]) -> list[str]:
    """Return lines about the best candidate, failed candidates, failed episodes and repaired genomes.

    A genome is repaired if eyes or receptors would overlap: genes are changed until they do not.
    """
    fitness = fitness_text(best.fitness, best.costs)
    lines = [f"best: candidate {best.id}, fitness {fitness}, success rate {best.success_rate:.0%}"]
    if failures:
        lines.append(
            f"failed: {len(failures)} of {len(run.candidates)} candidates; the last failure: {failures[-1].failure}"
        )
    lines += episode_failure_lines(episode_failures_of(run.candidates))
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
        f"{f' in up to {search.rungs} rungs' if search.rungs > 1 else ''}, "
        f"{genes} genes open"
    )
