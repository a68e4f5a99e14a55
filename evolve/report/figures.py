"""Figures of a whole run: fitness, costs, success and genes over the generations, a family tree, and learning curves.

The family tree shows the candidates and the line of descent of the best one.

Each public function draws one figure, and returns it as an SVG element.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from evolve.analysis.fitness_parts import any_costs, fitness_interval, fitness_label
from evolve.analysis.genealogy import descent, nearest_parent
from evolve.analysis.statistics import GenerationStatistics, Trajectory, champions, succeeded
from evolve.report.markup import Html
from evolve.report.svg import drawing, inline, label
from evolve.report.theme import ACCENT, LINE, LINES, MUTED, VERMILLION
from evolve.store.candidate import Candidate

__all__ = [
    "comparison_figure",
    "costs_figure",
    "fitness_figure",
    "gene_figure",
    "genealogy_figure",
    "learning_figure",
    "relief_figure",
    "success_figure",
    "vision_figure",
]

SIZE = (370, 260)
DASHES = ("-", "--", ":", "-.")  # line styles; after the last colour, the colours are repeated with the next style
Generations = Sequence[int] | NDArray[np.int64]


def fitness_figure(rows: Sequence[GenerationStatistics], candidates: Sequence[Candidate]) -> Html:
    """Draw the fitness of each candidate, and the best fitness so far over the generations.

    For each generation, the figure also shows the median of the fitness, and its 10 % and 90 % quantiles.

    rows: statistics of each generation, at least one
    """
    with drawing(*SIZE) as figure:
        axes = figure.subplots()
        _candidates(axes, candidates, [c.fitness for c in candidates])
        generations = [row.generation for row in rows]
        _spread(axes, generations, [r.low for r in rows], [r.median for r in rows], [r.high for r in rows])
        _confidence(axes, candidates)
        axes.plot(generations, [r.best_so_far for r in rows], color=ACCENT, lw=2, marker="o", ms=4)
        _generation_axis(axes, generations)
        axes.set_ylabel(fitness_label(any_costs(candidates)))
        last = rows[-1]
        alt = f"Fitness over {len(rows)} generations: best {last.best_so_far:.3g}, last median {last.median:.3g}."
        return inline(figure, "fitness", alt)


def costs_figure(candidates: Sequence[Candidate]) -> Html:
    """Draw the two parts of fitness over the generations: task fitness in the upper panel, costs in the lower one.

    Each panel shows all candidates, and the best candidate so far.

    Raises:
        ValueError: no candidate has succeeded.
    """
    best = champions(candidates)
    if not best:
        raise ValueError("no candidate has succeeded: one is needed")
    parts = {
        "task fitness": [candidate.task_fitness for candidate in candidates],
        "costs": [candidate.costs for candidate in candidates],
    }
    ends = {"task fitness": [one.task_fitness for _, one in best], "costs": [one.costs for _, one in best]}
    with drawing(SIZE[0], 300) as figure:
        for axes, (name, values) in zip(figure.subplots(2, sharex=True), parts.items(), strict=True):
            _candidates(axes, candidates, values)
            axes.plot([generation for generation, _ in best], ends[name], color=ACCENT, lw=2, marker="o", ms=4)
            _generation_axis(axes, sorted({candidate.generation for candidate in candidates}))
            axes.set_ylabel(name)
        figure.axes[0].set_xlabel("")
        figure.align_ylabels()
        last = best[-1][1]
        alt = f"Parts of the best fitness: task fitness {last.task_fitness:.3g}, costs {last.costs:.3g}."
        return inline(figure, "costs", alt)


def comparison_figure(curves: Mapping[str, Sequence[GenerationStatistics]]) -> Html:
    """Draw the best fitness so far over the generations, with one line for each run.

    curves: statistics of each generation, by name of the run
    """
    with drawing(460, 300) as figure:
        axes = figure.subplots()
        for place, (name, rows) in enumerate(curves.items()):
            colour, dashes = LINES[place % len(LINES)], DASHES[place // len(LINES) % len(DASHES)]
            generations, best = [row.generation for row in rows], [row.best_so_far for row in rows]
            axes.plot(generations, best, color=colour, ls=dashes, lw=2, marker="o", ms=4, label=label(name))
        longest = max((len(rows) for rows in curves.values()), default=1)
        _generation_axis(axes, range(longest))
        axes.set_ylabel("best fitness so far")
        if curves:
            axes.legend(frameon=False, labelcolor=MUTED)
        return inline(figure, "comparison", f"Best fitness so far of {len(curves)} runs over the generations.")


def genealogy_figure(candidates: Sequence[Candidate], best: Candidate) -> Html:
    """Draw successful candidates at their generation and fitness, connected with their parents by lines.

    A line connects a candidate with the parent whose genome is most similar, if this parent has succeeded. The line of
    descent of the best candidate has the accent colour.
    """
    known = {candidate.id: candidate for candidate in candidates}
    population = max(candidate.index for candidate in candidates) + 1
    with drawing(*SIZE) as figure:
        axes = figure.subplots()

        def place(candidate: Candidate) -> tuple[float, float]:
            aside = 0.5 * (candidate.index / max(population - 1, 1) - 0.5)
            return candidate.generation + aside, candidate.fitness

        for candidate in filter(succeeded, candidates):
            parent = nearest_parent(candidate, known)
            if parent is not None and succeeded(parent):
                axes.plot(*zip(place(parent), place(candidate), strict=True), color=MUTED, alpha=0.25, lw=0.7)
        _candidates(axes, candidates, [c.fitness for c in candidates])
        _links(axes, candidates, place)
        line = [candidate for candidate in descent(best, candidates) if succeeded(candidate)]
        axes.plot(*zip(*map(place, line), strict=True), color=ACCENT, lw=2, marker="o", ms=4)
        _generation_axis(axes, sorted({candidate.generation for candidate in candidates}))
        axes.set_ylabel(fitness_label(any_costs(candidates)))
        return inline(figure, "genealogy", f"Descent of candidate {best.id} over {len(line)} generations of its line.")


def _links(axes: Axes, candidates: Sequence[Candidate], place: Callable[[Candidate], tuple[float, float]]) -> None:
    """Add invisible links over the candidates' dots; each link leads to the candidate's row in the table."""
    good = [candidate for candidate in candidates if succeeded(candidate)]
    x, y = np.transpose([place(candidate) for candidate in good])
    dots = axes.scatter(x, y, s=90, color=ACCENT, alpha=0.0)
    dots.set_urls([f"#candidate-{candidate.id}" for candidate in good])


def vision_figure(name: str, label: str, generations: Sequence[int], values: Sequence[float]) -> Html:
    """Draw how a measure of image quality changes over the generations, for the best eye found so far.

    name: name of the measure, for ids and for screen readers
    label: label of the vertical axis
    """
    with drawing(250, 165, font=10.5) as figure:
        axes = figure.subplots()
        axes.plot(generations, values, color=ACCENT, lw=1.8, marker="o", ms=3)
        _generation_axis(axes, generations)
        axes.yaxis.set_major_locator(MaxNLocator(4))
        axes.set_ylabel(label)
        return inline(figure, f"vision-{name}", f"{name}: {values[-1]:.3g} in the best eye of all.")


def success_figure(candidates: Sequence[Candidate]) -> Html:
    """Draw the fraction of evaluation episodes that were solved, over the generations."""
    with drawing(*SIZE) as figure:
        axes = figure.subplots()
        _candidates(axes, candidates, [100 * c.success_rate for c in candidates])
        generations = sorted({c.generation for c in candidates})
        finished = [[c for c in candidates if c.generation == g and succeeded(c)] for g in generations]
        means = [100 * float(np.mean([c.success_rate for c in group])) if group else np.nan for group in finished]
        axes.plot(generations, means, color=MUTED, lw=1.5, marker="o", ms=3)
        _generation_axis(axes, generations)
        axes.set_ylim(-4, 104)
        axes.set_ylabel("episodes solved [%]")
        return inline(figure, "success", f"Mean success rate of the last generation: {means[-1]:.0f} %.")


def learning_figure(candidates: Sequence[Candidate], best: Candidate) -> Html:
    """Draw the learning curve of each candidate: mean return of an evaluation against the number of training steps.

    The curve of the best candidate has the accent colour.
    """
    with drawing(*SIZE) as figure:
        axes = figure.subplots()
        faint = float(np.clip(8 / len(candidates), 0.08, 0.4))
        for candidate in candidates:
            if candidate.curve and candidate.id != best.id:
                steps, returns = np.transpose(candidate.curve)
                axes.plot(steps / 1000, returns, color=MUTED, alpha=faint, lw=0.9, marker="o", ms=2, mew=0)
        if best.curve:
            steps, returns = np.transpose(best.curve)
            axes.plot(steps / 1000, returns, color=ACCENT, lw=2, marker="o", ms=4)
        axes.set_xlim(left=0)
        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.set_xlabel("training [thousand agent steps]")
        axes.set_ylabel("mean return")
        return inline(figure, "learning", "Learning curves of all candidates, the best one's highlighted.")


def gene_figure(
    name: str, label: str, path: Trajectory, limits: tuple[float, float] | None, whole: bool = False
) -> Html:
    """Draw the values of one gene over the generations.

    label: label of the vertical axis
    limits: range of the vertical axis; None: the range of the values
    whole: True if the ticks of this axis are integers
    """
    with drawing(250, 165, font=10.5) as figure:
        axes = figure.subplots()
        _trajectory(axes, path)
        if limits is not None:
            margin = 0.05 * (limits[1] - limits[0])
            axes.set_ylim(limits[0] - margin, limits[1] + margin)
        axes.yaxis.set_major_locator(MaxNLocator(4, integer=whole, steps=[1, 2, 3, 5, 10]))
        axes.set_ylabel(label)
        alt = f"{name}: best {path.best[-1]:.3g}, median of the last generation {path.median[-1]:.3g}."
        return inline(figure, f"gene-{name}", alt)


def relief_figure(paths: dict[str, Trajectory]) -> Html:
    """Draw the relief's genes over the generations, each in a panel at the gene's position in the pupil.

    paths: trajectory of each gene by its name, doe_ROWCOLUMN; row 0 is at the lowest y, and therefore at the bottom
    """
    with drawing(440, 340) as figure:
        rows = sorted({name[-2] for name in paths}, reverse=True)
        columns = sorted({name[-1] for name in paths})
        axes = figure.subplots(len(rows), len(columns), sharex=True, sharey=True, squeeze=False)
        for i, row in enumerate(rows):
            for j, column in enumerate(columns):
                panel = axes[i, j]
                if (path := paths.get(f"doe_{row}{column}")) is None:
                    panel.set_axis_off()
                    continue
                _trajectory(panel, path, marker_size=2)
                panel.set_xlabel("")
                panel.set_ylim(-0.08, 1.08)
                panel.set_yticks([0, 1])
                panel.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=3, min_n_ticks=1))
        figure.supxlabel("generation", color=MUTED, fontsize=11)
        figure.supylabel("gene (height / relief height)", color=MUTED, fontsize=11)
        return inline(figure, "relief", f"The {len(paths)} genes of the pupil's relief over the generations.")


def _trajectory(axes: Axes, path: Trajectory, marker_size: float = 3) -> None:
    _spread(axes, path.generations, path.low, path.median, path.high)
    axes.plot(path.generations, path.best, color=ACCENT, lw=1.8, marker="o", ms=marker_size)
    _generation_axis(axes, path.generations)


def _spread(axes: Axes, x: Generations, low: ArrayLike, median: ArrayLike, high: ArrayLike) -> None:
    """Draw the median of a quantity in each generation, and a band between its 10 % and 90 % quantiles.

    A single generation has a bar instead, because a band would have no width.
    """
    if len(x) == 1:
        axes.vlines(x, low, high, color=MUTED, alpha=0.4, lw=6)
    axes.fill_between(x, low, high, color=MUTED, alpha=0.18, lw=0)
    axes.plot(x, median, color=MUTED, lw=1.3, marker="o" if len(x) < 4 else None, ms=2.5)


def _candidates(axes: Axes, candidates: Sequence[Candidate], values: Sequence[float]) -> None:
    """Draw a dot for each successful candidate, and a cross at the bottom for each failed one.

    The candidates of a generation are spread horizontally.
    """
    generations = np.array([c.generation for c in candidates], float)
    population = max(c.index for c in candidates) + 1
    x = generations + 0.5 * (np.array([c.index for c in candidates]) / max(population - 1, 1) - 0.5)
    good = np.array([succeeded(c) for c in candidates])
    axes.plot(x[good], np.asarray(values, float)[good], ls="none", marker="o", ms=3.2, mew=0, color=MUTED, alpha=0.6)
    bottom = axes.get_xaxis_transform()
    axes.plot(x[~good], np.full((~good).sum(), 0.02), ls="none", marker="x", ms=4, color=VERMILLION, transform=bottom)


def _confidence(axes: Axes, candidates: Sequence[Candidate]) -> None:
    """Draw the 95 % interval of the best fitness so far."""
    best = [(generation, champion) for generation, champion in champions(candidates) if champion.returns]
    if best:
        low, high = zip(*(fitness_interval(champion) for _, champion in best), strict=True)
        axes.fill_between([generation for generation, _ in best], low, high, color=ACCENT, alpha=0.15, lw=0)


def _generation_axis(axes: Axes, generations: Generations) -> None:
    axes.set_xlim(min(generations) - 0.5, max(generations) + 0.5)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=6, min_n_ticks=1))
    axes.set_xlabel("generation")
    axes.tick_params(color=LINE)
