"""Facets and light: compound eyes of equal surface, trained in bright and in dim light

python -m experiments.facets_and_light [--compute] [--workers N] [--docs DIR]
"""

from __future__ import annotations

import itertools
import math
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from experiments import designed
from experiments.designed import Design, Experiment, Trained
from experiments.means import Interval, mean_of
from experiments.page import Figure, Page, markdown_table, new_figure, save
from experiments.store import Origin, rounded

__all__ = ["best_octave", "complete", "designs", "eye_parameter", "page", "shift", "slope"]

NAME = "facets_and_light"
SURFACE = 2e-8  # area of all facets of an animal [m²]
EYES, FOV_DEG, RANGE_DEG = 2, 60.0, 45.0
WAVELENGTH = 500e-9  # unit of eye parameters [m]
# Facets across an eye, and the rhabdom [µm] and the F-number with which the geometrical angle d/f is about Δφ.
FACETS = {21: (1.0, 4.0), 15: (1.6, 3.0), 10: (3.0, 2.5), 7: (4.0, 2.0)}
LIGHTS = (1e4, 30.0, 1.0)  # [lx]
SEEDS = range(2711, 2717)
SETTINGS = (
    f"eye.facet_area={SURFACE:g}",
    "eye.rays_per_receptor=8",
    "learning.total_steps=131072",
    "learning.eval_interval=65536",
)
TICKS = (0.5, 1, 2, 4)  # eye parameters
COLORS = ("#E69F00", "#0072B2", "#000000")  # from bright to dim


def facet_diameter(across: int) -> float:
    """Return the width [m] of the hexagonal facets of two eyes with `across` x `across` facets on SURFACE."""
    return math.sqrt(SURFACE / (EYES * across**2 * math.sqrt(3) / 2))


def eye_parameter(across: int) -> float:
    """Return Snyder's eye parameter DΔφ in units of WAVELENGTH."""
    return facet_diameter(across) * math.radians(FOV_DEG / across) / WAVELENGTH


def designs() -> list[Design]:
    """Return all training runs, seed by seed."""
    return [
        Design(
            "detection", EYES, across, across, RANGE_DEG, 0.002, seed, FOV_DEG, 4,
            own=f"eye.illuminance={light:g}",
            facet_diameter_um=rounded(1e6 * facet_diameter(across)),
            rhabdom_diameter_um=FACETS[across][0],
            f_number=FACETS[across][1],
        )
        for seed, light, across in itertools.product(SEEDS, LIGHTS, FACETS)
    ]  # fmt: skip


def best_octave(rows: Sequence[Trained], seed: int, light: float) -> float:
    """Return log2 of the eye parameter at which a parabola fitted to fitness is highest.

    The parabola is a function of log2 of the eye parameter. It is fitted by least squares to the eyes that were trained
    with this seed in this light, and its maximum is taken within the range of the eyes.
    """
    mine = [row for row in rows if (row.seed, _light(row)) == (seed, light)]
    octaves = np.log2([eye_parameter(row.width) for row in mine])
    parabola = np.polyfit(octaves, [row.fitness for row in mine], 2)
    tried = np.linspace(octaves.min(), octaves.max(), 1001)
    return float(tried[np.polyval(parabola, tried).argmax()])


def shift(rows: Sequence[Trained], light: float) -> tuple[Interval, float]:
    """Return the mean of `best_octave` in this light minus that in the brightest light, and its p value.

    Both lights of a seed are a pair. p is the fraction of all assignments of the pairs' signs whose mean is at least as
    large: a permutation test of the hypothesis that light has no effect on the best eye parameter.
    """
    differences = np.array([best_octave(rows, n, light) - best_octave(rows, n, LIGHTS[0]) for n in complete(rows)])
    signs = np.array(list(itertools.product((1, -1), repeat=len(differences))))
    chance = float(np.mean((signs * differences).mean(axis=1) >= differences.mean() - 1e-12))
    return mean_of(differences), chance


def complete(rows: Sequence[Trained]) -> list[int]:
    """Return the seeds with which all eyes were trained in every light."""
    counts = Counter(row.seed for row in rows if not row.failed)
    return sorted(seed for seed, count in counts.items() if count == len(LIGHTS) * len(FACETS))


def page(rows: Sequence[Trained], origin: Origin, answer: str) -> Page:
    """Return the page of results, made from stored rows."""
    return Page(
        name=NAME,
        command=f"python -m experiments.{NAME} --compute",
        values={
            "answer": answer,
            "eyes": _eyes_table(),
            "fitness": _fitness_table(rows),
            "shifts": _shift_table(rows),
            "surface": f"{1e6 * SURFACE:g}",
            "field": f"{FOV_DEG:g}",
            "seeds": str(len(complete(rows))),
            "steps": f"{max(row.steps for row in rows):,}",
            "least": f"{0.5 ** len(complete(rows)):.2g}",
        },
        figures=[Figure(NAME, lambda path: draw(rows, path))],
        origin=origin,
    )


def _eyes_table() -> str:
    """Return a table of the eyes: facets, eye parameter, rhabdom and photons."""
    lines = []
    for across, (rhabdom, f_number) in FACETS.items():
        eye = _design(across).animal.eyes(_design(across).config(SETTINGS).eye).eye()
        lines.append(
            [
                f"{across} x {across}",
                f"{1e6 * facet_diameter(across):.1f}",
                f"{FOV_DEG / across:.2g}",
                f"{eye_parameter(across):.2f}",
                f"{rhabdom:g} µm, F/{f_number:g}",
                f"{np.mean(eye.photons):.2g}",
            ]
        )
    header = ["ommatidia of an eye", "facet D [µm]", "Δφ [°]", "p = DΔφ [λ]", "rhabdom", "photons of white at 1 lx"]
    return markdown_table(header, lines)


def _design(across: int) -> Design:
    return next(each for each in designs() if each.width == across and _light(each) == LIGHTS[-1])


def _fitness_table(rows: Sequence[Trained]) -> str:
    header = ["light [lx]", *(f"p = {eye_parameter(across):.2f} λ" for across in FACETS)]
    return markdown_table(
        header, [[f"{light:g}", *(str(mean_of(_cell(rows, light, across))) for across in FACETS)] for light in LIGHTS]
    )


def slope(rows: Sequence[Trained], seed: int, light: float) -> float:
    """Return the change of fitness when the eye parameter doubles, by least squares over the eyes of one seed."""
    mine = [row for row in rows if (row.seed, _light(row)) == (seed, light)]
    octaves = np.log2([eye_parameter(row.width) for row in mine])
    return float(np.polyfit(octaves, [row.fitness for row in mine], 1)[0])


def _shift_table(rows: Sequence[Trained]) -> str:
    lines = []
    for light in LIGHTS:
        best = mean_of(np.array([best_octave(rows, seed, light) for seed in complete(rows)]))
        change, chance = shift(rows, light)
        shown = (f"{2**x:.2f}" for x in (best.mean, best.low, best.high))
        cells = ("-", "-") if light == LIGHTS[0] else (str(change), f"{chance:.2g}")
        doubled = mean_of(np.array([slope(rows, seed, light) for seed in complete(rows)]))
        lines.append([f"{light:g}", str(doubled), "{} [{}, {}]".format(*shown), *cells])
    header = [
        "light [lx]",
        "change of fitness when p doubles",
        "best p [λ]",
        "shift against bright light [octaves]",
        "p value",
    ]
    return markdown_table(header, lines)


def _cell(rows: Sequence[Trained], light: float, across: int) -> np.ndarray:
    return np.array([row.fitness for row in rows if not row.failed and (_light(row), row.width) == (light, across)])


def _light(row: Design) -> float:
    return float(row.own.partition("illuminance=")[2])


def draw(rows: Sequence[Trained], path: Path) -> None:
    """Draw fitness over the eye parameter in each light, and the best eye parameter over light."""
    figure, axes = new_figure(10.5, 4.2, columns=2)
    left, right = axes[0]
    parameters = [eye_parameter(across) for across in FACETS]
    for light, color in zip(LIGHTS, COLORS, strict=True):
        cells = [_cell(rows, light, across) for across in FACETS]
        left.semilogx(parameters, [cell.mean() for cell in cells], color=color, lw=1.8, label=f"{light:g} lx")
        for parameter, cell in zip(parameters, cells, strict=True):
            aside = 0.96 + 0.04 * LIGHTS.index(light)  # dots of different lights would hide each other
            left.semilogx([aside * parameter] * cell.size, cell, "o", color=color, ms=3.5, alpha=0.7, mec="none")
    left.axvline(1 / math.sqrt(3), color="#777777", lw=1)
    left.text(1 / math.sqrt(3), left.get_ylim()[1], " λ/√3", color="#777777", va="top")
    left.set(xlabel="eye parameter DΔφ / λ", ylabel="fitness")
    left.set_xticks(TICKS, labels=[f"{tick:g}" for tick in TICKS])
    left.minorticks_off()
    left.legend(frameon=False, title="light")
    best = np.array([[2 ** best_octave(rows, seed, light) for light in LIGHTS] for seed in complete(rows)])
    right.loglog(LIGHTS, best.T, color="#BBBBBB", lw=1)
    right.loglog(LIGHTS, np.exp(np.log(best).mean(axis=0)), "o-", color="#222222", lw=2)
    right.axhline(1 / math.sqrt(3), color="#777777", lw=1)
    right.set(xlabel="illuminance [lx]", ylabel="best eye parameter DΔφ / λ", ylim=(0.4, 6))
    right.set_yticks(TICKS, labels=[f"{tick:g}" for tick in TICKS])
    right.minorticks_off()
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Train missing animals if requested; make the page from the stored rows."""
    return designed.main(Experiment(NAME, __doc__ or "", designs, SETTINGS, page), arguments)


if __name__ == "__main__":
    sys.exit(main())
