"""Eyes for tasks: the same animals in both tasks, and in less and less light

python -m experiments.eyes_for_tasks [--compute] [--workers N] [--docs DIR]
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

import sim
from experiments import designed
from experiments.designed import Design, Trained, crossed
from experiments.means import Interval, interval_of, resampled_difference
from experiments.page import Figure, Page, markdown_table, new_figure, save
from experiments.portraits import draw_head
from experiments.store import Origin

__all__ = ["Crossing", "crossing", "designs", "page"]

NAME = "eyes_for_tasks"
TASKS = ("navigation", "detection")
COLORS = {"navigation": "#D55E00", "detection": "#0072B2"}
SETTINGS = ("learning.total_steps=150000", "learning.eval_interval=50000")
BRIGHT, DIM = 0.01, (0.05, 0.15)
SEEDS, SEEDS_IN_DIM_LIGHT = range(6), range(3)
# Eyes, receptors across each, and the arc over which they are spread: from a compound eye to a camera.
SHAPES = ((10, 4, 135.0), (5, 8, 90.0), (2, 15, 45.0), (2, 15, 30.0), (1, 15, 0.0))
COMPOUND, CAMERA = (10, 4), (2, 15)
# Controls in navigation: eyes, receptors (up, across) and arc. A row of square receptors is the lower the finer it is;
# most of these eyes are 45 degrees high instead, as the published ones are at any resolution.
CONTROLS = (
    (10, 4, 4, 135.0),
    (5, 8, 8, 90.0),
    (2, 15, 15, 45.0),
    (2, 15, 15, 30.0),
    (1, 15, 15, 0.0),
    (2, 5, 15, 45.0),
    (10, 1, 4, 45.0),
    (2, 1, 3, 45.0),
)
FEWEST_LIVES = 2  # of any eyes: of one there is no spread
RESAMPLES = 10_000
ROUNDING = 1e-9
NORMAL = 1.96  # standard deviations to either side that hold 95 %
Floats = NDArray[np.float64]
Both: TypeAlias = tuple[Floats, Floats]  # of compound eyes and of cameras


def designs() -> list[Design]:
    """All trainings: every animal in both tasks in bright light, then in less, then the controls in navigation."""
    animals = [Design(TASKS[0], n, w, w, arc, BRIGHT, 0) for n, w, arc in SHAPES]
    return [
        *crossed(animals, TASKS, (BRIGHT,), SEEDS),
        *crossed(animals, TASKS, DIM, SEEDS_IN_DIM_LIGHT),
        *(Design("navigation", n, h, w, arc, BRIGHT, seed) for seed in SEEDS for n, h, w, arc in CONTROLS),
    ]


@dataclass(frozen=True)
class Crossing:
    """Fitness of cameras less that of compound eyes in each task, and the interaction of eye and task.

    interaction: of the difference, in standard deviations of lives with one kind of eyes; in detection less navigation
    p: of as large an interaction where it does not matter who has which eyes (permutations within each task, in
        standard deviations of all its lives: those are the same whoever has which)
    """

    differences: dict[str, Interval]
    interaction: Interval
    p: float


def crossing(rows: Sequence[Trained], chance: np.random.Generator) -> Crossing:
    """Of the trainings in one light.

    Raises:
        ValueError: fewer than two lives of some eyes in a task.
    """
    fitness = {task: (_of(rows, task, COMPOUND), _of(rows, task, CAMERA)) for task in TASKS}
    if min(one.size for both in fitness.values() for one in both) < FEWEST_LIVES:
        raise ValueError(f"a crossing takes {FEWEST_LIVES} lives of each kind of eyes in each task, or more")
    drawn = {task: resampled_difference(both[1], both[0], RESAMPLES, chance) for task, both in fitness.items()}
    dealt = {task: _permuted(*both, chance) for task, both in fitness.items()}
    differences = {task: interval_of(float(_ahead(*fitness[task])), drawn[task]) for task in TASKS}
    null = np.abs(_joint(dealt))
    # Some permutations have the same lives in another order, and sums of theirs round otherwise.
    p = (1 + int((null >= abs(_joint(fitness)) * (1 - ROUNDING)).sum())) / (1 + null.size)
    return Crossing(differences, _interaction(fitness), p)


def _of(rows: Sequence[Trained], task: str, eyes: tuple[int, int]) -> Floats:
    """Fitness of all animals with such eyes that did not fail, wherever the eyes sit."""
    mine = [row for row in rows if not row.failed and row.task == task and (row.n_eyes, row.width) == eyes]
    return np.array([row.fitness for row in mine])


def _permuted(compound: Floats, camera: Floats, chance: np.random.Generator) -> Both:
    """Animals that have been dealt their eyes at random, (RESAMPLES, lives) of each kind."""
    mixed = chance.permuted(np.tile(np.concatenate([compound, camera]), (RESAMPLES, 1)), axis=1)
    return mixed[:, : compound.size], mixed[:, compound.size :]


def _interaction(fitness: Mapping[str, Both]) -> Interval:
    """By how much cameras are ahead in detection, less in navigation, in standard deviations of lives with one kind of
    eyes (Hedges and Olkin 1985, §5.B and E): a bootstrap of so few lives finds them too much alike."""
    mean, variance = 0.0, 0.0
    for sign, (compound, camera) in ((1, fitness["detection"]), (-1, fitness["navigation"])):
        lives = compound.size + camera.size
        squares = sum(float(((of - of.mean()) ** 2).sum()) for of in (compound, camera))
        within = math.sqrt(squares / (lives - 2))
        effect = (1 - 3 / (4 * lives - 9)) * float(_ahead(compound, camera)) / within
        mean += sign * effect
        variance += 1 / compound.size + 1 / camera.size + effect**2 / (2 * lives)
    return Interval(mean, mean - NORMAL * math.sqrt(variance), mean + NORMAL * math.sqrt(variance))


def _joint(fitness: Mapping[str, Both]) -> Floats:
    """The interaction in standard deviations of all lives of a task, which are the same whoever has which eyes."""
    apart = {task: _ahead(*both) / np.concatenate(both, axis=-1).std(axis=-1, ddof=1) for task, both in fitness.items()}
    return np.asarray(apart["detection"] - apart["navigation"])


def _ahead(compound: Floats, camera: Floats) -> Floats:
    return np.asarray(camera.mean(axis=-1) - compound.mean(axis=-1))


def page(rows: Sequence[Trained], origin: Origin, answer: str) -> Page:
    """The page of stored rows."""
    return Page(
        name=NAME,
        command=f"python -m experiments.{NAME} --compute",
        values={
            "answer": answer,
            "steps": f"{max(row.steps for row in rows):,}",
            "lives": ", ".join(_lives(rows, sigma) for sigma in _lights(rows)),
            "fitness": _table(rows, lambda row: row.fitness),
            "success": _table(rows, lambda row: row.success_rate),
            "crossings": _crossings(rows),
            "resamples": f"{RESAMPLES:,}",
        },
        figures=[Figure(NAME, lambda path: draw(rows, path))],
        origin=origin,
    )


def _lights(rows: Iterable[Trained]) -> list[float]:
    return sorted({row.noise_sigma for row in rows})


def _lives(rows: Sequence[Trained], sigma: float) -> str:
    """How many lives each animal has lived in this light, of those that have lived in it."""
    counts = [len(_cell(rows, task, sigma, shape)) for task in TASKS for shape in SHAPES]
    least, most = min(filter(None, counts)), max(counts)
    return f"{least}{f' to {most}' if most > least else ''} at σ = {sigma:g}"


def _table(rows: Sequence[Trained], value: Callable[[Trained], float]) -> str:
    """A row per animal: mean and range over seeds in each task and light."""
    lights = _lights(rows)
    header = ["eyes", *(f"{task}, σ = {sigma:g}" for task in TASKS for sigma in lights)]
    lines = []
    for n, w, arc in SHAPES:
        cells = []
        for task in TASKS:
            for sigma in lights:
                found = [value(row) for row in _cell(rows, task, sigma, (n, w, arc))]
                cells.append(f"{np.mean(found):.3g} [{min(found):.3g}, {max(found):.3g}]" if found else "-")
        lines.append([_named(n, w, arc), *cells])
    return markdown_table(header, lines)


def _cell(rows: Sequence[Trained], task: str, sigma: float, shape: tuple[int, int, float]) -> list[Trained]:
    return [
        row
        for row in rows
        if not row.failed
        and row.task == task
        and row.noise_sigma == sigma
        and (row.n_eyes, row.width, row.placement_range_deg) == shape
    ]


def _named(n: int, w: int, arc: float) -> str:
    return f"{n} of {w} over {arc:g}°" if n > 1 else f"{n} of {w}"


def _of_lights(rows: Sequence[Trained]) -> dict[float, Crossing]:
    """Of those lights in which enough lives have been lived."""
    found = {}
    for sigma in _lights(rows):
        with suppress(ValueError):
            found[sigma] = crossing([row for row in rows if row.noise_sigma == sigma], np.random.default_rng(0))
    return found


def _crossings(rows: Sequence[Trained]) -> str:
    lines = []
    crossings = _of_lights(rows)
    for sigma in _lights(rows):
        found = crossings.get(sigma)
        if found is None:
            lines.append([f"σ = {sigma:g}", *(["-"] * (len(TASKS) + 2))])
            continue
        differences = [str(found.differences[task]) for task in TASKS]
        lines.append([f"σ = {sigma:g}", *differences, str(found.interaction), f"{found.p:.2g}"])
    header = ["light", *(f"{task}: two of 15 less ten of 4" for task in TASKS), "interaction", "p"]
    return markdown_table(header, lines)


def draw(rows: Sequence[Trained], path: Path) -> None:
    """Fitness of each animal in both tasks in bright light; then who is ahead in which light."""
    figure, axes = new_figure(11, 4.6, columns=3, width_ratios=(1.2, 1.2, 1))
    for place, task in zip(axes[0], TASKS, strict=False):
        for x, shape in enumerate(SHAPES):
            found = [row.fitness for row in _cell(rows, task, BRIGHT, shape)]
            place.bar(
                x,
                np.mean(found) if found else 0.0,
                color=COLORS[task],
                alpha=0.35,
                width=0.7,
                label="mean" if x == 0 else None,
            )
            place.plot([x] * len(found), found, "o", color=COLORS[task], ms=4, label="one life" if x == 0 else None)
        place.set_xticks(range(len(SHAPES)), [_named(*shape).replace(" over ", "\n") for shape in SHAPES], fontsize=8)
        place.set(ylabel="fitness")
        place.set_title(f"in {task} fare best:\n{_best(rows, task)}", fontsize=11)
        place.axhline(0, color="#777777", lw=0.6)
        _draw_heads(place)
        place.legend(fontsize=8, frameon=False)
    for task in TASKS:
        crossings = _of_lights(rows)
        ahead = [found.differences[task] for found in crossings.values()]
        y = [one.mean for one in ahead]
        error = [[one.mean - one.low for one in ahead], [one.high - one.mean for one in ahead]]
        axes[0, 2].errorbar(list(crossings), y, error, color=COLORS[task], marker="o", capsize=3, label=task)
    axes[0, 2].axhline(0, color="#777777", lw=0.6)
    axes[0, 2].set(xscale="log", xlabel="noise σ of a receptor (less light: →)", ylabel="two of 15 less ten of 4")
    axes[0, 2].set_title(_told_of_light(_of_lights(rows)), fontsize=11)
    axes[0, 2].legend(fontsize=8, frameon=False)
    save(figure, path)


def _told_of_light(crossings: Mapping[float, Crossing]) -> str:
    """Whether eyes that are ahead in bright light fall behind in less, by more than chance."""
    if len(crossings) < 2:
        return "who is ahead"
    bright, *dim = (crossings[sigma].differences for sigma in sorted(crossings))
    turned = any(
        (one[task].high < 0 < bright[task].mean) or (bright[task].mean < 0 < one[task].low)
        for one in dim
        for task in TASKS
    )
    return "less light turns the order" if turned else "less light does not turn the order"


def _best(rows: Sequence[Trained], task: str) -> str:
    """Of the eyes that have lived in bright light, and those that are nearer to them than a standard error."""
    lived = {shape: [row.fitness for row in _cell(rows, task, BRIGHT, shape)] for shape in SHAPES}
    means = {shape: float(np.mean(found)) for shape, found in lived.items() if found}
    if not means:
        return "none"
    first = max(means, key=lambda shape: means[shape])
    least = means[first] - np.std(lived[first]) / np.sqrt(len(lived[first]))
    return " and ".join(_named(*shape) for shape, mean in means.items() if mean >= least)


def _draw_heads(place: Any) -> None:
    """Below each animal's name its head, with its eyes."""
    for x, (n, w, arc) in enumerate(SHAPES):
        inset = place.inset_axes([(x + 0.1) / len(SHAPES), -0.45, 0.8 / len(SHAPES), 0.25])
        draw_head(inset, sim.Eyes(n_eyes=n, resolution=(1, w), fov_deg=45, placement_range_deg=arc))


def main(arguments: Sequence[str] | None = None) -> int:
    """Train what is missing if asked; make the page from the store."""
    return designed.main(designed.Experiment(NAME, __doc__ or "", designs, SETTINGS, page), arguments)


if __name__ == "__main__":
    sys.exit(main())
