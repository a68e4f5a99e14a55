"""Stored results of evolution runs, and the pages that are made from them."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from evolve.search.null_model import fitness_spread
from evolve.store.directory import Run
from evolve.store.versions import commits
from experiments.candidates import Row, complete, rows_of
from experiments.drift import Drift, drifted, of_the_end
from experiments.means import last_mean
from experiments.page import Page, exit_code, markdown_table, parser
from experiments.store import Origin, read_answer, read_rows, write_answer, write_rows

__all__ = [
    "Quantities",
    "RunMetadata",
    "Store",
    "collect",
    "conduct_table",
    "main",
    "null_model",
    "null_table",
    "stored",
]

Quantities = Mapping[str, Callable[[Row], float]]  # quantities that are compared with the null model
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
class RunMetadata:
    """Conditions of a run.

    generations, planned: numbers of complete and of planned generations
    worker_hours: sum of the candidates' wall times, which other work on the machine increases
    commits: abbreviated commits of rhabdom that started or continued the run; + marks a commit with local changes
    noise_sigma: noise of the receptors
    relief_height: height of a relief with gene value 1 [m]
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
    def from_run(cls, run: Run, group: str) -> RunMetadata:
        done, hours = complete(run), sum(candidate.seconds for candidate in run.candidates) / 3600
        by = ", ".join(commit[:7] + "+" * commit.endswith("+") for commit in commits(run.path))
        config, eye = run.config, run.config.eye
        counts = (len(run.candidates), len(done), config.search.generations)
        return cls(group, config.seed, *counts, hours, by, eye.noise_sigma, eye.relief_height)


@dataclass(frozen=True)
class Store:
    """Data of a page: rows, conditions of their runs, null model (drift), origin, and the written answer."""

    rows: list[Row]
    run_metadata: list[RunMetadata]
    drift: list[Drift]
    origin: Origin
    answer: str

    def group(self, name: str) -> list[Row]:
        """Return the rows of one group."""
        return [row for row in self.rows if row.group == name]

    @property
    def groups(self) -> list[str]:
        """Names of the groups, in order of their first rows."""
        return list(dict.fromkeys(row.group for row in self.rows))

    @property
    def colors(self) -> dict[str, str]:
        """Colour of each group.

        Raises:
            ValueError: there are more groups than colours.
        """
        if len(self.groups) > len(COLORS):
            raise ValueError(f"{len(self.groups)} groups of runs: must be at most {len(COLORS)}, with one colour each")
        return dict(zip(self.groups, COLORS.values(), strict=False))

    @property
    def legend(self) -> str:
        """Colour of each group as text, such as "navigation blue, detection orange"."""
        names = {value: name for name, value in COLORS.items()}
        return ", ".join(f"{group} {names[color]}" for group, color in self.colors.items())

    def noise_sigma(self, group: str) -> float:
        """Return the noise of the receptors in a group's runs."""
        return next(one.noise_sigma for one in self.run_metadata if one.group == group)

    def drift_of(self, group: str, quantity: str) -> list[Drift]:
        """Return a quantity under the null model, by generation; [] if it was not computed."""
        return [one for one in self.drift if (one.group, one.quantity) == (group, quantity)]


def conduct_table(store: Store) -> str:
    """Return a table of the conditions of the runs, with a row per run."""
    header = ["run", "candidates", "generations", "worker hours", "commits of rhabdom"]
    lines = [
        [
            *(f"{one.group}, seed {one.seed}", str(one.candidates), f"{one.generations} of {one.planned}"),
            *(f"{one.worker_hours:.1f}", one.commits),
        ]
        for one in store.run_metadata
    ]
    return markdown_table(header, lines)


def null_table(store: Store, quantities: Quantities, phase: int | None = None) -> str:
    """Return a table of p-values under the null model, at the end of a phase or of the run.

    Each run has a row, and the runs of a group together have another one.
    """
    names = [n for n in quantities if any(not one.held for g in store.groups for one in store.drift_of(g, n))]
    lines = []
    for group in store.groups:
        rows = [row for row in store.group(group) if phase in (None, row.phase)]
        runs = [[row for row in rows if row.seed == seed] for seed in sorted({row.seed for row in rows})]
        lines += [[f"{group}, seed {run[0].seed}", *_ps(store, [run], quantities, names)] for run in runs]
        if len(runs) > 1:
            lines.append([f"{group}, {len(runs)} seeds together", *_ps(store, runs, quantities, names)])
    searches = max((len(one.ends.split()) for one in store.drift), default=0)
    label = f"two-sided p under the null model ({2 / (searches + 1):.2g} is the smallest possible)"
    return markdown_table([label, *names], lines)


def _ps(store: Store, runs: Sequence[list[Row]], quantities: Quantities, names: Sequence[str]) -> list[str]:
    """Return the p-value of these runs' mean for each quantity.

    "-" stands for a constant quantity, or for runs that ended in different generations.
    """
    shown = []
    for name in names:
        found = [last_mean(run, quantities[name]) for run in runs]
        ends = [null_model(store, run[0].group, name, run) for run in runs]
        values = [one.mean for one, end in zip(found, ends, strict=True) if one and end and not end.held]
        together = len(values) == len(runs) and len({end.generation for end in ends if end}) == 1
        shown.append(f"{ends[0].p(*values):.2g}" if ends[0] and together else "-")
    return shown


def null_model(store: Store, group: str, quantity: str, rows: Sequence[Row]) -> Drift | None:
    """Return a quantity under the null model at the last generation of these rows; None if no phase ends there."""
    return of_the_end(store.drift_of(group, quantity), max((row.generation for row in rows), default=-1))


def main(
    name: str,
    text: str,
    page: Callable[[Store], Page],
    arguments: Sequence[str] | None = None,
    quantities: Quantities | None = None,
) -> int:
    """Collect runs and compute the null model of the quantities if requested; make the page from the stored rows."""
    options = parser(text)
    options.add_argument("--runs", nargs="+", metavar="GROUP=DIR", help="collect these run directories")
    options.add_argument("--answer", help="answer on the page, in Markdown; stored until the numbers change")
    chosen = options.parse_args(arguments)
    stem = chosen.docs / "data" / name

    def work() -> None:
        _collect(chosen, stem, quantities or {})
        page(stored(stem)).publish(chosen.docs)

    return exit_code(name, work)


def _beside(stem: Path, what: str) -> Path:
    return stem.with_name(f"{stem.name}_{what}.csv")


def _collect(chosen: Namespace, stem: Path, quantities: Quantities) -> None:
    if chosen.runs:
        collect(_named(chosen.runs), stem, quantities)
    if chosen.answer:
        write_answer(stem, chosen.answer)


def collect(
    runs: Sequence[tuple[str, Run]], stem: Path, quantities: Quantities, random: Collection[str] | None = None
) -> None:
    """Store the rows of runs, the conditions of the runs, and the null model of quantities.

    A stored answer is deleted if the rows change, because it refers to the former numbers.

    runs: each run with the name of its group; runs of a group have the same settings of genome, search and costs
    stem: path of the files without an ending
    random: groups for which the null model is computed; None: all
    """
    before = _text(stem.with_suffix(".csv"))
    rows = [row for group, run in runs for row in rows_of(run, group)]
    metadata = [RunMetadata.from_run(run, group) for group, run in runs]
    furthest = {one.group: max(o.generations for o in metadata if o.group == one.group) for one in metadata}
    configs = {group: run.config for group, run in runs if quantities and furthest[group] > 0}
    found = []
    for group, config in configs.items():
        if random is None or group in random:
            spread = fitness_spread([run for of, run in runs if of == group], furthest[group])
            found += drifted(config, group, quantities, furthest[group], spread)
    made = Origin.from_runs([run.path for _, run in runs], sum(one.worker_hours for one in metadata))
    # All computations are complete here, so that an interruption is unlikely to leave inconsistent files.
    drift = _beside(stem, "drift")
    write_rows(found, drift) if found else drift.unlink(missing_ok=True)
    write_rows(metadata, _beside(stem, "runs"))
    made.write(stem.with_suffix(".json"))
    write_rows(rows, stem.with_suffix(".csv"))
    if _text(stem.with_suffix(".csv")) != before:
        stem.with_suffix(".txt").unlink(missing_ok=True)


def _named(texts: Sequence[str]) -> list[tuple[str, Run]]:
    """Return runs with the names of their groups.

    Raises:
        ValueError: runs of a group differ in more than their seeds.
    """
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
    """Return the stored data of a page.

    stem: path of the files without an ending

    Raises:
        ValueError: no rows of candidates are stored.
    """
    rows = read_rows(Row, stem.with_suffix(".csv"))
    if not rows:
        raise ValueError(f"{stem.with_suffix('.csv')} holds no runs; collect some with --runs GROUP=DIR ...")
    metadata, drift = read_rows(RunMetadata, _beside(stem, "runs")), read_rows(Drift, _beside(stem, "drift"))
    answer = read_answer(stem, NOT_JUDGED)
    return Store(rows, metadata, drift, Origin.read(stem.with_suffix(".json")), answer)
