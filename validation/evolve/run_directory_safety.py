"""Safety of run directories: runs from strangers and killed runs

Is it safe to open a run from a stranger, or a run that was killed? Yes: the 13 promises in the table were tested in
2,605 random trials, with 0 failures.

**Method.** Most trials damage a fresh copy of a small run (or a policy, an image, a model, a page) and pass it to a
command (`validation/evolve/hostile.py`). Such a trial fails in any of these cases:

- the command prints a traceback or more than one line;
- the exit code is not the promised one;
- the damaged part is too large, and the command takes more than a second to refuse it;
- the command touches a file outside the run.

The other trials kill a run with SIGKILL at a random moment and resume it. They fail if the record or a policy is not
bit-identical to that of the same run without kills. `tests/evolve/search/kills.py` uses candidates whose fitness has a
closed form, and `tests/evolve/search/training_kills.py` uses real training runs.

**Table.** The table counts the trials and the failures of each promise.

**Limits.** The trials cover the listed promises only. Short versions of the trials are part of the tests.
`tests/validation/evolve/test_hostile.py` also breaks each promise on purpose, and checks that the trial notices.

Trials take half an hour, so their results are stored (`docs/validation/data/run_directory_safety.csv`). The page is
written from the stored results.

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
    "killed during the search: the same record, bit for bit": "kills.py",
    "killed during training: the same record and policies, bit for bit": "training_kills.py",
}


@dataclass(frozen=True)
class Row:
    """A promise, with the number of its trials and failures."""

    promise: str
    trials: int
    failures: int


def of_strangers(trials: int, seed: int, only: str = "") -> list[Row]:
    """Run the trials of `validation.evolve.hostile`, for all promises or those whose text contains `only`."""
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
    """Run the scripts that kill runs; a script ends at the first difference, which is one failure."""
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
    """Return the latest stored results."""
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
    """Return the descriptions of the bounds that do not hold."""
    found = [f"{row.promise}: {row.failures} of {row.trials} trials failed" for row in rows if row.failures]
    if (trials := sum(row.trials for row in rows)) < LEAST_TRIALS:
        found.append(f"{trials} trials: must be at least {LEAST_TRIALS}")
    return found


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw bars of trials, with failures in another colour."""
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
    options_of.add_argument("--trials", type=int, default=0, help="number of new trials of untrusted runs")
    options_of.add_argument("--kills", type=int, default=0, help="number of new kills for each script")
    options_of.add_argument("--only", default="", help="words of the promises to try again")
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
