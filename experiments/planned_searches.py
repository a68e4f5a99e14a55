"""Searches of a plan: each one is started, or continued after an interruption, until all are complete."""

from __future__ import annotations

import shutil
import tempfile
import tomllib
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from evolve.cli.main import main as evolve
from evolve.config.assemble import assemble, to_toml
from evolve.config.run_config import RunConfig
from evolve.search.successive_halving import finished
from evolve.store.directory import Run

__all__ = ["PlannedSearch", "command", "finished_run", "main"]


@dataclass(frozen=True)
class PlannedSearch:
    """A search of a plan.

    name: name of the run directory
    assignments: settings that differ from the preset's, "section.name=value"
    """

    name: str
    task: str
    preset: str
    assignments: tuple[str, ...]

    @property
    def config(self) -> RunConfig:
        """Settings of the run."""
        return assemble(self.task, self.preset, assignments=self.assignments)


def command(search: PlannedSearch, folder: Path, workers: int) -> list[str]:
    """Return the arguments of `evolve` that start a search, or continue it if its run directory exists."""
    out = folder / search.name
    if out.exists():
        return ["resume", str(out)]
    settings = (*search.assignments, f"workers={workers}")
    pairs = (part for text in settings for part in ("--set", text))
    return ["run", search.task, "--preset", search.preset, *pairs, "--out", str(out)]


def finished_run(folder: Path, search: PlannedSearch) -> Run | None:
    """Return the record of a finished search; None if it is missing or unfinished.

    folder: directory of the runs

    Raises:
        ValueError: the record has other settings than the plan.
        RunError: the record is damaged.
    """
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


def _copy_record(record: Path, out: Path) -> None:
    """Copy a record to the directory of a run, completely or not at all, if there is a record and no run."""
    if record.exists() and not out.exists():
        out.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=out.parent) as folder:
            shutil.copytree(record, Path(folder) / out.name).rename(out)


def main(text: str, searches: Sequence[PlannedSearch], arguments: Sequence[str] | None = None) -> int:
    """List the searches, or carry them out one after another.

    text: docstring of the program, for `--help`
    """
    lines = text.split("\n")
    options = ArgumentParser(
        description=lines[0], epilog="\n".join(lines[2:]), formatter_class=RawDescriptionHelpFormatter
    )
    options.add_argument("folder", metavar="DIR", type=Path, nargs="?", help="directory of the runs")
    options.add_argument("--list", action="store_true", help="print the commands that start the searches, then stop")
    options.add_argument("--workers", type=int, default=1, help="processes of a new run (default: 1)")
    options.add_argument(
        "--records", type=Path, metavar="DIR", help="continue the records in DIR whose runs are missing, as copies"
    )
    chosen = options.parse_args(arguments)
    if chosen.list:
        for one in searches:
            print("evolve", *command(one, Path("runs"), chosen.workers))
        return 0
    if chosen.folder is None:
        options.error("DIR: missing; name the directory of the runs, or use --list")
    for one in searches:
        if chosen.records is not None:
            _copy_record(chosen.records / one.name, chosen.folder / one.name)
        code = evolve(command(one, chosen.folder, chosen.workers))
        if code:
            return code
    return 0
