"""Comparison of runs: their results, training steps and time, and the settings in which they differ."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from evolve.analysis.acuity import acuity_cpd, acuity_vertical_cpd
from evolve.analysis.fitness_parts import fitness_interval
from evolve.analysis.statistics import generation_statistics
from evolve.report.figures import comparison_figure
from evolve.report.markup import document, duration, figure, html, section, table
from evolve.store.atomic_files import write_whole
from evolve.store.directory import Run

__all__ = ["comparison_lines", "differing_settings", "run_summary", "write_page"]

PARTS = ("task fitness", "costs")
UPWARDS = "vertical acuity [cpd]"
OF_THE_BEST = ("best candidate", "fitness", *PARTS, "95 % interval", "success rate", "acuity [cpd]", UPWARDS)


def run_summary(run: Run) -> dict[str, Any]:
    """Return the summary of one run as JSON values.

    Before a candidate has succeeded, values that describe the best candidate are None. The interval of the fitness is
    also None if the best candidate has played a single evaluation episode.
    """
    best = run.best
    interval = None if best is None else fitness_interval(best)
    return {
        "run": str(run.path),
        "task": run.config.task,
        "evaluated": len(run.candidates),
        "planned": run.config.candidates,
        "failed": sum(candidate.failure is not None for candidate in run.candidates),
        "best": None if best is None else best.id,
        "generation": None if best is None else best.generation,
        "fitness": None if best is None else best.fitness,
        "task_fitness": None if best is None else best.task_fitness,
        "costs": None if best is None else best.costs,
        "fitness_interval": None if interval is None or math.isnan(interval[0]) else interval,
        "success_rate": None if best is None else best.success_rate,
        "acuity_cpd": None if best is None else acuity_cpd(best.phenotype),
        "acuity_vertical_cpd": None if best is None else acuity_vertical_cpd(best.phenotype),
        "steps": sum(candidate.steps for candidate in run.candidates),
        "hours": sum(candidate.seconds for candidate in run.candidates) / 3600,
        "best_so_far": [
            None if math.isnan(row.best_so_far) else row.best_so_far for row in generation_statistics(run.candidates)
        ],
    }


def differing_settings(runs: Sequence[Run]) -> dict[str, list[Any]]:
    """Return the settings in which the runs differ, by dotted name, with the value in each run.

    If a run lacks a setting, its value is None.
    """
    flat = [dict(_flat(asdict(run.config))) for run in runs]
    names = list(dict.fromkeys(name for settings in flat for name in settings))
    values = {name: [settings.get(name) for settings in flat] for name in names}
    return {name: row for name, row in values.items() if any(value != row[0] for value in row)}


def comparison_lines(runs: Sequence[Run]) -> list[str]:
    """Return the comparison as a table for a terminal: quantities and differing settings as rows, runs as columns."""
    rows = [(name, *values) for name, values in _rows(runs).items()]
    settings = [(name, *(_shown(value) for value in row)) for name, row in differing_settings(runs).items()]
    rows += [("settings that differ", *("" for _ in runs)), *settings] if settings else []
    widths = [max(len(row[place]) for row in rows) for place in range(len(runs) + 1)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def write_page(runs: Sequence[Run], path: Path) -> None:
    """Write an HTML page that compares runs: a figure of the best fitness over the generations, and a table.

    The file is written completely or not at all.

    Raises:
        OSError: the file cannot be written.
    """
    columns = _rows(runs)
    names = columns.pop("run")
    rows = [[name, *values] for name, values in columns.items()]
    rows += [[name, *(_shown(v) for v in row)] for name, row in differing_settings(runs).items()]
    curves = {str(run.path): generation_statistics(run.candidates) for run in runs}
    caption = html("<b>Best fitness so far</b> over the generations, one line for each run.")
    drawn = figure(comparison_figure({name: rows for name, rows in curves.items() if rows}), caption)
    found = table(["", *names], rows, "comparison")
    body = html("<header><h1>{} runs</h1></header>\n", len(runs)) + section(
        "runs", "Side by side", html('<div class="wide">{}</div>\n{}', drawn, found)
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, document("runs side by side", body))


def _rows(runs: Sequence[Run]) -> dict[str, list[str]]:
    """Return the rows of the table by name: for each quantity, its value in each run as text.

    If no run has costs, the rows of task fitness and costs are omitted, because the fitness equals the task fitness. If
    vertical and horizontal acuity are equal in all runs, the vertical one is omitted.
    """
    columns = [_column(run_summary(run)) for run in runs]
    rows = {name: [column[name] for column in columns] for name in columns[0]}
    if all(run.config.costs.free for run in runs):
        rows = {name: values for name, values in rows.items() if name not in PARTS}
    if rows[UPWARDS] == rows["acuity [cpd]"]:
        del rows[UPWARDS]
    return rows


def _column(one: Mapping[str, Any]) -> dict[str, str]:
    """Return the column of a run in the table that compares runs: name of each row, and its value as text.

    one: the run's summary; see `run_summary`
    """
    column = {
        "run": one["run"],
        "task": one["task"],
        "evaluated": f"{one['evaluated']} of {one['planned']}" + (f", {one['failed']} failed" * bool(one["failed"])),
        "steps trained": f"{one['steps']:,}",
        "time, all workers": duration(3600 * one["hours"]),
    }
    if one["best"] is None:
        return column | dict.fromkeys(OF_THE_BEST, "-")
    interval = one["fitness_interval"]
    values = (
        f"{one['best']}, generation {one['generation']}",
        *(f"{one[name]:.4g}" for name in ("fitness", "task_fitness", "costs")),
        "-" if interval is None else f"{interval[0]:.4g} to {interval[1]:.4g}",
        f"{one['success_rate']:.0%}",
        *(f"{one[name]:.3g}" for name in ("acuity_cpd", "acuity_vertical_cpd")),
    )
    return column | dict(zip(OF_THE_BEST, values, strict=True))


def _flat(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _shown(value: Any) -> str:
    """Return a value as text, in the form in which `--set` accepts it; "-" for a missing value."""
    if isinstance(value, bool):
        return str(value).lower()
    return "-" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
