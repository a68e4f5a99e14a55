"""A run that is small enough for a test: one candidate with minimal real training."""

from __future__ import annotations

from dataclasses import replace

from evolve.config.numbering import Place
from evolve.config.run_config import EvaluationConfig, EyeConfig, LearningConfig, RunConfig
from evolve.genome.genes import TILT
from evolve.genome.genotype import GENES, Genotype
from evolve.genome.phenotype import Phenotype
from evolve.learning.fitness import evaluate
from evolve.store.candidate import Candidate
from evolve.store.directory import Run

LEARNING = LearningConfig(total_steps=512, n_envs=16, n_steps=16, batch_size=128, eval_interval=512)
PHENOTYPE = Phenotype(
    n_eyes=2,
    placement_range_deg=60.0,
    fov_deg=45.0,
    resolution=(4, 5),
    relative_aperture=None,
    relief=None,
    refractive_index=None,
    memory_frames=3,
    neurons=16,
)


def small_config(task="detection", learning=LEARNING, **eye):
    genome = {
        name: replace(gene.default, open=gene.cluster == "neural") for name, gene in GENES.items() if name != TILT
    }
    eye_config = EyeConfig(optics=False, rays_per_receptor=1, **eye)
    return RunConfig(task, eye=eye_config, genome=genome, learning=learning, evaluation=EvaluationConfig(episodes=6))


def small_run(path, seed=5):
    """Create a run directory with one evaluated candidate, and return it with that candidate's evaluation."""
    run = Run.create(path, small_config())
    outcome = evaluate(PHENOTYPE, run.config, seed, run.policy_path(0))
    genome = (0.5,) * Genotype(run.config.genome).dimension
    run.append(Candidate.from_evaluation(Place(0, 0, 0), genome, PHENOTYPE, seed, outcome))
    return run
