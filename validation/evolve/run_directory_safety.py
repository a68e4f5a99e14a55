"""A run directory can be mailed, and killed (F0)

What is promised about strangers' runs and unfinished runs, held against random trials. A trial spoils a fresh copy of a
small run (or a policy, a picture, a model, a page) and gives it to a command; it fails if there is a traceback, more
than one line, another exit code than promised, a second's work where sizes are checked, or a file touched outside the
run (`validation/evolve/hostile.py`). Or it kills a run with SIGKILL at a random moment and continues it: it fails if
the record, or a policy, differs by a bit from that of the same run which nobody has killed
(`tests/evolve/search/kills.py`, candidates in closed form; `tests/evolve/search/training_kills.py`, real trainings).

Trials are stored (`docs/validation/data/run_directory_safety.csv`), because they take half an hour; the page comes from
the store. Short versions are tests. `tests/validation/evolve/test_hostile.py` also breaks each promise on purpose, and
must notice.

    python -m validation.evolve.run_directory_safety [--trials N [--only WORDS]] [--kills N] [--seed S] [--out DIR]
        [--docs DIR]
"""

from __future__ import annotations

import csv
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from validation.evolve import hostile
from validation.evolve.hostile_runs import Stage
from validation.pages.page import Page, parser
from validation.pages.tables import write_table
from validation.pages.work_precision_chart import OURS, OURS_TOO

ROOT = Path(__file__).resolve().parents[2]
STORED = Path("docs/validation/data/run_directory_safety.csv")
LEAST_TRIALS = 2000
KILLS = {
    "killed while it searches: the same record, bit for bit": "kills.py",
    "killed while animals learn: the same record and policies, bit for bit": "training_kills.py",
}


@dataclass(frozen=True)
class Row:
    """A promise, how often it was tried, and how often it was broken."""

    promise: str
    trials: int
    failures: int


def of_strangers(trials: int, seed: int, only: str = "") -> list[Row]:
    """Of `validation.evolve.hostile`: of all promises, or of those whose text has `only` in it."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        stage = Stage.build(Path(folder))
        for promise in hostile.PROMISES:
            if only not in promise.text:
                continue
            count = max(1, round(promise.share * trials))
            wrong = hostile.failures(promise, count, seed, stage)
            rows.append(Row(promise.text, count, len(wrong)))
            print(rows[-1], *wrong[: hostile.SHOWN], sep="\n    ", flush=True)
    return rows


def of_kills(kills: int, seed: int) -> list[Row]:
    """Of the scripts that kill runs; the first difference ends a script, and is one failure."""
    rows = []
    for promise, script in KILLS.items():
        command = [sys.executable, ROOT / "tests" / "evolve" / "search" / script, str(kills), str(seed)]
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        child = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        told = re.search(r"^(\d+) (?:kills|trainings)", child.stdout, re.MULTILINE)
        rows.append(Row(promise, int(told[1]) if told else kills, int(told is None or child.returncode != 0)))
        print(rows[-1], child.stderr[-500:], flush=True)
    return rows


def stored() -> list[Row]:
    """What was tried last."""
    if not STORED.is_file():
        return []
    with STORED.open(encoding="utf-8", newline="") as file:
        return [Row(row["promise"], int(row["trials"]), int(row["failures"])) for row in csv.DictReader(file)]


def table(rows: Sequence[Row]) -> str:
    lines = [f"{'promise':<72}{'trials':>8}{'failures':>10}"]
    lines += [f"{row.promise:<72}{row.trials:>8,}{row.failures:>10}" for row in rows]
    trials, failures = sum(row.trials for row in rows), sum(row.failures for row in rows)
    return "\n".join([*lines, f"{'all':<72}{trials:>8,}{failures:>10}"])


def broken(rows: Sequence[Row]) -> list[str]:
    """Bounds that do not hold."""
    found = [f"{row.promise}: {row.failures} of {row.trials} trials failed" for row in rows if row.failures]
    if (trials := sum(row.trials for row in rows)) < LEAST_TRIALS:
        found.append(f"{trials} trials: must be at least {LEAST_TRIALS}")
    return found


def draw(rows: Sequence[Row], path: Path) -> None:
    """Bars of trials; what failed in another colour."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4), layout="constrained")
    axes = figure.subplots()
    names = [row.promise for row in rows][::-1]
    axes.barh(names, [row.trials for row in rows][::-1], color=OURS)
    axes.barh(names, [row.failures for row in rows][::-1], color=OURS_TOO)
    axes.set(xscale="log", xlabel="trials (failures in another colour)")
    figure.savefig(path, dpi=150)


def main(arguments: Sequence[str] | None = None) -> int:
    options_of = parser(__doc__ or "")
    options_of.add_argument("--trials", type=int, default=0, help="try strangers' runs anew, so often")
    options_of.add_argument("--kills", type=int, default=0, help="kill anew, so often each")
    options_of.add_argument("--only", default="", help="words of the promises that are tried anew")
    options_of.add_argument("--seed", type=int, default=0)
    options = options_of.parse_args(arguments)
    before = {row.promise: row for row in stored()}
    new = of_strangers(options.trials, options.seed, options.only) if options.trials else []
    new += of_kills(options.kills, options.seed) if options.kills else []
    rows = [*{**before, **{row.promise: row for row in new}}.values()]
    if new:
        write_table(STORED, [asdict(row) for row in rows])
    return Page("run_directory_safety", __doc__ or "", table(rows), broken(rows)).publish(
        options, lambda path: draw(rows, path)
    )


if __name__ == "__main__":
    sys.exit(main())
