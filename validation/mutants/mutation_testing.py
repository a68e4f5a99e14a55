"""Mutation testing: do the tests notice deliberate mistakes?

Which fraction of deliberate mistakes do the tests notice? A copy of the code with one such mistake is called a mutant,
and the tests kill a mutant if they notice the mistake. They kill 185 of 193 mutants, which is 96 %. Six further mutants
do not change any result that a user could see. They are not counted.

**Method.** Examples of mistakes are a changed sign or comparison, a bound that is off by one, an omitted check or call,
swapped axes or arguments, or a maximum instead of a minimum. For each mutant the nearest tests are run. The
`__init__.py` of each test folder names these tests for each module (for example `tests/optics/methods/__init__.py`).
From each test file, only the quickest tests are run, up to a total of about twenty seconds. A mutant is killed if one
of these tests fails, hangs or crashes.

The first mutants are those in `validation/mutants/named_mutants.py`, which contain mistakes that no test had noticed at
first. The others are drawn evenly from all places in the three packages where such a mistake can be made. Some mutants
do not change results, but only the time of the computation or an invisible detail. The table calls them "alike" and
does not count them as mistakes. Below the table, each mutant that survived or is alike is listed with its file and
line, the change, the original line of code, and the reason.

**Bounds.** At least 90 % of the mutants that are mistakes are killed. Every mutant that survived or is alike has a
stated reason.

**Limits.** Eight mutants were tried by hand, with tests that this procedure would not have run, or that were written
for these mutants. Their results are stored with the others. The reasons for mutants that survived or are alike come
from reading the code.

A trial takes a minute, so results are stored (`docs/validation/data/mutation_testing.csv`). The page is written from
the stored results. `--trials` continues after the last stored mutant. `--again` tries the survivors once more, for
example after a test was written.

    python -m validation.mutants.mutation_testing [--trials N] [--seed S] [--again] [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import argparse
import csv
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import chain, zip_longest
from pathlib import Path

from validation.mutants.mutant_sites import Site, drawn
from validation.mutants.mutant_trials import Copy, nearest_tests
from validation.mutants.named_mutants import NAMED
from validation.pages.page import Page, parser
from validation.pages.tables import write_table
from validation.pages.work_precision_chart import MUTED, OURS, OURS_TOO

ROOT = Path(__file__).resolve().parents[2]
STORED = Path("docs/validation/data/mutation_testing.csv")
PACKAGES = ("optics", "sim", "evolve")
WANTED = 0.9  # share of the mutants that are mistakes to be killed


@dataclass(frozen=True)
class Row:
    """A stored trial.

    verdict: "killed", "survived", or "alike" if the mutant is not a mistake.
    by: the test that failed.
    reason: explanation for a mutant that was not killed.
    """

    path: str
    line: int
    kind: str
    change: str
    verdict: str
    by: str
    reason: str = ""

    @property
    def package(self) -> str:
        return self.path.split("/")[0]

    @property
    def key(self) -> tuple[str, str]:
        return self.path, self.change


def stored(path: Path) -> list[Row]:
    """Return all stored trials."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return [Row(**{**row, "line": int(row["line"])}) for row in csv.DictReader(file)]


def chosen(root: Path, count: int, seed: int) -> list[Site]:
    """Return the named mutants first, then mutants of each package in turn, evenly drawn."""
    named = [mutant.site(root) for mutant in NAMED]
    share = [drawn(root, package, count, seed) for package in PACKAGES]
    in_turn = [site for site in chain.from_iterable(zip_longest(*share)) if site is not None]
    return [*named, *in_turn][:count]


def trials(root: Path, sites: Sequence[Site], folder: Path) -> Iterator[Row]:
    """Yield the outcome of each mutant."""
    copy = Copy.from_root(root, folder)
    for site in sites:
        trial = copy.tried(site, nearest_tests(root, site.path))
        print(
            f"{trial.verdict:<9}{trial.seconds:6.0f} s  {site.path}:{site.line}  {site.change}  {trial.by}", flush=True
        )
        yield Row(site.path, site.line, site.kind, site.change, trial.verdict, trial.by)


def go_on(root: Path, store: Path, options: argparse.Namespace) -> None:
    """Try the requested mutants that are not stored yet; the store is written after each."""
    before = {row.key: row for row in stored(store)}
    again = {key for key, row in before.items() if options.again and row.verdict != "killed"}
    wanted = chosen(root, options.trials, options.seed)
    still_there = {(site.path, site.change) for site in wanted}  # code changes
    before = {key: row for key, row in before.items() if key in still_there}
    again &= still_there
    rows = [row for key, row in before.items() if key not in again]
    sites = [site for site in wanted if (site.path, site.change) not in before or (site.path, site.change) in again]
    for row in trials(root, sites, options.work):
        old = before.get(row.key)
        alike = row.verdict == "survived" and old is not None
        rows.append(replace(row, verdict=old.verdict, reason=old.reason) if alike and old else row)
        waiting = [before[key] for key in again if key not in {row.key for row in rows}]
        write_table(store, [asdict(row) for row in [*rows, *waiting]])


def table(rows: Sequence[Row]) -> str:
    """Return counts by package, and the mutants that were not killed."""
    lines = [f"{'':<10}{'mutants':>9}{'alike':>9}{'killed':>9}{'survived':>10}{'killed of mistakes':>20}"]
    for name in (*PACKAGES, "all"):
        of = [row for row in rows if name in (row.package, "all")]
        alike, killed, left = (sum(row.verdict == verdict for row in of) for verdict in ("alike", "killed", "survived"))
        lines.append(f"{name:<10}{len(of):>9}{alike:>9}{killed:>9}{left:>10}{killed / max(killed + left, 1):>19.0%}")
    for verdict, title in (("survived", "survived"), ("alike", "alike: not mistakes")):
        of = [row for row in rows if row.verdict == verdict]
        lines += ["", title] if of else []
        for row in sorted(of, key=lambda row: (row.path, row.line)):
            lines += [f"{row.path}:{row.line} {row.change}", f"    {row.reason or '(no reason yet)'}"]
    return "\n".join(lines)


def share(rows: Sequence[Row]) -> float:
    """Return the share of killed mutants among the mistakes."""
    mistakes = [row for row in rows if row.verdict != "alike"]
    return sum(row.verdict == "killed" for row in mistakes) / max(len(mistakes), 1)


def broken(rows: Sequence[Row]) -> list[str]:
    """Return the descriptions of the bounds that do not hold."""
    found = [
        f"{row.path}: {row.change}: not killed, without a reason"
        for row in rows
        if row.verdict != "killed" and not row.reason
    ]
    if share(rows) < WANTED:
        found.append(f"{share(rows):.0%} of the mutants that are mistakes were killed: must be {WANTED:.0%}")
    return found


def page(rows: Sequence[Row]) -> Page:
    return Page("mutation_testing", __doc__ or "", table(rows), broken(rows))


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw bars by kind of mistake."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 3.4), layout="constrained")
    axes = figure.subplots()
    kinds, left = sorted({row.kind for row in rows}), [0] * len({row.kind for row in rows})
    for verdict, color in (("killed", OURS), ("alike", MUTED), ("survived", OURS_TOO)):
        counts = [sum(row.kind == kind and row.verdict == verdict for row in rows) for kind in kinds]
        axes.barh(kinds, counts, left=left, color=color, label=verdict)
        left = [before + count for before, count in zip(left, counts, strict=True)]
    axes.set_xlabel("mutants")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=150)


def main(arguments: Sequence[str] | None = None) -> int:
    options_of = parser(__doc__ or "")
    options_of.add_argument("--trials", type=int, default=0, help="mutants in the store; missing ones are tried")
    options_of.add_argument("--seed", type=int, default=0)
    options_of.add_argument("--again", action="store_true", help="try survivors once more")
    options_of.add_argument("--store", type=Path, default=STORED)
    options_of.add_argument("--work", type=Path, default=Path(tempfile.gettempdir()) / "mutants-of-rhabdom")
    options = options_of.parse_args(arguments)
    if options.trials:
        go_on(ROOT, options.store, options)
    rows = stored(options.store)
    return page(rows).publish(options, lambda path: draw(rows, path))


if __name__ == "__main__":
    sys.exit(main())
