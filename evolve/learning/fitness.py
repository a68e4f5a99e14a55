"""Fitness: a candidate's life. It learns, then plays the evaluation episodes, whose mean return is its fitness."""

from __future__ import annotations

import time
from collections import Counter
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from evolve.config.run_config import RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.learning.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from evolve.learning.policy import Brain, TrainingDiverged, save_policy
from evolve.learning.ppo import Episodes, Progress, Training, Worlds, play, train
from evolve.learning.training_stage import TrainingStage
from evolve.learning.worlds import worlds_of
from evolve.store.evaluation import Evaluation, most_frequent

__all__ = ["evaluate"]


def evaluate(
    phenotype: Phenotype,
    config: RunConfig,
    seed: int,
    policy_path: Path,
    progress: Progress | None = None,
    stage: TrainingStage | None = None,
) -> Evaluation:
    """Train one candidate, write its policy, and measure its fitness; same arguments, same outcome on one machine.

    seed: of the policy's first weights, of all worlds and of all chance in learning
    policy_path: where the trained policy is written (safetensors); nothing is written if learning diverged
    progress: told (steps trained, steps planned) after every rollout
    stage: how far to train, and from where (`evolve.search.successive_halving`); None: a whole training

    A training that diverges is a failed Evaluation, not an exception.
    """
    began, failures = time.perf_counter(), Counter[str]()
    try:
        if stage is None:
            training, episodes = _live(phenotype, config, seed, failures, progress)
        else:
            training, episodes = _live_until(stage, phenotype, config, seed, failures, progress)
    except TrainingDiverged as error:
        diverged = Evaluation.failed(str(error), time.perf_counter() - began)
        return replace(diverged, mishaps=most_frequent(failures))
    save_policy(training.policy, policy_path)
    return Evaluation(
        fitness=float(episodes.returns.mean()),
        returns=tuple(episodes.returns.tolist()),
        success_rate=float(episodes.successes.mean()),
        steps=training.steps,
        seconds=time.perf_counter() - began,
        curve=training.curve,
        mishaps=most_frequent(failures),
    )


def _live_until(
    stage: TrainingStage,
    phenotype: Phenotype,
    config: RunConfig,
    seed: int,
    failures: Counter[str],
    progress: Progress | None,
) -> tuple[Training, Episodes]:
    """Through all stages up to this one, from the latest whose checkpoint there is; failures are those since then."""
    begun, first = None, 0
    for earlier in reversed(range(stage.number)):
        if begun is None and (begun := load_checkpoint(stage.checkpoints[earlier])) is not None:
            first = earlier + 1
    for number in range(first, stage.number + 1):
        learning = replace(config.learning, total_steps=stage.ends[number])
        # A stage has none itself: a little budget, divided once more, may be too little for one.
        life = replace(config, learning=learning, search=replace(config.search, rungs=1))
        entropy = [seed, number] if number else seed  # the first stage begins as a whole training does
        training, episodes = _live(phenotype, life, entropy, failures, progress, begun)
        begun = training.end
        save_checkpoint(begun, stage.checkpoints[number])
    return training, episodes


def _live(
    phenotype: Phenotype,
    config: RunConfig,
    entropy: int | list[int],
    failures: Counter[str],
    progress: Progress | None,
    begun: Checkpoint | None = None,
) -> tuple[Training, Episodes]:
    """Training, and the evaluation episodes after it, from starts and objects' places never seen before. Mazes are
    the same for all of a run, and of all runs. What failed in any of them is counted in `failures`, also where learning
    diverges."""
    weights, *seeds = (int(s) for s in np.random.SeedSequence(entropy).generate_state(3))
    places = worlds_of(phenotype, config, *seeds)
    with (
        closing(places.lessons) as lessons,
        closing(places.checkpoints) as checkpoints,
        closing(places.finals) as finals,
    ):
        brain = Brain(phenotype.neurons, phenotype.layers, phenotype.encoder)
        try:
            training = train(Worlds(lessons, checkpoints), brain, config.learning, weights, progress, begun)
            return training, play(training.policy, finals, seeds[1])
        finally:
            for worlds in (lessons, checkpoints, finals):
                failures.update(worlds.failures)
