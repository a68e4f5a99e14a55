"""Measured points of error and time, and the file of the peers' points."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable
from dataclasses import astuple, dataclass, fields
from pathlib import Path

__all__ = ["STORED", "Point", "read_points", "write_points"]

STORED = Path(__file__).with_name("measured.csv")


@dataclass(frozen=True)
class Point:
    """A measured point.

    samples, pitch: samples across the pupil and their pitch [m].
    error: relative L2 error of intensity over the window.
    seconds: median on one thread.
    kind: see `problem.Run`.
    """

    case: str
    peer: str
    version: str
    method: str
    kind: str
    samples: int
    pitch: float
    dtype: str
    error: float
    seconds: float
    date: str
    machine: str
    detail: str = ""

    @property
    def series(self) -> tuple[str, str, str, str, str]:
        """Key that is the same for all points of a method, whatever their samples."""
        return self.case, self.peer, self.method, self.dtype, self.detail


def read_points(path: Path = STORED) -> list[Point]:
    """Return every row of the file.

    Raises:
        ValueError: the file is not such a table, or contains an invalid number.
    """
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    names = [field.name for field in fields(Point)]
    if not rows or rows[0] != names:
        raise ValueError(f"{path}: the first line must be {','.join(names)}")
    return [_point(path, number, row) for number, row in enumerate(rows[1:], start=2)]


def write_points(points: Iterable[Point], path: Path = STORED) -> None:
    """Write the points to a CSV file atomically."""
    temporary = path.with_suffix(".tmp")
    with temporary.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(field.name for field in fields(Point))
        for point in points:
            row = list(astuple(point))
            row[6], row[8], row[9] = (f"{value:.4g}" for value in (point.pitch, point.error, point.seconds))
            table.writerow(row)
        file.flush()
        os.fsync(file.fileno())
    temporary.replace(path)


def _point(path: Path, number: int, row: list[str]) -> Point:
    try:
        if len(row) != len(fields(Point)):
            raise ValueError(f"{len(row)} columns, must be {len(fields(Point))}")
        *names, samples, pitch, dtype, error, seconds, day, machine, detail = row
        numbers = int(samples), float(pitch), dtype, float(error), float(seconds)
        return Point(*names, *numbers, day, machine, detail)
    except (TypeError, ValueError) as problem:
        raise ValueError(f"{path}, line {number}: {problem}") from None
