"""Evolution of pupils and lenses: first the pupil evolves, then relief and refractive index as well

python -m experiments.bending_light [--runs VARIANT=DIR ...] [--answer TEXT] [--docs DIR]
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

import optics
from evolve.report.eye_figures import relief_heights
from experiments import best_pupil, evolved
from experiments.candidates import Row
from experiments.drift import SEEDS, shade
from experiments.evolved import Store, conduct_table, null_model, null_table
from experiments.glass import relief_of
from experiments.means import LAST, last_mean, last_values, of_generation
from experiments.page import Figure, Page, markdown_table, new_figure, save
from experiments.store import read_rows

__all__ = ["page"]

NAME = "bending_light"
MEASURES = ("contrast", "stripes_1", "stripes_2", "stripes_4")
MOST_POWER = 2.0  # limit, because a high power has little effect behind a narrow pupil
QUANTITIES: dict[str, Callable[[Row], float]] = {
    "relative aperture a": lambda row: row.relative_aperture,
    "refractive index": lambda row: row.refractive_index,
    "contrast above the noise": lambda row: row.above_noise,
    "contribution of the glass": lambda row: row.above_noise - row.above_noise_of_hole,
    "power of the glass": lambda row: min(max(row.glass_power, -MOST_POWER), MOST_POWER),
    "Strehl ratio": lambda row: row.strehl,
    "image quality": lambda row: row.image_quality,
    "PSNR [dB]": lambda row: row.psnr_db,
    "SSIM": lambda row: row.ssim,
    "fitness": lambda row: row.fitness,
    "success rate": lambda row: row.success_rate,
}


def page(store: Store) -> Page:
    """Return the page of results, made from stored runs.

    Raises:
        ValueError: there are more groups than colours.
    """
    return Page(
        name=NAME,
        command=(
            "SETTINGS='--set eye.noise_sigma=0.003 --set search.population=16 --set search.active=true'\n"
            "evolve run --preset lens $SETTINGS --seed 0    # and 1 and 2\n"
            "evolve run --preset lens $SETTINGS --set genome.refractive_index.open=false"
            " --set genome.refractive_index.start=1 --seed 0    # and 1\n"
            "python -m experiments.bending_light --runs lens=DIR lens=DIR lens=DIR index1=DIR index1=DIR"
        ),
        values={
            "answer": store.answer,
            "legend": store.legend,
            "last": str(LAST),
            "searches": str(SEEDS),
            "end_of_phase_1": table(store, 0),
            "end_of_phase_2": table(store, 1),
            "best_holes": prediction(store),
            "p_of_phase_1": null_table(store, QUANTITIES, 0),
            "p_of_phase_2": null_table(store, QUANTITIES, 1),
            "runs": conduct_table(store),
        },
        figures=[
            Figure(NAME, lambda path: draw(store, path)),
            Figure(f"{NAME}_reliefs", lambda path: draw_reliefs(store, path)),
        ],
        origin=store.origin,
    )


def joining(store: Store) -> int | None:
    """Return the first generation of phase II, from which relief and index evolve too; None without a phase II."""
    return min((row.generation for row in store.rows if row.phase > 0), default=None)


def of_phase(store: Store, group: str, phase: int) -> list[Row]:
    """Return the rows of a group in phase I or in phase II.

    A group whose genes are all open from the start is divided at the same generation as the other groups.
    """
    start = joining(store)
    rows = store.group(group)
    if start is None:
        return rows if phase == 0 else []
    return [row for row in rows if (row.generation >= start) == bool(phase)]


def table(store: Store, phase: int) -> str:
    """Return a table of the quantities at the end of a phase, in Markdown: two columns for each group of runs."""
    header = ["", *(f"{group}{what}" for group in store.groups for what in ("", ", null model"))]
    lines = []
    for name, value in QUANTITIES.items():
        line = [name]
        for group in store.groups:
            rows = of_phase(store, group, phase)
            found = last_mean(rows, value)
            drift = null_model(store, group, name, rows)
            line += ["-" if found is None else str(found), "" if drift is None or found is None else str(drift)]
        lines.append(line)
    return markdown_table(header, lines)


def prediction(store: Store) -> str:
    """Return a table that compares the pupils at the end of phase I with the best pinhole by each measure."""
    lines = []
    for group in store.groups:
        sigma = store.noise_sigma(group)
        found = last_mean(of_phase(store, group, 0), QUANTITIES["relative aperture a"])
        lines.append(
            [group, f"{sigma:g}", "-" if found is None else str(found), *best_pupil.predicted(sigma, MEASURES)]
        )
    return markdown_table(
        ["", "noise σ", "a at the end of phase I", *(f"best by {best_pupil.MEASURES[m]}" for m in MEASURES)], lines
    )


def draw(store: Store, path: Path) -> None:
    """Draw each quantity over the generations, in a panel with a line per seed; the last panel is the legend."""
    figure, axes = new_figure(15, 5.6, columns=(len(QUANTITIES) + 2) // 2, rows=2, sharex=True)
    for place, (name, value) in zip(axes.flat, QUANTITIES.items(), strict=False):
        for group, color in store.colors.items():
            rows = store.group(group)
            shade(place, store.drift_of(group, name), color)
            for seed in sorted({row.seed for row in rows}):
                mine = [row for row in rows if row.seed == seed]
                place.plot(*of_generation(mine, value), color=color, lw=1.2)
        if (start := joining(store)) is not None:
            place.axvline(start - 0.5, color="#777777", ls=":", lw=1)
        place.set_title(name, fontsize=10)
    holes = read_rows(best_pupil.Row, best_pupil.STORED)
    axes[0, 0].axhline(
        best_pupil.best(holes, "hole", holes[0].noise_sigma, "stripes_2"), color="#777777", ls="--", lw=1
    )
    for place in axes[1]:
        place.set_xlabel("generation")
    axes[-1, -1].set_axis_off()
    for group, color in store.colors.items():
        control = "" if group in lenses(store) else ": no lens possible"
        axes[-1, -1].plot([], [], color=color, lw=2, label=f"{group}{control}")
    axes[-1, -1].fill_between([], [], [], color="#777777", alpha=0.2, label="null model")
    axes[-1, -1].plot([], [], color="#777777", ls="--", label="best pinhole for stripes")
    axes[-1, -1].plot([], [], color="#777777", ls=":", label="start of phase II")
    axes[-1, -1].legend(loc="center", frameon=False)
    figure.suptitle(message(store))
    save(figure, path)


def message(store: Store) -> str:
    """Return the figure's title: the numbers of pupils that close in phase I and that reopen in phase II."""
    found = [(group in lenses(store), pupils(store, group, seed)) for group, seed in searches(store)]
    closed = sum(alone < begun for _, (begun, alone, _) in found)
    opened = {may: [end > alone for its, (_, alone, end) in found if its == may] for may in (True, False)}
    with_, without = (f"{sum(of)} of {len(of)}" for of in opened.values())
    return (
        f"In phase I, {closed} of {len(found)} pupils close; in phase II, {with_} reopen if a lens is possible, "
        f"and {without} if not"
    )


def searches(store: Store) -> list[tuple[str, int]]:
    """Return the group and seed of each search."""
    return [(group, seed) for group in store.groups for seed in sorted({row.seed for row in store.group(group)})]


def lenses(store: Store) -> set[str]:
    """Return the groups in whose runs relief and index evolve, so that a lens is possible."""
    return {row.group for row in store.rows if row.refractive_index != 1}


def pupils(store: Store, group: str, seed: int) -> tuple[float, float, float]:
    """Return a search's mean relative aperture in the first generation and at the ends of phases I and II.

    NaN stands for a phase that the search has not reached.
    """
    phases = ([row for row in of_phase(store, group, phase) if row.seed == seed] for phase in (0, 1))
    alone, joined = (of_generation(rows, QUANTITIES["relative aperture a"])[1] for rows in phases)
    begun, closed, end = (
        float(of.mean()) if of.size else math.nan for of in (alone[:1], alone[-LAST:], joined[-LAST:])
    )
    return begun, closed, end


def extremes(rows: Sequence[Row]) -> tuple[Row, Row] | tuple[()]:
    """Return the fittest and the least fit animal of the last generations within the last phase.

    The result is () if every animal with a relief failed.
    """
    first = max(row.generation for row in rows) - LAST + 1
    late = [r for r in rows if r.generation >= first and r.phase == max(row.phase for row in rows)]
    done = sorted((row for row in late if row.relief and not row.failed), key=lambda row: row.fitness)
    return (done[-1], done[0]) if done else ()


def draw_reliefs(store: Store, path: Path) -> None:
    """Draw height maps, two per seed, with a common colour scale."""
    runs = searches(store)
    figure, axes = new_figure(max(4.0, 1.7 * len(runs)), 4.2, columns=len(runs), rows=2)
    chosen = {run: extremes([row for row in store.group(run[0]) if row.seed == run[1]]) for run in runs}
    maps = {(run, i): longer(row, store) for run, rows in chosen.items() for i, row in enumerate(rows)}
    most = max((float(np.nanmax(one)) for one in maps.values()), default=1.0) or 1.0
    for place in axes.flat:
        place.set_axis_off()
    for column, run in enumerate(runs):
        for i, (row, what) in enumerate(zip(chosen[run], ("fittest", "least fit"), strict=False)):
            shown = axes[i, column].imshow(maps[run, i], origin="lower", vmin=0, vmax=most)
            title = f"{run[0]}, seed {run[1]}\n{what}: a = {row.relative_aperture:.2f}, n = {row.refractive_index:.2f}"
            axes[i, column].set_title(title, fontsize=7)
    if maps:
        figure.colorbar(shown, ax=axes, shrink=0.7, label="optical path through the relief [µm]")
    figure.suptitle(message_of_reliefs(store))
    save(figure, path)


def message_of_reliefs(store: Store) -> str:
    """Return the figure's title: the number of animals with converging glass in the last generations."""
    late = [
        power
        for group in store.groups if group in lenses(store)
        for powers in last_values(of_phase(store, group, 1), QUANTITIES["power of the glass"])
        for power in powers
    ]  # fmt: skip
    return f"If a lens is possible, glass converges light in {sum(p > 0 for p in late)} of the last {len(late)} animals"


def longer(row: Row, store: Store) -> np.ndarray:
    """Return the optical path through the relief minus its minimum, over the pupil's square [µm].

    It is NaN outside the aperture.
    """
    unit = next((one.relief_height for one in store.run_metadata if one.group == row.group), 0.0)
    heights, inside = relief_heights(optics.Pupil(1.0, relief_of(np.array(row.relief.split(), float))))
    path = 1e6 * unit * (row.refractive_index - 1) * heights
    return np.where(inside, path - path[inside].min(), np.nan)


def main(arguments: Sequence[str] | None = None) -> int:
    """Collect runs if requested, and make the page."""
    return evolved.main(NAME, __doc__ or "", page, arguments, QUANTITIES)


if __name__ == "__main__":
    sys.exit(main())
