"""Eyes learn to bend light: first the pupil evolves, then relief and index join it

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
from experiments import evolved
from experiments.candidates import Row
from experiments.evolved import Store
from experiments.means import LAST, last_mean, of_generation
from experiments.page import Figure, Page, markdown_table, new_figure, save

__all__ = ["page"]

NAME = "bending_light"
COLORS = ("#0072B2", "#D55E00", "#009E73", "#B8568F", "#777777")
QUANTITIES: dict[str, Callable[[Row], float]] = {
    "relative aperture a": lambda row: row.relative_aperture,
    "refractive index": lambda row: row.refractive_index,
    "Strehl ratio": lambda row: row.strehl,
    "image quality": lambda row: row.image_quality,
    "contrast above the noise": lambda row: row.above_noise,
    "PSNR [dB]": lambda row: row.psnr_db,
    "SSIM": lambda row: row.ssim,
    "fitness": lambda row: row.fitness,
}


def page(store: Store) -> Page:
    """The page of stored runs."""
    return Page(
        name=NAME,
        title="Eyes learn to bend light",
        question=(
            "Does a pupil that evolves alone close, and open again when the glass in it may become a lens? Published: "
            "it does both. Controls: an index held at 1, where no lens can be; other noise, which moves the best pupil "
            "([where to](best_pupil.md))."
        ),
        answer=store.answer,
        method=(
            "Aperture, index and fitness are means over a generation's candidates, the other measures those of its "
            "best; a line per seed, all seeds are shown; dotted: relief and index join. PSNR and SSIM compare with a "
            "perfect lens, brightness made equal. Tables have means of the phases' last "
            f"{LAST} generations with 95 % intervals, by a bootstrap over seeds and candidates."
        ),
        command=(
            "evolve run --preset lens --seed 0    # and 1, 2\n"
            "evolve run --preset lens --set genome.refractive_index.open=false --set genome.refractive_index.start=1 "
            "--set genome.doe.open=false\n"
            "evolve run --preset lens --set eye.noise_sigma=0.003\n"
            "python -m experiments.bending_light --runs lens=DIR index1=DIR bright=DIR"
        ),
        figures=[
            Figure(NAME, lambda path: draw(store, path), f"Generation by generation: {_legend(store)}."),
            Figure(
                f"{NAME}_reliefs",
                lambda path: draw_reliefs(store, path),
                "Reliefs of the fittest and of the least fit of each seed's last generations, over the pupil; heights "
                "in units of the gene.",
            ),
        ],
        tables=[part for phase in (0, 1) for part in (f"End of phase {'I' * (phase + 1)}:", table(store, phase))],
        origin=store.origin,
    )


def _legend(store: Store) -> str:
    names = ("blue", "orange", "green", "purple", "grey")
    return ", ".join(f"{group} {names[min(i, 4)]}" for i, group in enumerate(store.groups))


def table(store: Store, phase: int) -> str:
    """A row per quantity, a column per variant."""
    lines = []
    for name, value in QUANTITIES.items():
        found = [last_mean([r for r in store.group(g) if r.phase == phase], value) for g in store.groups]
        lines.append([name, *("-" if f is None else str(f) for f in found)])
    return markdown_table(["", *store.groups], lines)


def draw(store: Store, path: Path) -> None:
    """A panel per quantity, a line per seed."""
    figure, axes = new_figure(11, 5.2, columns=4, rows=2, sharex=True)
    for place, (name, value) in zip(axes.flat, QUANTITIES.items(), strict=True):
        for i, group in enumerate(store.groups):
            rows = store.group(group)
            for seed in sorted({row.seed for row in rows}):
                mine = [row for row in rows if row.seed == seed]
                place.plot(*of_generation(mine, value), color=COLORS[min(i, 4)], lw=1.2)
            later = [row.generation for row in rows if row.phase > 0]
            if later:
                place.axvline(min(later) - 0.5, color="#777777", ls=":", lw=1)
        place.set_title(name, fontsize=10)
    for place in axes[1]:
        place.set_xlabel("generation")
    save(figure, path)


def extremes(rows: Sequence[Row]) -> tuple[Row, Row] | tuple[()]:
    """The fittest and the least fit of the last generations, of the last phase if that was shorter; () where none of
    them succeeded."""
    first = max(row.generation for row in rows) - LAST + 1
    late = [r for r in rows if r.generation >= first and r.phase == max(row.phase for row in rows)]
    done = sorted((row for row in late if row.relief and not row.failed), key=lambda row: row.fitness)
    return (done[-1], done[0]) if done else ()


def relief_of(row: Row) -> optics.BSplineRelief | np.ndarray:
    """A row's relief as a pupil of radius 1 takes it: one patch of 4 x 4 genes, or the heights that more genes are."""
    points = np.array(row.relief.split(), float)
    side = math.isqrt(points.size)
    return optics.BSplineRelief(points.reshape(side, side)) if side == 4 else points.reshape(side, side)


def draw_reliefs(store: Store, path: Path) -> None:
    """Height maps, two per seed."""
    runs = [(g, s) for g in store.groups for s in sorted({row.seed for row in store.group(g)})]
    figure, axes = new_figure(max(4.0, 1.7 * len(runs)), 3.8, columns=len(runs), rows=2)
    for column, (group, seed) in enumerate(runs):
        chosen = extremes([row for row in store.group(group) if row.seed == seed])
        for place in axes[:, column]:
            place.set_axis_off()
        for place, row, what in zip(axes[:, column], chosen, ("fittest", "least fit"), strict=False):
            heights, inside = relief_heights(optics.Pupil(1.0, relief_of(row)))
            shown = place.imshow(np.where(inside, heights, np.nan), origin="lower")
            figure.colorbar(shown, ax=place, shrink=0.7)
            place.set_title(
                f"{group}, seed {seed}\n{what}: a = {row.relative_aperture:.2f}, n = {row.refractive_index:.2f}",
                fontsize=7,
            )
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Collect runs if asked, and make the page."""
    return evolved.main(NAME, __doc__ or "", page, arguments)


if __name__ == "__main__":
    sys.exit(main())
