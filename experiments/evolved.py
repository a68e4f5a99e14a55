"""What runs of evolution came to: a row per candidate, and means of their last generations with intervals."""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import optics
from evolve.analysis import acuity_cpd, polychromatic, succeeded
from evolve.candidate import Candidate
from evolve.files import write_whole
from evolve.policy import PolicyConfig, build_policy, learnt
from evolve.store import Run, RunError
from evolve.versions import recorded
from evolve.vision import vision
from experiments.best_pupil import contrast_of, measures
from experiments.page import Page, parser
from experiments.store import Origin, read_rows, write_rows

__all__ = ["LAST", "Interval", "Row", "Store", "last_mean", "main", "of_generation", "parameters", "rows_of"]

Floats = NDArray[np.float64]
LAST = 3  # generations whose mean is reported
RESAMPLES = 4000
NO_NUMBER = math.nan


@dataclass(frozen=True)
class Row:
    """A candidate of a run. Optical measures are those of the best of each generation; elsewhere they are NaN.

    group        what the run stands for: a task, or a variant of an experiment
    phase        how many times genes have been opened, 0 in the first generation
    episodes     played after training; fitness and success rate are their means
    parameters   of its trained policy, critic included
    above_noise  contrast above the noise; see experiments.best_pupil
    relief       heights in [0, 1], row by row, of an eye with optics
    peaks_nm     of the pigments, of an eye that inherits them
    """

    group: str
    seed: int
    generation: int
    phase: int
    index: int
    failed: int
    fitness: float
    success_rate: float
    episodes: int
    n_eyes: int
    placement_range_deg: float
    fov_deg: float
    height: int
    width: int
    cpd: float
    memory_frames: int
    neurons: int
    parameters: int
    relative_aperture: float = NO_NUMBER
    refractive_index: float = NO_NUMBER
    image_quality: float = NO_NUMBER
    above_noise: float = NO_NUMBER
    strehl: float = NO_NUMBER
    psnr_db: float = NO_NUMBER
    ssim: float = NO_NUMBER
    relief: str = ""
    peaks_nm: str = ""


def rows_of(run: Run, group: str) -> list[Row]:
    """A run's candidates, in order of their ids."""
    champions = set()
    for generation in range(run.config.search.generations):
        done = [c for c in run.generation(generation) if succeeded(c)]
        champions |= {max(done, key=lambda c: c.fitness).id} if done else set()
    return [_row(run, group, candidate, candidate.id in champions) for candidate in run.candidates]


def _row(run: Run, group: str, candidate: Candidate, champion: bool) -> Row:
    animal, config = candidate.phenotype, run.config
    openings = {use.opens_at for use in config.genome.values() if use.open}
    seen = _seen(run, candidate) if champion and animal.relative_aperture is not None else {}
    has_optics = animal.relative_aperture is not None
    channels = animal.eyes(config.eye).eye().channels
    shape = (animal.memory_frames, animal.n_eyes, channels, *animal.resolution)
    return Row(
        group=group,
        seed=config.seed,
        generation=candidate.generation,
        phase=sum(0 < at <= candidate.generation for at in openings),
        index=candidate.index,
        failed=int(not succeeded(candidate)),
        fitness=candidate.fitness,
        success_rate=candidate.success_rate,
        episodes=len(candidate.returns),
        n_eyes=animal.n_eyes,
        placement_range_deg=animal.placement_range_deg,
        fov_deg=animal.fov_deg,
        height=animal.resolution[0],
        width=animal.resolution[1],
        cpd=acuity_cpd(animal),
        memory_frames=animal.memory_frames,
        neurons=animal.neurons,
        parameters=parameters(PolicyConfig(shape, animal.neurons, animal.layers)),
        relative_aperture=animal.relative_aperture if animal.relative_aperture is not None else NO_NUMBER,
        refractive_index=animal.refractive_index if animal.refractive_index is not None else NO_NUMBER,
        relief=" ".join(f"{height:.3g}" for height in animal.relief or ()) if has_optics else "",
        peaks_nm=" ".join(f"{peak:.1f}" for peak in animal.lambda_max_nm or ()),
        **seen,
    )


def _seen(run: Run, candidate: Candidate) -> dict[str, float]:
    """Measures of an eye's optics; {} where they cannot be computed."""
    eye = candidate.phenotype.eyes(run.config.eye).eye()
    try:
        white = polychromatic(eye, eye.psf())
        above = measures(contrast_of(eye), float(eye.throughput), max(eye.noise_sigma, 1e-9))[1]
    except optics.AccuracyError:
        return {}
    looked = vision(candidate.phenotype, run.config)
    return {
        "image_quality": looked.image_quality,
        "above_noise": above,
        "strehl": float(optics.strehl_ratio(white)[0]),
        "psnr_db": looked.psnr_db,
        "ssim": looked.ssim,
    }


@cache
def parameters(shape: PolicyConfig) -> int:
    """Numbers in a policy of this shape: what training would leave, also where its file is elsewhere."""
    return sum(tensor.numel() for tensor in learnt(build_policy(shape)).values())


# --- statistics


@dataclass(frozen=True)
class Interval:
    """A mean and its 95 % bootstrap interval."""

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.mean:.3g} [{self.low:.3g}, {self.high:.3g}]"


def of_generation(rows: Iterable[Row], value: Callable[[Row], float]) -> tuple[Floats, Floats]:
    """Generations, and the mean of a finite value over the candidates of each that succeeded."""
    found: dict[int, list[float]] = {}
    for row in rows:
        if not row.failed and math.isfinite(value(row)):
            found.setdefault(row.generation, []).append(value(row))
    generations = sorted(found)
    return np.array(generations, float), np.array([np.mean(found[g]) for g in generations])


def last_mean(rows: Sequence[Row], value: Callable[[Row], float], seed: int = 0) -> Interval | None:
    """Mean over the seeds of the mean over each seed's last LAST generations, with a bootstrap over seeds and, within
    each, candidates (Davison and Hinkley 1997, §3.8); None where there is no finite value.

    Few seeds make it narrow: of two, a quarter of all resamples hold one alone, whichever it is.
    """
    groups = list(_last_values(rows, value))
    if not groups:
        return None
    chance, shape = np.random.default_rng(seed), (RESAMPLES, len(groups))
    # Of each seed a mean for every place that it may be drawn for: a seed drawn twice has its candidates drawn twice.
    drawn = np.stack([v[chance.integers(v.size, size=(*shape, v.size))].mean(axis=-1) for v in groups])
    means = np.take_along_axis(drawn, chance.integers(len(groups), size=(1, *shape)), axis=0)[0].mean(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return Interval(float(np.mean([values.mean() for values in groups])), float(low), float(high))


def _last_values(rows: Sequence[Row], value: Callable[[Row], float]) -> Iterator[Floats]:
    """Finite values of each seed's last generations."""
    for seed in sorted({row.seed for row in rows}):
        mine = [row for row in rows if row.seed == seed]
        first = max(row.generation for row in mine) - LAST + 1
        values = [value(row) for row in mine if row.generation >= first and not row.failed]
        finite = np.array([v for v in values if math.isfinite(v)])
        if finite.size:
            yield finite


# --- from runs to page


@dataclass(frozen=True)
class Store:
    """What a page is made from: rows, their origin, and the answer that a person has given to its question."""

    rows: list[Row]
    origin: Origin
    answer: str

    def group(self, name: str) -> list[Row]:
        """Rows of one group."""
        return [row for row in self.rows if row.group == name]

    @property
    def groups(self) -> list[str]:
        """Names of the groups, in the order in which they were given."""
        return list(dict.fromkeys(row.group for row in self.rows))


def main(name: str, text: str, page: Callable[[Store], Page], arguments: Sequence[str] | None = None) -> int:
    """Collect runs if asked; make the page from the store."""
    options = parser(text)
    options.add_argument("--runs", nargs="+", metavar="GROUP=DIR", help="collect these run directories anew")
    options.add_argument("--answer", help="what came out, in Markdown; kept until another is given")
    chosen = options.parse_args(arguments)
    data = chosen.docs / "data"
    try:
        _collect(chosen, data / name)
        page(_stored(data / name)).publish(chosen.docs)
    except (RunError, ValueError, OSError) as error:
        print(f"{name}: error: {error}", file=sys.stderr)
        return 2
    return 0


def _collect(chosen: Namespace, stem: Path) -> None:
    if chosen.runs:
        named = [text.partition("=") for text in chosen.runs]
        if not all(equals for _, equals, _ in named):
            raise ValueError("--runs: must be GROUP=DIR ...")
        runs = [(group, Run.open(path)) for group, _, path in named]
        write_rows([row for group, run in runs for row in rows_of(run, group)], stem.with_suffix(".csv"))
        hours = sum(candidate.seconds for _, run in runs for candidate in run.candidates) / 3600
        here = Origin.here(hours)
        Origin(hours, here.machine, recorded(runs[0][1].path) or here.versions).write(stem.with_suffix(".json"))
    if chosen.answer:
        write_whole(stem.with_suffix(".txt"), f"{chosen.answer}\n".encode())


def _stored(stem: Path) -> Store:
    answer = stem.with_suffix(".txt")
    rows = read_rows(Row, stem.with_suffix(".csv"))
    if not rows:
        raise ValueError(f"{stem.with_suffix('.csv')} holds no runs; collect some with --runs GROUP=DIR ...")
    said = answer.read_text(encoding="utf-8").strip() if answer.exists() else "Not judged yet."
    return Store(rows, Origin.read(stem.with_suffix(".json")), said)
