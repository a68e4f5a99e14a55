"""Searches for lenses with surrogate fitness: the animals at their end, and the sharpness of the lenses

python -m experiments.imitated_lenses [--compute] [--docs DIR]
"""

from __future__ import annotations

import math
import sys
import time
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evolve.analysis.white_light import white_strehl
from evolve.config.assemble import assemble
from evolve.config.run_config import EyeConfig
from evolve.genome.phenotype import Phenotype, develop
from evolve.search.search import Search
from evolve.store.directory import Run
from experiments import sharp_lenses
from experiments.designed import Trained
from experiments.fitness_landscape import (
    SPREAD,
    WIDE,
    Landscape,
    Life,
    behind_glass,
    fitted,
    holes,
    lenses,
    opening,
)
from experiments.glass import blur, power
from experiments.means import LAST
from experiments.page import Figure, Page, exit_code, markdown_table, new_figure, parser, save
from experiments.store import RECORDS, Origin, read_answer, read_rows, write_rows

__all__ = ["CASES", "Check", "Contents", "Searched", "page", "searched"]

Floats = NDArray[np.float64]
NAME = "imitated_lenses"
RECORD = "lens-003-0"  # a real search; its pinholes are part of the surrogate's fit, and its lenses test the surrogate
SETTINGS = ("eye.noise_sigma=0.003", "search.population=16")
ALL_GENES, ACTIVE = "eye.relief_symmetric=false", "search.active=true"
CASES = {
    "3 genes, 18 generations": ("search.generations=18",),
    "3 genes, 50 generations": ("search.generations=50",),
    "16 genes, 18 generations": ("search.generations=18", ALL_GENES),
    "16 genes, 50 generations": ("search.generations=50", ALL_GENES),
    "3 genes, 18 generations, active": ("search.generations=18", ACTIVE),
    "3 genes, 50 generations, active": ("search.generations=50", ACTIVE),
}
SEEDS = range(16)
FIRST_SEED = 20_000  # above the usual seeds of runs
COLORS = {0.3: "#0072B2", 0.45: "#D55E00"}


@dataclass(frozen=True)
class Searched:
    """End of a search, summarised over the animals of its last generations.

    closed: mean relative aperture in the last generations before glass may change
    aperture: mean relative aperture
    power, blur: medians of the power of the glass and of the blur, see experiments.glass
    fitness: mean expected fitness
    strehl: Strehl ratio of the animal with the median blur in the last generation
    """

    case: str
    seed: int
    closed: float
    aperture: float
    power: float
    blur: float
    fitness: float
    strehl: float


def searched(case: str, seed: int, landscape: Landscape) -> Searched:
    """Run a search with the surrogate's fitness instead of training runs."""
    config = assemble("detection", "lens", assignments=[*SETTINGS, *CASES[case], f"seed={FIRST_SEED + seed}"])
    search, chance, animals = Search(config), np.random.default_rng(FIRST_SEED + seed), []
    for _ in range(config.search.generations):
        proposals = search.propose_generation()
        animals.append([develop(proposal.vector, config) for proposal in proposals])
        lives = landscape.lived(animals[-1], config.eye, chance)
        search.tell([(p.id, float(fitness)) for p, fitness in zip(proposals, lives, strict=True)])
    opens = opening(config)
    late = [animal for generation in animals[-LAST:] for animal in generation]
    apertures, blurs = _apertures(late), np.array([blur(animal, config.eye) for animal in late])
    return Searched(
        case=case,
        seed=seed,
        closed=float(_apertures([a for g in animals[opens - LAST : opens] for a in g]).mean()),
        aperture=float(apertures.mean()),
        power=float(np.median([power(animal, config.eye) for animal in late])),
        blur=float(np.median(blurs)),
        fitness=float(landscape.fitness(apertures, blurs).mean()),
        strehl=_strehl(animals[-1], config.eye),
    )


def _apertures(animals: Sequence[Phenotype]) -> Floats:
    return np.array([animal.relative_aperture or math.nan for animal in animals])


def _strehl(animals: Sequence[Phenotype], config: EyeConfig) -> float:
    """Return the Strehl ratio of the animal whose blur is nearest to the median.

    Animals whose PSF has no maximum in its window are skipped. If this is the case for all, the result is NaN.
    """
    blurs = np.array([blur(animal, config) for animal in animals])
    for place in np.argsort(np.abs(blurs - np.median(blurs)), kind="stable"):
        eye = animals[place].eyes(config).eye()
        if math.isfinite(strehl := white_strehl(eye, eye.psf())):
            return strehl
    return math.nan


@dataclass(frozen=True)
class Check:
    """Fitness of training runs, and the surrogate's expectation for the same animals."""

    expected: Floats
    lived: Floats

    @classmethod
    def from_runs(cls, lives: Sequence[Life], landscape: Landscape) -> Check:
        apertures, blurs, fitness = np.array([(x.aperture, x.blur, x.fitness) for x in lives]).T
        return cls(landscape.fitness(apertures, blurs), fitness)

    @property
    def correlation(self) -> float:
        return float(np.corrcoef(self.expected, self.lived)[0, 1])


@dataclass(frozen=True)
class Contents:
    """Data of the page.

    rows: results of the searches
    lives: training runs to which the surrogate was fitted
    landscape: the surrogate
    check: comparison of the surrogate with other training runs
    """

    rows: Sequence[Searched]
    lives: Sequence[Life]
    landscape: Landscape
    check: Check
    origin: Origin
    answer: str


def page(contents: Contents) -> Page:
    """Return the page of results, made from stored searches."""
    land, check = contents.landscape, contents.check
    return Page(
        name=NAME,
        command=f"python -m experiments.{NAME} --compute",
        values={
            "answer": contents.answer,
            "cases": _table(contents.rows),
            "searches": str(min(len([r for r in contents.rows if r.case == case]) for case in _cases(contents.rows))),
            "formula": f"{land.low:.1f} + {land.high:.0f} exp(-({land.aperture:.2f}/a)^{land.light:.1f})"
            f" exp(-(b/{land.width:.2f})^{land.fall:.1f})",
            "lives": str(len(contents.lives)),
            "spread": f"{SPREAD[0]:g} plus {SPREAD[1]:g}",
            "misfit": f"{land.misfit:.2f}",
            "last": str(LAST),
            "check": f"{check.correlation:.2f} over {check.lived.size} animals",
            "agrees": _agrees(check),
        },
        figures=[Figure(NAME, lambda path: draw(contents, path))],
        origin=contents.origin,
    )


def _cases(rows: Sequence[Searched]) -> list[str]:
    return [case for case in CASES if any(row.case == case for row in rows)]


def _table(rows: Sequence[Searched]) -> str:
    """Return a table of the searches' results, with a row per case: medians, with the 10 % and 90 % quantiles."""
    quantities = ("closed", "aperture", "power", "blur", "fitness", "strehl")
    lines = []
    for case in _cases(rows):
        mine = [row for row in rows if row.case == case]
        lines.append([case, *(_range([getattr(row, name) for row in mine]) for name in quantities)])
    header = ["search", "a before glass may change", "a", "power", "blur [receptors]", "fitness", "Strehl ratio"]
    return markdown_table(header, lines)


def _range(values: Sequence[float]) -> str:
    low, middle, high = np.nanquantile(values, [0.1, 0.5, 0.9])
    return f"{middle:.2g} [{low:.2g}, {high:.2g}]" if abs(middle) < 10 else f"{middle:.0f} [{low:.0f}, {high:.0f}]"


def _agrees(check: Check) -> str:
    """Return a table of expected and actual fitness by quarters of the expected fitness."""
    order = np.array_split(np.argsort(check.expected), 4)
    lines = [[f"{check.expected[part].mean():.0f}", f"{check.lived[part].mean():.0f}"] for part in order]
    return markdown_table(["expected fitness", "fitness of training runs"], lines)


def draw(contents: Contents, path: Path) -> None:
    """Draw the surrogate with its training runs, and the Strehl ratios at the end of the searches."""
    figure, axes = new_figure(11.0, 4.4, columns=2)
    blurs = np.linspace(0, 2.6, 120)
    for aperture, color in COLORS.items():
        mine = [life for life in contents.lives if abs(life.aperture - aperture) < 1e-9]
        axes[0, 0].plot(
            [x.blur for x in mine], [x.fitness for x in mine], "o", color=color, ms=4, alpha=0.5, mec="none"
        )
        expected = contents.landscape.fitness(aperture, blurs)
        axes[0, 0].plot(blurs, expected, color=color, lw=1.5, label=f"a = {aperture:g}")
    axes[0, 0].set(xlabel="blur [receptors]", ylabel="fitness", title="training runs (dots) and surrogate (lines)")
    axes[0, 0].legend(frameon=False)
    cases = _cases(contents.rows)
    for place, case in enumerate(reversed(cases)):
        strehl = [max(row.strehl, 1e-4) for row in contents.rows if row.case == case]
        axes[0, 1].semilogx(strehl, [place] * len(strehl), "o", color="#222222", ms=5, alpha=0.4, mec="none")
    axes[0, 1].axvline(sharp_lenses.SHARP, color="#777777", ls=":", lw=1)
    axes[0, 1].set_yticks(range(len(cases)), cases[::-1])
    axes[0, 1].set(
        xlabel=f"Strehl ratio at the end (dotted: {sharp_lenses.SHARP:g})",
        xlim=(1e-4, 1),
        title="searches with surrogate fitness (dots)",
    )
    figure.suptitle(_message(contents.rows))
    save(figure, path)


def _message(rows: Sequence[Searched]) -> str:
    sharp = {
        case: np.mean([row.strehl > sharp_lenses.SHARP for row in rows if row.case == case]) for case in _cases(rows)
    }
    found = [case for case, share in sharp.items() if share >= 0.5]
    if not found:
        return "Few searches with surrogate fitness find sharp lenses"
    return f"At least half of the searches find sharp lenses with {' or '.join(found)}, not otherwise"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and store the searches if requested; make the page from the stored rows."""
    options = parser(__doc__ or "")
    options.add_argument("--compute", action="store_true", help="run the searches again")
    chosen = options.parse_args(arguments)
    return exit_code(NAME, lambda: _made(chosen))


def _made(chosen: Namespace) -> None:
    data = chosen.docs / "data"
    run = Run.open(RECORDS / RECORD)
    lives = [*lenses(read_rows(Trained, data / f"{sharp_lenses.NAME}.csv")), *WIDE, *holes(run)]
    landscape, stored = fitted(lives), data / f"{NAME}.csv"
    if chosen.compute:
        began, rows = time.process_time(), []
        for case in CASES:
            rows += [searched(case, seed, landscape) for seed in SEEDS]
            print(f"{case}: Strehl ratio {_range([row.strehl for row in rows if row.case == case])}", flush=True)
        write_rows(rows, stored)
        Origin.here((time.process_time() - began) / 3600).write(stored.with_suffix(".json"))
    contents = Contents(
        rows=read_rows(Searched, stored),
        lives=lives,
        landscape=landscape,
        check=Check.from_runs(behind_glass(run), landscape),
        origin=Origin.read(stored.with_suffix(".json")),
        answer=read_answer(stored),
    )
    page(contents).publish(chosen.docs)


if __name__ == "__main__":
    sys.exit(main())
