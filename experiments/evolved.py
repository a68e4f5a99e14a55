"""Runs of evolution become a store, and the store a page."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from evolve.store.atomic_files import write_whole
from evolve.store.directory import Run
from evolve.store.versions import commits, recorded
from experiments.candidates import Row, complete, rows_of
from experiments.drift import Drift, drifted, of_the_end
from experiments.means import last_mean
from experiments.page import Page, markdown_table, parser, told
from experiments.store import Origin, read_rows, write_rows

__all__ = ["Conduct", "Quantities", "Store", "conduct_table", "main", "null_model", "null_table", "stored"]

Quantities = Mapping[str, Callable[[Row], float]]  # that are compared with the null model
NOT_JUDGED = "Not judged yet."
COLORS = {
    "blue": "#0072B2",
    "orange": "#D55E00",
    "green": "#009E73",
    "purple": "#B8568F",
    "yellow": "#B59E00",
    "black": "#222222",
    "brown": "#8C564B",
    "grey": "#999999",
}


@dataclass(frozen=True)
class Conduct:
    """How a run was conducted.

    generations, planned  complete ones, and how many there were to be
    commits               of rhabdom, with which it was begun and continued, first digits; +: with changes
    worker_hours          by the clock: other work on the machine lengthens them
    noise_sigma           of its receptors · relief_height [m]: what a relief gene of 1 means
    """

    group: str
    seed: int
    candidates: int
    generations: int
    planned: int
    worker_hours: float
    commits: str
    noise_sigma: float
    relief_height: float

    @classmethod
    def of(cls, run: Run, group: str) -> Conduct:
        done, hours = complete(run), sum(candidate.seconds for candidate in run.candidates) / 3600
        by = ", ".join(commit[:7] + "+" * commit.endswith("+") for commit in commits(run.path))
        config, eye = run.config, run.config.eye
        counts = (len(run.candidates), len(done), config.search.generations)
        return cls(group, config.seed, *counts, hours, by, eye.noise_sigma, eye.relief_height)


@dataclass(frozen=True)
class Store:
    """What a page is made from: rows, how their runs were conducted, the drift of the null model, their origin, and the
    answer that a person has given to the question."""

    rows: list[Row]
    conduct: list[Conduct]
    drift: list[Drift]
    origin: Origin
    answer: str

    def group(self, name: str) -> list[Row]:
        """Rows of one group."""
        return [row for row in self.rows if row.group == name]

    @property
    def groups(self) -> list[str]:
        """Names of the groups, in the order in which they were given."""
        return list(dict.fromkeys(row.group for row in self.rows))

    @property
    def colors(self) -> dict[str, str]:
        """Of each group. Raises ValueError with more groups than there are colours."""
        if len(self.groups) > len(COLORS):
            raise ValueError(f"{len(self.groups)} groups of runs, must be at most {len(COLORS)}: one colour each")
        return dict(zip(self.groups, COLORS.values(), strict=False))

    @property
    def legend(self) -> str:
        """The same in words."""
        names = {value: name for name, value in COLORS.items()}
        return ", ".join(f"{group} {names[color]}" for group, color in self.colors.items())

    def noise_sigma(self, group: str) -> float:
        """Of the receptors in a group's runs."""
        return next(one.noise_sigma for one in self.conduct if one.group == group)

    def drift_of(self, group: str, quantity: str) -> list[Drift]:
        """A quantity under the null model, by generation; [] where it was not computed."""
        return [one for one in self.drift if (one.group, one.quantity) == (group, quantity)]


def conduct_table(store: Store) -> str:
    """A row per run."""
    header = ["run", "candidates", "generations", "worker hours", "rhabdom at"]
    lines = [
        [
            *(f"{one.group}, seed {one.seed}", str(one.candidates), f"{one.generations} of {one.planned}"),
            *(f"{one.worker_hours:.1f}", one.commits),
        ]
        for one in store.conduct
    ]
    return markdown_table(header, lines)


def null_table(store: Store, quantities: Quantities, phase: int | None = None) -> str:
    """A row per run, and one for the runs of a group together: the p of what they came to under the null model, at the
    end of a phase or of the run."""
    names = [n for n in quantities if any(not one.held for g in store.groups for one in store.drift_of(g, n))]
    lines = []
    for group in store.groups:
        rows = [row for row in store.group(group) if phase in (None, row.phase)]
        runs = [[row for row in rows if row.seed == seed] for seed in sorted({row.seed for row in rows})]
        lines += [[f"{group}, seed {run[0].seed}", *_ps(store, [run], quantities, names)] for run in runs]
        if len(runs) > 1:
            lines.append([f"{group}, {len(runs)} seeds together", *_ps(store, runs, quantities, names)])
    searches = max((len(one.ends.split()) for one in store.drift), default=0)
    return markdown_table([f"p under the null model (two-sided, at least {2 / (searches + 1):.2g})", *names], lines)


def _ps(store: Store, runs: Sequence[list[Row]], quantities: Quantities, names: Sequence[str]) -> list[str]:
    """Of each quantity: p of these runs' mean; "-" where nothing moves it, or a run did not get as far as others."""
    shown = []
    for name in names:
        found = [last_mean(run, quantities[name]) for run in runs]
        ends = [null_model(store, run[0].group, name, run) for run in runs]
        values = [one.mean for one, end in zip(found, ends, strict=True) if one and end and not end.held]
        together = len(values) == len(runs) and len({end.generation for end in ends if end}) == 1
        shown.append(f"{ends[0].p(*values):.2g}" if ends[0] and together else "-")
    return shown


def null_model(store: Store, group: str, quantity: str, rows: Sequence[Row]) -> Drift | None:
    """A quantity under the null model at the last generation of these rows; None where no phase ends there."""
    return of_the_end(store.drift_of(group, quantity), max((row.generation for row in rows), default=-1))


def main(
    name: str,
    text: str,
    page: Callable[[Store], Page],
    arguments: Sequence[str] | None = None,
    quantities: Quantities | None = None,
) -> int:
    """Collect runs if asked, and the null model of the quantities; make the page from the store."""
    options = parser(text)
    options.add_argument("--runs", nargs="+", metavar="GROUP=DIR", help="collect these run directories anew")
    options.add_argument("--answer", help="what came out, in Markdown; kept until another is given or numbers change")
    chosen = options.parse_args(arguments)
    stem = chosen.docs / "data" / name

    def work() -> None:
        _collect(chosen, stem, quantities or {})
        page(stored(stem)).publish(chosen.docs)

    return told(name, work)


def _beside(stem: Path, what: str) -> Path:
    return stem.with_name(f"{stem.name}_{what}.csv")


def _collect(chosen: Namespace, stem: Path, quantities: Quantities) -> None:
    answer = stem.with_suffix(".txt")
    if chosen.runs:
        runs = _named(chosen.runs)
        before = _text(stem.with_suffix(".csv"))
        rows = [row for group, run in runs for row in rows_of(run, group)]
        conduct = [Conduct.of(run, group) for group, run in runs]
        furthest = {one.group: max(o.generations for o in conduct if o.group == one.group) for one in conduct}
        configs = {group: run.config for group, run in runs if quantities and furthest[group] > 0}
        found = [row for g, config in configs.items() for row in drifted(config, g, quantities, furthest[g])]
        here = Origin.here(sum(one.worker_hours for one in conduct), "worker")
        # All that takes time is done: what is stored goes together, also where somebody stops it here.
        if quantities:
            write_rows(found, _beside(stem, "drift"))
        write_rows(conduct, _beside(stem, "runs"))
        replace(here, versions=recorded(runs[0][1].path) or here.versions).write(stem.with_suffix(".json"))
        write_rows(rows, stem.with_suffix(".csv"))
        if _text(stem.with_suffix(".csv")) != before:
            answer.unlink(missing_ok=True)  # it was given to other numbers
    if chosen.answer:
        write_whole(answer, f"{chosen.answer}\n".encode())


def _named(texts: Sequence[str]) -> list[tuple[str, Run]]:
    """Runs and the groups that they belong to. Raises ValueError where those of a group differ in more than seeds."""
    named = [text.partition("=") for text in texts]
    if not all(equals for _, equals, _ in named):
        raise ValueError("--runs: must be GROUP=DIR ...")
    runs = [(group, Run.open(Path(path))) for group, _, path in named]
    settings = {group: replace(run.config, seed=0, workers=0) for group, run in runs}
    for group, run in runs:
        if replace(run.config, seed=0, workers=0) != settings[group]:
            raise ValueError(f"--runs: {run.path} has other settings than the last run of group {group!r}")
    return runs


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8") if path.exists() else ""


def stored(stem: Path) -> Store:
    """What is stored under this name (path without an ending). Raises ValueError where there are no rows."""
    rows = read_rows(Row, stem.with_suffix(".csv"))
    if not rows:
        raise ValueError(f"{stem.with_suffix('.csv')} holds no runs; collect some with --runs GROUP=DIR ...")
    conduct, drift = read_rows(Conduct, _beside(stem, "runs")), read_rows(Drift, _beside(stem, "drift"))
    said = _text(stem.with_suffix(".txt")).strip() or NOT_JUDGED
    return Store(rows, conduct, drift, Origin.read(stem.with_suffix(".json")), said)
