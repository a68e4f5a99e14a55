"""Learning behind pinholes: the best width for learning, and its dependence on light

python -m experiments.learning_through_holes [--runs NOISE=DIR ...] [--answer TEXT] [--docs DIR]
"""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments import best_pupil, evolved
from experiments.candidates import Row
from experiments.evolved import Store, conduct_table
from experiments.means import Interval
from experiments.page import Figure, Page, markdown_table, new_figure, save

__all__ = ["best_width", "page", "smoothed"]

NAME = "learning_through_holes"
MEASURES = ("contrast", "stripes_1", "stripes_2", "stripes_4")
DRAWN = {"contrast": ":", "stripes_2": "--"}
BANDWIDTH = 0.2  # standard deviation of the smooth curve's weights in log a: about a fifth of the width
STEPS = 105  # number of points of a curve
RESAMPLES = 2000
SURE = 0.05  # p-value below which a best width is reported
BINS = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.65)
CHANCE = 1 / 3
Floats = NDArray[np.float64]


def page(store: Store) -> Page:
    """Return the page of results, made from stored runs.

    Raises:
        ValueError: there are more groups than colours.
    """
    return Page(
        name=NAME,
        command=(
            "evolve run --preset pupil\n"
            "evolve run --preset pupil --set eye.noise_sigma=0.003    # and 0.0003\n"
            f"python -m experiments.{NAME} --runs 0.0003=DIR 0.001=DIR 0.003=DIR"
        ),
        values={
            "answer": store.answer,
            "legend": store.legend,
            "best_widths": table(store),
            "success_by_width": by_width(store),
            "runs": conduct_table(store),
            "bandwidth": f"{BANDWIDTH:g}",
            "permutations": str(RESAMPLES),
            "significance": f"{SURE:g}",
        },
        figures=[Figure(NAME, lambda path: draw(store, path))],
        origin=store.origin,
    )


def _samples(rows: Sequence[Row]) -> tuple[Floats, Floats]:
    """Return log widths and success rates of the animals that did not fail."""
    done = [row for row in rows if not row.failed]
    return np.log([row.relative_aperture for row in done]), np.array([row.success_rate for row in done])


def smoothed(place: Floats, value: Floats, at: Floats) -> Floats:
    """Return the local linear fit (Fan 1992) to values at log widths `place`, evaluated at `at`.

    A kernel mean would be biased towards widths with more animals.
    """
    away = place - at[:, None]
    weight = np.exp(-0.5 * (away / BANDWIDTH) ** 2)
    first, second = (weight * away).sum(axis=1, keepdims=True), (weight * away**2).sum(axis=1, keepdims=True)
    weight = weight * (second - away * first)
    found: Floats = weight @ value / weight.sum(axis=1)
    return found


def best_width(rows: Sequence[Row], seed: int = 0) -> tuple[Interval, float]:
    """Return the width at the peak of the smooth curve of success, and a p-value.

    The width has a 95 % bootstrap interval over animals. p is estimated by permutations. It is the probability that a
    curve explains at least as much of the variance if success does not depend on the width.

    Raises:
        ValueError: there are fewer than three animals.
    """
    place, value = _samples(rows)
    if len(place) < 3:
        raise ValueError("a best width needs at least three animals")
    chance, at, peaks, as_much = np.random.default_rng(seed), _tried(place), [], 1
    explained = smoothed(place, value, place).var()
    for _ in range(RESAMPLES):
        chosen = chance.integers(len(place), size=len(place))
        if np.unique(place[chosen]).size > 1:
            among = _tried(place[chosen])  # a local line diverges outside the range of the animals
            peaks.append(among[smoothed(place[chosen], value[chosen], among).argmax()])
        as_much += bool(smoothed(place, chance.permutation(value), place).var() >= explained)
    best, low, high = np.exp([at[smoothed(place, value, at).argmax()], *np.quantile(peaks, [0.025, 0.975])])
    return Interval(float(best), float(low), float(high)), as_much / (RESAMPLES + 1)


def _tried(place: Floats) -> Floats:
    """Return log widths between the smallest and the largest tested width."""
    return np.linspace(place.min(), place.max(), STEPS)


def table(store: Store) -> str:
    """Return a table with a row per noise: the best pinhole for learning, and the optical predictions."""
    lines = []
    for group in store.groups:
        sigma = store.noise_sigma(group)
        predicted = best_pupil.predicted(sigma, MEASURES)
        found, p = best_width(store.group(group))
        shown = str(found) if p < SURE else "no best width"
        lines.append([f"{sigma:g}", str(len(_samples(store.group(group))[0])), shown, f"{p:.2g}", *predicted])
    return markdown_table(
        ["noise σ", "animals", "best learning at", "p", *(f"best by {best_pupil.MEASURES[m]}" for m in MEASURES)], lines
    )


def by_width(store: Store) -> str:
    """Return a table with a row per range of widths and a column per noise: mean success and standard error."""
    lines = []
    for low, high in itertools.pairwise(BINS):
        line = [f"{low:g} to {high:g}"]
        for group in store.groups:
            rows = store.group(group)
            mine = np.array([r.success_rate for r in rows if low <= r.relative_aperture < high and not r.failed])
            error = mine.std(ddof=1) / math.sqrt(mine.size) if mine.size > 1 else math.nan
            line.append(f"{mine.mean():.2f} ± {error:.2f} ({mine.size})" if mine.size else "-")
        lines.append(line)
    return markdown_table(["a", *(f"σ = {group}" for group in store.groups)], lines)


def draw(store: Store, path: Path) -> None:
    """Draw the success rate over the pupil's width, for each noise."""
    from matplotlib.lines import Line2D

    figure, axes = new_figure(6.4, 4.3)
    place = axes[0, 0]
    for group, color in store.colors.items():
        at, value = _samples(store.group(group))
        place.semilogx(np.exp(at), value, "o", color=color, ms=4, alpha=0.5, mec="none")
        place.semilogx(np.exp(_tried(at)), smoothed(at, value, _tried(at)), color=color, lw=1.5)
        for measure, style in DRAWN.items():
            for width in best_pupil.predicted(store.noise_sigma(group), (measure,)):
                if width != "-":
                    place.axvline(float(width), color=color, ls=style, lw=1, alpha=0.6)
    place.axhline(CHANCE, color="#999999", lw=0.8, ls="-.")
    ticks = [0.05, 0.1, 0.2, 0.3, 0.5]
    place.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    place.minorticks_off()
    lines = [Line2D([], [], color=color, marker="o", ms=4, label=f"σ = {g}") for g, color in store.colors.items()]
    named = {"contrast": "best by contrast", "stripes_2": "best by stripes of two receptors"}
    lines += [Line2D([], [], color="#444444", lw=1, ls=style, label=named[m]) for m, style in DRAWN.items()]
    lines.append(Line2D([], [], color="#999999", lw=0.8, ls="-.", label="chance"))
    figure.legend(handles=lines, frameon=False, fontsize=8, loc="outside lower center", ncols=3)
    place.set(xlabel="relative aperture a", ylabel="goal reached before any adversary", ylim=(0, 1))
    figure.suptitle("In brighter light, animals learn best behind narrower pinholes")
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Collect runs if requested, and make the page."""
    return evolved.main(NAME, __doc__ or "", page, arguments)


if __name__ == "__main__":
    sys.exit(main())
