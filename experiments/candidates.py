"""Results of evolution runs as tables with a row per candidate."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import torch

import optics
from evolve.analysis.acuity import acuity_cpd
from evolve.analysis.statistics import succeeded
from evolve.analysis.vision import vision
from evolve.analysis.white_light import white_strehl
from evolve.config.run_config import EyeConfig, RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.learning.policy import PolicyConfig, build_policy, learnt
from evolve.search import successive_halving
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from experiments.best_pupil import contrast_of, measures
from experiments.glass import power
from sim.tasks.reward import EVALUATION
from sim.worlds.world import build_world

__all__ = ["NO_NUMBER", "Row", "anatomy", "complete", "parameters", "rows_of"]

NO_NUMBER = math.nan


@dataclass(frozen=True)
class Row:
    """A candidate of a run.

    Optical measures are NaN except for the best candidate of each generation.

    group: task, or variant of an experiment, that the run belongs to
    phase: number of times that genes have opened since the first generation
    fitness: task fitness, which contains no costs
    episodes: number of evaluation episodes, over which fitness and success rate are means
    cpd: acuity [cycles/degree]
    parameters: number of parameters of the trained policy, including the critic
    full_return: return of an episode straight to the goal without any contact; NaN if a new goal follows each goal
    above_noise: contrast above the noise, as in experiments.best_pupil
    above_noise_of_hole: the same for the pupil without its relief
    relief: heights of the relief in [0, 1], row by row; empty for perfect lenses
    glass_power: power of the glass relative to the power that focuses; see experiments.glass
    facet_diameter_um: width of the facets of compound eyes; NaN for camera eyes
    rhabdom_diameter_um: diameter of the rhabdoms; NaN for receptors that are not rhabdoms
    peaks_nm: peak wavelengths of evolved pigments [nm]; empty if pigments do not evolve
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
    above_noise_of_hole: float = NO_NUMBER
    strehl: float = NO_NUMBER
    psnr_db: float = NO_NUMBER
    ssim: float = NO_NUMBER
    relief: str = ""
    peaks_nm: str = ""
    full_return: float = NO_NUMBER
    glass_power: float = NO_NUMBER
    facet_diameter_um: float = NO_NUMBER
    rhabdom_diameter_um: float = NO_NUMBER


def rows_of(run: Run, group: str) -> list[Row]:
    """Return the rows of a run's candidates in order of their ids.

    Incomplete generations are omitted, except in the steady state, in which generations have no meaning.
    """
    chosen = range(run.config.search.generations) if run.config.search.steady_state else complete(run)
    generations = {generation: run.generation(generation) for generation in chosen}
    champions = set()
    for candidates in generations.values():
        done = [c for c in candidates if succeeded(c)]
        champions |= {max(done, key=lambda c: c.fitness).id} if done else set()
    return [_row(run, group, c, c.id in champions) for c in run.candidates if c.generation in generations]


def complete(run: Run) -> list[int]:
    """Return the generations in which all candidates have completed all rungs of their training."""
    return [g for g in range(run.config.search.generations) if successive_halving.complete(run, g)]


def _row(run: Run, group: str, candidate: Candidate, champion: bool) -> Row:
    animal, config = candidate.phenotype, run.config
    openings = {use.opens_at for use in config.genome.values() if use.open}
    channels = animal.eyes(config.eye).eye().channels
    shape = (animal.memory_frames, animal.n_eyes, channels, *animal.resolution)
    return Row(
        group=group,
        seed=config.seed,
        generation=candidate.generation,
        phase=sum(0 < at <= candidate.generation for at in openings),
        index=candidate.index,
        failed=int(not succeeded(candidate)),
        fitness=candidate.task_fitness,
        success_rate=candidate.success_rate,
        episodes=len(candidate.returns),
        parameters=parameters(PolicyConfig(shape, animal.neurons, animal.layers, animal.encoder, wiring=config.wiring)),
        full_return=full_return(config.task, config.world.evaluation_course),
        **anatomy(animal, config.eye),
        **(_seen(config, animal) if champion and animal.relative_aperture is not None else {}),
    )


@cache
def full_return(task: str, course: str = "short") -> float:
    """Return the fitness of a straight path from start to goal, averaged over the starts.

    NaN is returned if each reached goal is followed by another one.
    """
    world = build_world(task, course=course)
    if world.goal_region is None:
        return NO_NUMBER
    low, high = np.reshape(world.goal_region, (2, 2))
    nearest = np.clip(world.starts.position, low, high)
    distance = float(np.linalg.norm(nearest - world.starts.position, axis=1).mean())
    return EVALUATION.progress * distance + EVALUATION.goal


def anatomy(animal: Phenotype, eye: EyeConfig) -> dict[str, Any]:
    """Return the fields of a row that depend only on the animal's phenotype."""
    has_optics = animal.relative_aperture is not None
    return {
        "n_eyes": animal.n_eyes,
        "placement_range_deg": animal.placement_range_deg,
        "fov_deg": animal.fov_deg,
        "height": animal.resolution[0],
        "width": animal.resolution[1],
        "cpd": acuity_cpd(animal),
        "memory_frames": animal.memory_frames,
        "neurons": animal.neurons,
        "relative_aperture": _number(animal.relative_aperture),
        "refractive_index": _number(animal.refractive_index),
        "relief": " ".join(f"{height:.3g}" for height in animal.relief or ()) if has_optics else "",
        "peaks_nm": " ".join(f"{peak:.1f}" for peak in animal.lambda_max_nm or ()),
        "glass_power": power(animal, eye),
        "facet_diameter_um": _number(animal.facet_diameter_um),
        "rhabdom_diameter_um": _number(animal.rhabdom_diameter_um),
    }


def _number(value: float | None) -> float:
    return NO_NUMBER if value is None else value


def _seen(config: RunConfig, animal: Phenotype) -> dict[str, Any]:
    """Return measures of an eye's optics; {} if they cannot be computed."""
    eye = animal.eyes(config.eye).eye()
    try:
        strehl = white_strehl(eye, eye.psf())
        hole = replace(eye, pupil=optics.Pupil(eye.pupil.aperture_radius, aperture=eye.pupil.aperture))
        above, above_of_hole = (
            measures(contrast_of(one), float(one.throughput), max(one.noise_sigma, 1e-9))[1] for one in (eye, hole)
        )
    except optics.AccuracyError:
        return {}
    looked = vision(animal, config)
    return {
        "image_quality": looked.image_quality,
        "above_noise": above,
        "above_noise_of_hole": above_of_hole,
        "strehl": strehl,
        "psnr_db": looked.psnr_db,
        "ssim": looked.ssim,
    }


@cache
def parameters(shape: PolicyConfig) -> int:
    """Return the number of values that learning changes in a policy of this shape."""
    with torch.device("meta"):  # no values: drawing the weights would take a hundred times longer
        return sum(tensor.numel() for tensor in learnt(build_policy(shape)).values())
