"""Cost of the automatic choice of samples for different resolutions, fields of view and numbers of eyes

Are there eyes for which a slight change makes the automatic choice ("auto") use many more samples? No. In every setting
it chooses area sampling, in which each sample is the mean light on a receptor or a part of it (an area). One to six
areas per receptor are enough for a predicted error within the tolerance, which is half of the receptor noise.

**Method.** `sim.choose_fidelity` chooses samples for eyes with perfect lenses in detection, a maze and navigation. One
property changes at a time: the number of receptors across, the field of view, or the number of eyes. Detection has
square eyes. Mazes and navigation have eyes of a single row, as in the evolved animals. Then 64 worlds are rendered with
the chosen samples.

**Table.** The column *error* states the predicted error divided by the tolerance. This error does not include the error
that the eyes' spectral bands cause. Times are the median CPU time per frame and receptor, relative to the smallest
value of the same task. The time per receptor is longer if eyes have few receptors, because the work that is done once
per world or per eye is then divided by fewer receptors.

**Bounds.** No error is above 1, and in no setting are rays chosen instead of areas. If the resolutions of two
neighbouring rows of the table differ by at most three receptors, their numbers of samples differ by at most a factor of
three.

    python -m validation.sim.automatic_choice [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import math
import sys
import time
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

import sim
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation
from validation.pages.page import Page, parser
from validation.pages.tables import write_table

WORLDS, LOOKS, WARM_UP = 64, 9, 2
RECEPTORS, FIELD, EYES = "receptors across", "field of view [deg]", "eyes"
SQUARE = (4, 8, 16, 24, 32, 48, 56, 57, 60, 62, 63, 64, 65, 80, 84)
ROW = (1, 2, 4, 8, 11, 12, 16, 20, 24)
FIELDS, NUMBERS = (10, 20, 45, 70, 90, 120, 150), (1, 2, 4, 8)
SQUARE_EYE, ROW_EYE = (64, 45, 1), (16, 90, 1)  # receptors across, field of view and number of the eyes that are varied
NEXT, FACTOR = 3, 3.0  # resolutions that differ by at most NEXT receptors take at most FACTOR times the samples


@dataclass(frozen=True)
class Choice:
    """Chosen samples of one setting.

    sweep: property in which the setting differs from the preceding one
    samples, number: kind of samples ("rays" or "areas"), and their number per receptor
    error: predicted error relative to the tolerance
    time: CPU time of a frame per receptor [s]
    """

    task: str
    sweep: str
    receptors: int
    fov_deg: float
    eyes: int
    samples: str
    number: float
    error: float
    time: float

    @property
    def value(self) -> float:
        """Value of the property `sweep`."""
        return {RECEPTORS: self.receptors, FIELD: self.fov_deg, EYES: self.eyes}[self.sweep]


def measure(task: str, sweep: str, receptors: int, fov_deg: float, eyes: int) -> Choice:
    """Choose samples for a setting, and time frames with them."""
    world = sim.build_world(task)
    rows = receptors if task == "detection" else 1
    seeing = sim.Eyes(n_eyes=eyes, resolution=(rows, receptors), fov_deg=fov_deg)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sim.FidelityWarning)  # the table shows the error
        fidelity = sim.choose_fidelity(world, seeing, bands="own")
    error = math.hypot(*(level.predicted_error or 0 for level in fidelity.levels[1:])) / (fidelity.tolerance or 1)
    renderer, state = (
        sim.BatchedRenderer(world, seeing, WORLDS, fidelity),
        Simulation(task_of(world), WORLDS, 0).reset(),
    )
    times = []
    for _ in range(WARM_UP + LOOKS):
        start = time.process_time()
        renderer.signals(state)
        times.append(time.process_time() - start)
    per_receptor = float(np.median(times[WARM_UP:])) / (WORLDS * eyes * rows * receptors)
    samples, number = fidelity.samples, fidelity.rays_per_receptor
    return Choice(task, sweep, receptors, fov_deg, eyes, samples, number, error, per_receptor)


def settings() -> list[tuple[str, str, int, float, int]]:
    """Return task, sweep, receptors across, field of view and number of eyes of all settings."""
    found: list[tuple[str, str, int, float, int]] = []
    for task in ("detection", "maze", "navigation"):
        numbers, (receptors, field, eyes) = (SQUARE, SQUARE_EYE) if task == "detection" else (ROW, ROW_EYE)
        found += [(task, RECEPTORS, n, field, eyes) for n in numbers]
        found += [(task, FIELD, receptors, fov, eyes) for fov in FIELDS]
        found += [(task, EYES, receptors, field, n) for n in NUMBERS]
    return found


def broken_bounds(choices: Sequence[Choice]) -> list[str]:
    """Return the descriptions of the bounds that do not hold."""
    broken = []
    for c in choices:
        name = f"{c.task}, {c.eyes} eyes of {c.receptors} over {c.fov_deg:g}°"
        if c.error > 1:
            broken.append(f"{name}: the predicted error is {c.error:.2f} times the tolerance")
        if c.samples != "areas":
            broken.append(f"{name}: {c.number:g} {c.samples} per receptor")
    for one, other in pairwise(choices):
        near = one.task == other.task and one.sweep == other.sweep == RECEPTORS
        if near and other.receptors - one.receptors <= NEXT:
            ratio = max(one.number, other.number) / min(one.number, other.number)
            if ratio > FACTOR:
                broken.append(f"{one.task}: {one.receptors} and {other.receptors} receptors differ by {ratio:.3g}")
    return broken


def relative_times(choices: Sequence[Choice]) -> list[float]:
    """Return the times relative to the smallest of the same task."""
    least = {c.task: min(o.time for o in choices if o.task == c.task) for c in choices}
    return [c.time / least[c.task] for c in choices]


def table(choices: Sequence[Choice]) -> str:
    lines = ["task        receptors  field  eyes  per receptor  error  time"]
    for c, duration in zip(choices, relative_times(choices), strict=True):
        size = f"{c.receptors if c.task == 'detection' else 1} x {c.receptors}"
        samples = f"{c.number:g} {c.samples.removesuffix('s') if c.number == 1 else c.samples}"
        lines.append(
            f"{c.task:<11} {size:>9} {c.fov_deg:>5g}° {c.eyes:>5} {samples:>13} {c.error:>6.2f} {duration:>5.2f}"
        )
    return "\n".join(lines)


COLORS = {"detection": "#0072B2", "maze": "#D55E00", "navigation": "#009E73"}


def draw(choices: Sequence[Choice], path: Path) -> None:
    """Draw one column per sweep: samples and time per receptor above, predicted error below."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 6.5), layout="constrained")
    rows = figure.subplots(3, 3, sharex="col", sharey="row")
    found = list(zip(choices, relative_times(choices), strict=True))
    for column, sweep in zip(rows.T, (RECEPTORS, FIELD, EYES), strict=True):
        for task, color in COLORS.items():
            own = [(c, duration) for c, duration in found if (c.task, c.sweep) == (task, sweep)]
            at = [c.value for c, _ in own]
            heights = [c.number for c, _ in own], [duration for _, duration in own], [c.error for c, _ in own]
            for axes, values in zip(column, heights, strict=True):
                axes.plot(at, values, "o-", ms=4, lw=1, color=color, label=task)
        column[0].set(yscale="log", yticks=[1, 2, 4, 6], yticklabels=["1", "2", "4", "6"])
        column[0].minorticks_off()
        column[1].set(yscale="log", yticks=[1, 3, 10, 30], yticklabels=["1", "3", "10", "30"])
        column[1].minorticks_off()
        column[2].set(xlabel=sweep, ylim=(0, 1.1))
        column[2].axhline(1, color="black", ls=":", lw=1)
        if sweep == EYES:
            column[2].set(xscale="log", xticks=NUMBERS, xticklabels=[str(n) for n in NUMBERS])
            column[2].minorticks_off()
    labels = ("areas per receptor", "time per receptor\n(least of the task = 1)", "error / tolerance")
    for axes, label in zip(rows[:, 0], labels, strict=True):
        axes.set_ylabel(label)
    figure.legend(*rows[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=3, frameon=False)
    figure.suptitle("The automatic choice stays cheap and within the tolerance", x=0.02, ha="left")
    figure.savefig(path, dpi=110)


def main(arguments: list[str] | None = None) -> int:
    options = parser(__doc__ or "").parse_args(arguments)
    choices = [measure(*setting) for setting in settings()]
    if options.docs:
        write_table(options.docs / "data" / "automatic_choice.csv", [asdict(c) for c in choices])
    page = Page("automatic_choice", __doc__ or "", table(choices), broken_bounds(choices))
    return page.publish(options, lambda path: draw(choices, path))


if __name__ == "__main__":
    sys.exit(main())
