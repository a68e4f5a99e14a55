"""Surrogate fitness of an animal with a pupil and a lens, fitted to training runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evolve.analysis.statistics import succeeded
from evolve.config.run_config import EyeConfig, RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from experiments.designed import Trained
from experiments.glass import blur

__all__ = ["SPREAD", "WIDE", "Landscape", "Life", "behind_glass", "fitted", "holes", "lenses", "opening"]

Floats = NDArray[np.float64]
# Standard deviation of a training run's fitness: its value at an expected fitness of 0, and its increase per unit of
# expected fitness. `Landscape.misfit` compares it with the deviations of real training runs.
SPREAD = 5.0, 0.17


@dataclass(frozen=True)
class Life:
    """A training run: aperture and blur of the eyes (see experiments.glass), and fitness."""

    aperture: float
    blur: float
    fitness: float


@dataclass(frozen=True)
class Landscape:
    """Surrogate fitness of an animal: low + high · exp(-(aperture / a)^light) · exp(-(blur / width)^fall).

    The first exponential is a factor for light, which is low for pupils with a small relative aperture a. The second is
    a factor for sharpness.

    low: fitness without any useful signal
    high: additional fitness with the sharpest and brightest image
    aperture, light: scale and exponent of the factor for light
    width, fall: scale and exponent of the factor for sharpness
    misfit: root mean square deviation of training runs from the surrogate, in units of SPREAD
    """

    low: float
    high: float
    aperture: float
    light: float
    width: float
    fall: float
    misfit: float = math.nan

    def fitness(self, aperture: Floats | float, blur: Floats | float) -> Floats:
        """Return the expected fitness of animals with these eyes."""
        bright = np.exp(-((self.aperture / np.asarray(aperture)) ** self.light))
        return np.asarray(self.low + self.high * bright * np.exp(-((np.asarray(blur) / self.width) ** self.fall)))

    def lived(self, animals: Sequence[Phenotype], config: EyeConfig, chance: np.random.Generator) -> Floats:
        """Return the fitness of a simulated training run of each animal, drawn around its expected fitness."""
        apertures = [animal.relative_aperture or math.nan for animal in animals]
        expected = self.fitness(np.array(apertures), np.array([blur(animal, config) for animal in animals]))
        return np.asarray(expected + chance.normal(size=expected.size) * _spread(expected))


def _spread(fitness: Floats) -> Floats:
    return np.asarray(SPREAD[0] + SPREAD[1] * np.maximum(fitness, 0))


# Runs with wider lenses than in sharp_lenses: docs/measurements/learning.md#lenses-at-different-noise-levels.
WIDE = (Life(0.5, 0.0, 230.0), Life(0.5, 0.0, 203.0))


def lenses(rows: Sequence[Trained]) -> list[Life]:
    """Return the training runs of experiments.sharp_lenses."""
    eye = EyeConfig()
    return [Life(row.relative_aperture, blur(row.animal, eye), row.fitness) for row in rows if not row.failed]


def holes(run: Run) -> list[Life]:
    """Return a search's training runs from the generations in which only the pupil may change."""
    return [_life(c, run.config.eye) for c in run.candidates if succeeded(c) and c.generation < opening(run.config)]


def behind_glass(run: Run) -> list[Life]:
    """Return a search's training runs from the generations in which glass may change."""
    return [_life(c, run.config.eye) for c in run.candidates if succeeded(c) and c.generation >= opening(run.config)]


def opening(config: RunConfig) -> int:
    """Return the first generation in which glass may change."""
    return config.genome["refractive_index"].opens_at


def _life(candidate: Candidate, eye: EyeConfig) -> Life:
    animal = candidate.phenotype
    return Life(animal.relative_aperture or math.nan, blur(animal, eye), candidate.task_fitness)


def fitted(lives: Sequence[Life]) -> Landscape:
    """Return the surrogate fitted to these training runs by least squares, in units of their spread."""
    from scipy.optimize import least_squares

    apertures, blurs, fitness = np.array([astuple(life) for life in lives]).T
    begin = Landscape(5.0, 250.0, 0.3, 2.4, 1.2, 1.5)
    scale = _spread(begin.fitness(apertures, blurs))

    def misfit(parameters: Floats) -> Floats:
        return np.asarray((Landscape(*parameters).fitness(apertures, blurs) - fitness) / scale)

    bounds = ([-50, 10, 0.02, 0.5, 0.1, 0.5], [50, 1000, 2, 8, 10, 4])
    found = least_squares(misfit, astuple(begin)[:6], bounds=bounds)
    return replace(Landscape(*found.x), misfit=float(np.sqrt(np.mean(found.fun**2))))
