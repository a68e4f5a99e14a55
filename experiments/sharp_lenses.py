"""Sharp lenses: fitness over the power of the glass, for animals that distinguish a goal from distractors

python -m experiments.sharp_lenses [--compute] [--workers N] [--docs DIR]
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from evolve.analysis.white_light import white_strehl
from evolve.config.run_config import EyeConfig
from experiments import designed
from experiments.best_pupil import contrast_of, measures
from experiments.designed import Design, Trained
from experiments.means import Interval, difference
from experiments.page import Figure, Page, markdown_table, new_figure, save
from experiments.store import Origin

__all__ = ["Lens", "designs", "lens_of", "page", "worth"]

NAME = "sharp_lenses"
SIGMA = 0.003
APERTURES = (0.3, 0.45)  # approximate relative apertures of evolved pinholes and of evolved lenses
POWERS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2, 1.3)
SEEDS = range(4)
SETTINGS = ("learning.total_steps=130000", "learning.eval_interval=65000")  # as in the preset `lens`
SHARP = 0.3  # Strehl ratio above which a lens counts as sharp
NEARLY = 0.1  # maximum difference of a nearly sharp lens's contrast from the best, relative to the best
COLOR = "#0072B2"


@dataclass(frozen=True)
class Lens:
    """Quality of a lens.

    strehl: Strehl ratio in white daylight
    contrast: contrast above the noise, see experiments.best_pupil
    """

    strehl: float
    contrast: float


def designs() -> list[Design]:
    """Return all training runs, sorted by seed: two eyes of 15 x 15 receptors, as in the preset `lens`."""
    return [
        Design("detection", 2, 15, 15, 45.0, SIGMA, seed, relative_aperture=a, glass_power=power)
        for seed in SEEDS
        for a in APERTURES
        for power in POWERS
    ]


@cache
def lens_of(aperture: float, power: float) -> Lens:
    """Return the quality of glass of this power in a pupil."""
    design = Design("detection", 2, 15, 15, 45.0, SIGMA, 0, relative_aperture=aperture, glass_power=power)
    eye = design.animal.eyes(EyeConfig(noise_sigma=SIGMA)).eye()
    return Lens(white_strehl(eye, eye.psf()), measures(contrast_of(eye), float(eye.throughput), SIGMA)[1])


def _lives(rows: Sequence[Trained], aperture: float, power: float) -> list[Trained]:
    return [r for r in rows if not r.failed and (r.relative_aperture, r.glass_power) == (aperture, power)]


def _powers(rows: Sequence[Trained], aperture: float) -> list[float]:
    return sorted({row.glass_power for row in rows if row.relative_aperture == aperture and not row.failed})


def worth(rows: Sequence[Trained], aperture: float) -> Interval | None:
    """Return the mean fitness behind sharp lenses minus that behind nearly sharp ones, with Welch's interval.

    A nearly sharp lens is not sharp, but its contrast is nearly that of the best lens in the same pupil. The result is
    None with fewer than two training runs of either kind.
    """
    lenses = {power: lens_of(aperture, power) for power in _powers(rows, aperture)}
    best = max((lens.contrast for lens in lenses.values()), default=math.nan)
    good = {power: lens for power, lens in lenses.items() if lens.contrast >= (1 - NEARLY) * best}
    sharp, nearly = (
        np.array([r.fitness for p, lens in good.items() if kind(lens) for r in _lives(rows, aperture, p)])
        for kind in (_is_sharp, lambda lens: not _is_sharp(lens))
    )
    return difference(sharp, nearly) if min(sharp.size, nearly.size) > 1 else None


def _is_sharp(lens: Lens) -> bool:
    return lens.strehl > SHARP


def page(rows: Sequence[Trained], origin: Origin, answer: str) -> Page:
    """Return the page of results, made from stored rows."""
    lives = [len(_lives(rows, a, p)) for a in APERTURES for p in _powers(rows, a)]
    return Page(
        name=NAME,
        command=f"python -m experiments.{NAME} --compute",
        values={
            "answer": answer,
            "lenses": _table(rows),
            "worth": _worths(rows),
            "sigma": f"{SIGMA:g}",
            "sharp": f"{SHARP:g}",
            "nearly": f"{100 * NEARLY:g} %",
            "steps": f"{max(row.steps for row in rows):,}",
            "lives": f"{min(lives)}" if min(lives) == max(lives) else f"{min(lives)} or {max(lives)}",
        },
        figures=[Figure(NAME, lambda path: draw(rows, path))],
        origin=origin,
    )


def _table(rows: Sequence[Trained]) -> str:
    """Return a table of fitness and optical quality, with a row per lens."""
    lines = []
    for aperture in APERTURES:
        for power in _powers(rows, aperture):
            lens, mine = lens_of(aperture, power), _lives(rows, aperture, power)
            fitness = [row.fitness for row in mine]
            lines.append(
                [
                    *(f"{aperture:g}", f"{power:g}", f"{lens.strehl:.3f}", f"{lens.contrast:.2f}"),
                    f"{np.mean(fitness):.0f} [{min(fitness):.0f}, {max(fitness):.0f}]",
                    f"{np.mean([row.success_rate for row in mine]):.2f}",
                ]
            )
    header = ["a", "power of the glass", "Strehl ratio", "contrast above the noise", "fitness", "goal reached first"]
    return markdown_table(header, lines)


def _worths(rows: Sequence[Trained]) -> str:
    """Return a table of the results of `worth`, with a row per pupil."""
    lines = [[f"{a:g}", str(worth(rows, a) or "-")] for a in APERTURES]
    return markdown_table(["a", "fitness of sharp lenses minus that of nearly sharp ones"], lines)


def draw(rows: Sequence[Trained], path: Path) -> None:
    """Draw fitness and Strehl ratio over the power of the glass, with a panel per pupil."""
    figure, axes = new_figure(9.0, 4.2, columns=len(APERTURES), sharey=True)
    for place, aperture in zip(axes[0], APERTURES, strict=True):
        powers, color = _powers(rows, aperture), COLOR
        for power in powers:
            mine = [row.fitness for row in _lives(rows, aperture, power)]
            place.plot([power] * len(mine), mine, "o", color=color, ms=4, alpha=0.5, mec="none")
        means = [float(np.mean([row.fitness for row in _lives(rows, aperture, p)])) for p in powers]
        place.plot(powers, means, color=color, lw=1.5, label="fitness: training runs and their mean")
        sharpness = place.twinx()
        sharpness.plot(powers, [lens_of(aperture, p).strehl for p in powers], color="#777777", ls="--", lw=1)
        sharpness.set(ylim=(0, 1.05), ylabel="Strehl ratio" if aperture == APERTURES[-1] else "")
        sharpness.spines["top"].set_visible(False)
        place.plot([], [], color="#777777", ls="--", lw=1, label="Strehl ratio")
        place.set(title=f"a = {aperture:g}", xlabel="power of the glass, 1 in focus")
    axes[0, 0].set_ylabel("fitness")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False)
    figure.suptitle(_message(rows))
    save(figure, path)


def _message(rows: Sequence[Trained]) -> str:
    found = [worth(rows, a) for a in APERTURES]
    if any(one is None for one in found):
        return "Fitness over the power of the glass"
    if all(one.low <= 0 <= one.high for one in found if one):
        return "Glass raises fitness long before it is sharp; further sharpness has no significant effect"
    return "Sharp lenses give higher fitness than nearly sharp ones"


def main(arguments: Sequence[str] | None = None) -> int:
    """Train missing animals if requested; make the page from the stored rows."""
    return designed.main(designed.Experiment(NAME, __doc__ or "", designs, SETTINGS, page), arguments)


if __name__ == "__main__":
    sys.exit(main())
