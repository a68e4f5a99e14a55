"""Stored numbers of experiments: rows in CSV files, and their origin."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from evolve.store.atomic_files import write_whole
from evolve.store.versions import machine, machines, present, recorded

__all__ = ["DATA", "RECORDS", "Origin", "read_answer", "read_rows", "rounded", "write_answer", "write_rows"]

DATA = Path("docs/results/data")
RECORDS = Path(__file__).parent / "records"  # settings of runs, and a line per candidate
UNKNOWN = {"commit": "unknown", "python": "unknown"}  # versions of a run without versions.json
Row = TypeVar("Row")


def read_rows(kind: type[Row], path: Path) -> list[Row]:
    """Return the rows of a CSV file as instances of a dataclass with fields of type str, int or float.

    The result is [] if the file does not exist.
    """
    if not path.exists():
        return []
    types = get_type_hints(kind)
    with path.open(encoding="utf-8", newline="") as file:
        return [kind(**{name: types[name](text) for name, text in line.items()}) for line in csv.DictReader(file)]


def read_answer(stem: Path, otherwise: str = "(not written yet)") -> str:
    """Return the stored answer on a page; `otherwise` if there is none.

    stem: path of the page's data without an ending
    """
    path = stem.with_suffix(".txt")
    return (path.read_text(encoding="utf-8").strip() if path.exists() else "") or otherwise


def write_answer(stem: Path, answer: str) -> None:
    """Store the answer on a page, in Markdown; see `read_answer`."""
    write_whole(stem.with_suffix(".txt"), f"{answer}\n".encode())


def rounded(value: float) -> float:
    """Return a number as `write_rows` stores it, with six significant digits."""
    return float(f"{value:.6g}")


def write_rows(rows: Iterable[Any], path: Path) -> None:
    """Write a CSV file, completely or not at all, with six significant digits.

    Raises:
        ValueError: the rows are empty.
    """
    lines = [asdict(row) for row in rows]
    if not lines:
        raise ValueError(f"{path}: cannot write an empty table")
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(lines[0])
    table.writerows([f"{v:.6g}" if isinstance(v, float) else v for v in line.values()] for line in lines)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, text.getvalue().encode())


@dataclass(frozen=True)
class Origin:
    """Origin of stored numbers.

    hours: processor time in core hours, or wall time in worker hours
    machine: processor and number of cores
    versions: versions of the software that influences the numbers
    whose: "core" or "worker", the unit of `hours`
    earlier: other commits, with which some of the rows were computed
    """

    hours: float
    machine: str
    versions: Mapping[str, str]
    whose: str = "core"
    earlier: tuple[str, ...] = ()

    @classmethod
    def here(cls, hours: float, whose: str = "core") -> Origin:
        """Return the origin of numbers that this process computes."""
        return cls(hours, machine(), present(), whose)

    @classmethod
    def from_runs(cls, runs: Sequence[Path], hours: float) -> Origin:
        """Return the origin of the records of runs: their machines, and the versions at the start of the first run.

        hours: wall time in worker hours
        """
        on = dict.fromkeys(name for run in runs for name in machines(run))
        return cls(hours, "; ".join(on) or "an unknown machine", recorded(runs[0]) or UNKNOWN, "worker")

    @classmethod
    def read(cls, path: Path) -> Origin:
        """Read an origin that `write` has stored."""
        found = json.loads(path.read_text(encoding="utf-8"))
        return cls(**{**found, "earlier": tuple(found.get("earlier", ()))})

    def after(self, path: Path) -> Origin:
        """Return this origin, with the commits of the origin that a file contains added to `earlier`."""
        if not path.exists():
            return self
        former = Origin.read(path)
        commits = dict.fromkeys([*former.earlier, former.versions["commit"], self.versions["commit"]])
        return replace(self, earlier=tuple(commit for commit in commits if commit != self.versions["commit"]))

    def write(self, path: Path) -> None:
        """Write the origin as JSON, completely or not at all."""
        write_whole(path, (json.dumps(asdict(self), indent=1) + "\n").encode())

    def sentence(self) -> str:
        """Return hours, machine and versions as a sentence for the end of a page."""
        names = {"rhabdom", "commit", "machine", "python"}
        packages = ", ".join(f"{name} {self.versions[name]}" for name in self.versions if name not in names)
        units = ((1, "hours"), (1 / 60, "minutes"), (0, "seconds"))
        least, unit = next((least, unit) for least, unit in units if self.hours >= least)
        took = f"{self.hours / (least or 1 / 3600):.2g} {self.whose} {unit}"
        commits = ", ".join(_short(commit) for commit in (*self.earlier, self.versions["commit"]))
        python = self.versions["python"]
        software = ", ".join(filter(None, (f"rhabdom at commit {commits}", f"Python {python}", packages)))
        return f"{took} on {self.machine}; {software}."


def _short(commit: str) -> str:
    return f"{commit[:10]} with changes" if commit.endswith("+") else commit[:10]
