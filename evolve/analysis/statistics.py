"""Statistics per generation, trajectories of phenotypes, peak signal-to-noise ratio and confidence intervals.

All functions depend only on their arguments. The report and the comparisons of runs show the results.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evolve.genome.genes import LAMBDA_MAX, OPTIONAL, TILT
from evolve.genome.phenotype import Phenotype
from optics.numerics.number_types import full_precision

if TYPE_CHECKING:
    from evolve.config.run_config import EyeConfig
    from evolve.store.candidate import Candidate

__all__ = [
    "GenerationStatistics",
    "Trajectory",
    "bootstrap_interval",
    "champions",
    "gene_values",
    "generation_statistics",
    "psnr",
    "succeeded",
    "trajectory",
]

Floats = NDArray[np.float64]
SPREAD = (0.1, 0.9)  # quantiles between which a population's spread is shown
PERCENTILE_RESAMPLES = 2000
RESAMPLED_AT_ONCE = 2**20  # maximum number of samples that are drawn at once, which limits the memory


@dataclass(frozen=True)
class GenerationStatistics:
    """Statistics of the fitness in one generation.

    generation: number of the generation, counted from 0
    evaluated, failed: number of evaluated candidates, and number of failed candidates among them
    best, median: best fitness and median of the successful candidates; NaN if all candidates have failed
    low, high: the 10 % and 90 % quantiles of the successful candidates (linear interpolation); NaN if all candidates
        have failed
    best_so_far: best fitness up to and including this generation; NaN before a candidate has succeeded
    """

    generation: int
    evaluated: int
    failed: int
    best: float
    median: float
    low: float
    high: float
    best_so_far: float


@dataclass(frozen=True)
class Trajectory:
    """One quantity of the phenotypes over the generations. All arrays have the shape (generation,).

    generations: numbers of the generations
    low, median, high: 10 % quantile, median and 90 % quantile in each population; only finite values are used,
        and the result is NaN if there are none
    best: value of the quantity in the best candidate so far; NaN before a candidate has succeeded, or if the best one
        lacks the quantity
    """

    generations: NDArray[np.int64]
    median: Floats
    low: Floats
    high: Floats
    best: Floats


def succeeded(candidate: Candidate) -> bool:
    """Return whether the candidate's training and evaluation were completed, with a finite fitness."""
    return candidate.failure is None and math.isfinite(candidate.fitness)


def by_generation(candidates: Sequence[Candidate]) -> list[tuple[int, list[Candidate]]]:
    """Return (generation, its candidates) for each generation, sorted by generation and by index."""
    ordered = sorted(candidates, key=lambda c: (c.generation, c.index))
    return [(generation, list(members)) for generation, members in groupby(ordered, lambda c: c.generation)]


def champions(candidates: Sequence[Candidate]) -> list[tuple[int, Candidate]]:
    """Return (generation, best candidate so far) for each generation since the first successful candidate."""
    found: list[tuple[int, Candidate]] = []
    best: Candidate | None = None
    for generation, members in by_generation(candidates):
        for candidate in filter(succeeded, members):
            if best is None or candidate.fitness > best.fitness:
                best = candidate
        if best is not None:
            found.append((generation, best))
    return found


def generation_statistics(candidates: Sequence[Candidate]) -> list[GenerationStatistics]:
    """Return the statistics of fitness in each generation; failed candidates are only counted."""
    rows: list[GenerationStatistics] = []
    best_so_far = math.nan
    for generation, members in by_generation(candidates):
        fitness = np.array([c.fitness for c in members if succeeded(c)])
        low, median, high = _quantiles(fitness)
        best = float(fitness.max()) if fitness.size else math.nan
        best_so_far = float(np.fmax(best_so_far, best))
        failed = len(members) - fitness.size
        rows.append(GenerationStatistics(generation, len(members), failed, best, median, low, high, best_so_far))
    return rows


def trajectory(candidates: Sequence[Candidate], value: Callable[[Phenotype], float]) -> Trajectory:
    """Return quantiles of a quantity in each generation, and the quantity of the best candidate so far.

    Failed candidates also have a phenotype, so the quantiles include them.

    value: function that returns the quantity of a phenotype; NaN if the phenotype lacks it
    """
    groups = by_generation(candidates)
    spread = np.array([_quantiles(np.array([value(c.phenotype) for c in members])) for _, members in groups])
    best: list[float] = []
    champion: Candidate | None = None
    for _, members in groups:
        for candidate in filter(succeeded, members):
            if champion is None or candidate.fitness > champion.fitness:
                champion = candidate
        best.append(value(champion.phenotype) if champion else math.nan)
    low, median, high = spread.reshape(-1, 3).T
    return Trajectory(np.array([g for g, _ in groups], np.int64), median, low, high, np.array(best))


def _quantiles(values: Floats) -> tuple[float, float, float]:
    """Return the 10 % quantile, median and 90 % quantile of the finite values; NaN if there are none."""
    values = values[np.isfinite(values)]
    if not values.size:
        return math.nan, math.nan, math.nan
    low, median, high = np.quantile(values, [SPREAD[0], 0.5, SPREAD[1]])
    return float(low), float(median), float(high)


def gene_values(phenotype: Phenotype, eye: EyeConfig | None = None) -> dict[str, float]:
    """Return the values of all genes that the phenotype expresses, by gene name.

    Genes of a pupil are present only if the animal's eyes have a pupil. Spectral genes are present only if the types of
    the animal's receptors are determined by genes, not by a setting. For receptor types that the animal lacks, the peak
    wavelengths are NaN.

    eye: settings of a run's eyes. Only values of genes of this run are returned: for a symmetric relief, the heights in
        an eighth of its area, and for a square eye, only one side. None: all values are returned
    """
    height, width = phenotype.resolution
    values = {
        "n_eyes": float(phenotype.n_eyes),
        "placement_range_deg": phenotype.placement_range_deg,
        **({} if phenotype.elevation_deg is None else {TILT: phenotype.elevation_deg}),
        "fov_deg": phenotype.fov_deg,
        "resolution_height": float(height),
        "resolution_width": float(width),
    }
    if height == width:
        values["resolution"] = float(width)
    if phenotype.relative_aperture is not None:
        values["relative_aperture"] = phenotype.relative_aperture
    if phenotype.relief is not None:
        side = math.isqrt(len(phenotype.relief))
        relief = np.reshape(phenotype.relief, (side, side))
        values |= {f"doe_{i}{j}": float(height) for (i, j), height in np.ndenumerate(relief)}
    if phenotype.refractive_index is not None:
        values["refractive_index"] = phenotype.refractive_index
        values |= {"dispersion": phenotype.dispersion, "aperture_shape": float(phenotype.aperture_shape)}
    values |= {name: getattr(phenotype, name) for name in OPTIONAL if getattr(phenotype, name) is not None}
    brain = ("memory_frames", "neurons", "layers")
    values |= {name: float(getattr(phenotype, name)) for name in brain}
    if phenotype.lambda_max_nm is not None:
        values["receptor_types"] = float(len(phenotype.lambda_max_nm))
        values |= {
            **dict.fromkeys(LAMBDA_MAX, math.nan),
            **dict(zip(LAMBDA_MAX, phenotype.lambda_max_nm, strict=False)),
        }
    return values if eye is None else {name: value for name, value in values.items() if name in eye.genes}


def bootstrap_interval(
    samples: Floats | Sequence[float],
    statistic: Callable[..., Floats] = np.mean,
    level: float = 0.95,
    seed: int = 0,
) -> tuple[float, float]:
    """Return the percentile bootstrap interval of a statistic (Efron & Tibshirani 1993, ch. 13).

    The same seed gives the same interval. For few samples, the interval is too narrow: for six samples of a normal
    distribution, the 95 % interval contains the true mean in only about 88 % of cases. A single sample contains no
    information about the spread, so the result is (NaN, NaN).

    samples: independent values, (sample,)
    statistic: function that is called as statistic(resamples, axis=1), such as np.mean
    level: confidence level of the interval
    seed: seed of the resampling

    Raises:
        ValueError: `samples` is empty, not one-dimensional, not finite or in half precision, or the level is outside
            (0, 1).
    """
    values = np.asarray(full_precision("samples", samples), dtype=np.float64)
    if values.ndim != 1 or not values.size or not np.isfinite(values).all():
        raise ValueError(f"samples: must be one or more finite numbers, got {values}")
    if not 0 < level < 1:
        raise ValueError(f"level = {level!r}: must be in (0, 1)")
    if values.size == 1:
        return math.nan, math.nan
    chance = np.random.default_rng(seed)
    rows = min(PERCENTILE_RESAMPLES, max(1, RESAMPLED_AT_ONCE // values.size))
    counts = [min(rows, PERCENTILE_RESAMPLES - done) for done in range(0, PERCENTILE_RESAMPLES, rows)]
    found = [statistic(values[chance.integers(values.size, size=(count, values.size))], axis=1) for count in counts]
    low, high = np.quantile(np.concatenate(found), [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)


def psnr(signals: NDArray[np.floating], reference: NDArray[np.floating], gain: float = 1.0) -> float:
    """Return the peak signal-to-noise ratio [dB] of `gain` x signals relative to a reference.

    The peak is 1, the signal of a white surface in daylight. For equal images, the ratio is infinite.

    signals, reference: images of the same shape

    Raises:
        ValueError: the shapes differ.
    """
    if signals.shape != reference.shape:
        raise ValueError(f"signals has shape {signals.shape}: must be that of the reference, {reference.shape}")
    error = np.mean((gain * signals.astype(np.float64) - reference) ** 2)
    return math.inf if error == 0 else float(-10 * math.log10(error))
