"""Numbers of experiments, stored beside their pages: rows of plain CSV, and with what they were made."""

from __future__ import annotations

import csv
import io
import json
import os
import platform
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from evolve.store.atomic_files import write_whole
from evolve.store.versions import present

__all__ = ["DATA", "RECORDS", "Origin", "read_rows", "write_rows"]

DATA = Path("docs/results/data")
RECORDS = Path(__file__).parent / "records"  # of runs: their settings, and a line per candidate
Row = TypeVar("Row")


def read_rows(kind: type[Row], path: Path) -> list[Row]:
    """Rows of a CSV file as instances of a dataclass whose fields are str, int or float; [] if there is no file."""
    if not path.exists():
        return []
    types = get_type_hints(kind)
    with path.open(encoding="utf-8", newline="") as file:
        return [kind(**{name: types[name](text) for name, text in line.items()}) for line in csv.DictReader(file)]


def write_rows(rows: Iterable[Any], path: Path) -> None:
    """The file anew, whole or not at all; numbers are written with six digits. Raises ValueError without rows."""
    lines = [asdict(row) for row in rows]
    if not lines:
        raise ValueError(f"{path}: there are no rows to write")
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(lines[0])
    table.writerows([f"{v:.6g}" if isinstance(v, float) else v for v in line.values()] for line in lines)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, text.getvalue().encode())


@dataclass(frozen=True)
class Origin:
    """How stored numbers were made.

    hours     of one core's time, or of one worker's by the clock
    machine   processor and cores
    versions  of what decides the numbers
    whose     "core" or "worker"
    earlier   commits that made other rows before
    """

    hours: float
    machine: str
    versions: Mapping[str, str]
    whose: str = "core"
    earlier: tuple[str, ...] = ()

    @classmethod
    def here(cls, hours: float, whose: str = "core") -> Origin:
        """Made by this process."""
        return cls(hours, f"{_processor()}, {os.cpu_count()} cores", present(), whose)

    @classmethod
    def read(cls, path: Path) -> Origin:
        """As `write` left it."""
        found = json.loads(path.read_text(encoding="utf-8"))
        return cls(**{**found, "earlier": tuple(found.get("earlier", ()))})

    def after(self, path: Path) -> Origin:
        """The same, with the commits of what the file says was made before."""
        if not path.exists():
            return self
        former = Origin.read(path)
        commits = dict.fromkeys([*former.earlier, former.versions["commit"], self.versions["commit"]])
        return replace(self, earlier=tuple(commit for commit in commits if commit != self.versions["commit"]))

    def write(self, path: Path) -> None:
        """JSON, whole or not at all."""
        write_whole(path, (json.dumps(asdict(self), indent=1) + "\n").encode())

    def sentence(self) -> str:
        """Hours, machine and versions, for a page's end."""
        names = {"rhabdom", "commit", "machine", "python"}
        packages = ", ".join(f"{name} {self.versions[name]}" for name in self.versions if name not in names)
        units = ((1, "hours"), (1 / 60, "minutes"), (0, "seconds"))
        least, unit = next((least, unit) for least, unit in units if self.hours >= least)
        took = f"{self.hours / (least or 1 / 3600):.2g} {self.whose} {unit}"
        commits = ", ".join(_short(commit) for commit in (*self.earlier, self.versions["commit"]))
        python = self.versions["python"]
        return f"{took} on {self.machine}; rhabdom at {commits}, Python {python}, {packages}."


def _short(commit: str) -> str:
    return f"{commit[:10]} with changes" if commit.endswith("+") else commit[:10]


def _processor() -> str:
    """The processor's name, as far as the system tells it."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
