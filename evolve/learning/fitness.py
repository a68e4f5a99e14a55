"""Training and evaluation of a candidate. Its task fitness is its mean return in the evaluation episodes.

The search subtracts the costs of eyes and brain from the task fitness (`evolve.search.loop`).
"""

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
from evolve.learning.checkpoint_file import CheckpointError, set_aside
from evolve.learning.played_episodes import Episodes, play
from evolve.learning.policy import Brain, TrainingDiverged, save_policy
from evolve.learning.ppo import Progress, Training, Worlds, train
from evolve.learning.training_envs import worlds_of
from evolve.learning.training_rung import TrainingRung
from evolve.store.evaluation import Evaluation, most_frequent

__all__ = ["evaluate"]


def evaluate(
    phenotype: Phenotype,
    config: RunConfig,
    seed: int,
    policy_path: Path,
    progress: Progress | None = None,
    rung: TrainingRung | None = None,
) -> Evaluation:
    """Train one candidate, write its policy, and measure its task fitness.

    On one machine, the same arguments give the same outcome, apart from the time. If learning diverges, a failed
    Evaluation is returned. Checkpoints that cannot be used are renamed, and have no effect on the outcome.

    seed: seed of the policy's initial weights, of all worlds and of all random numbers in learning
    policy_path: path of the trained policy (safetensors), which is not written if learning diverged
    progress: function that is called with (steps trained, steps planned) after every rollout; None: no function
    rung: one of the parts of a training run (`evolve.search.successive_halving`); training stops at the end of this
        part, and continues from the latest usable checkpoint of an earlier part; None: train to the end

    Warns:
        CheckpointWarning: a checkpoint cannot be used.

    Raises:
        ConfigError: the run was opened without the "FILE.py:CLASS" of its user task, or its code cannot be executed.
        ValueError: the eyes cannot be placed in the user task.
        RuntimeError: a method of the user task fails at the start of an episode.
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
        OSError: the policy or a checkpoint cannot be written.
    """
    began, failures = time.perf_counter(), Counter[str]()
    try:
        if rung is None:
            training, episodes = _train_and_play(phenotype, config, seed, failures, progress)
        else:
            training, episodes = _train_to_rung(rung, phenotype, config, seed, failures, progress)
    except TrainingDiverged as error:
        diverged = Evaluation.failed(str(error), time.perf_counter() - began)
        return replace(diverged, episode_failures=most_frequent(failures))
    save_policy(training.policy, policy_path)
    return Evaluation(
        fitness=float(episodes.returns.mean()),
        returns=tuple(episodes.returns.tolist()),
        success_rate=float(episodes.successes.mean()),
        steps=training.steps,
        seconds=time.perf_counter() - began,
        curve=training.curve,
        episode_failures=most_frequent(failures),
    )


def _train_to_rung(
    rung: TrainingRung,
    phenotype: Phenotype,
    config: RunConfig,
    seed: int,
    failures: Counter[str],
    progress: Progress | None,
) -> tuple[Training, Episodes]:
    """Train to the end of this rung, starting from the latest usable checkpoint, and play the evaluation episodes.

    `failures` counts the episodes that fail during this call, by reason.
    """
    owners = rung.owners(phenotype, config, seed)
    begun, first = None, 0
    for earlier in reversed(range(rung.number)):
        try:
            begun = load_checkpoint(rung.checkpoints[earlier], owners[earlier])
        except CheckpointError as error:
            set_aside(rung.checkpoints[earlier], error)
        if begun is not None:
            first = earlier + 1
            break
    for number in range(first, rung.number + 1):
        learning = replace(config.learning, total_steps=rung.ends[number])
        # With `rungs` unchanged, the check of the settings could refuse a rung as shorter than a rollout.
        shorter = replace(config, learning=learning, search=replace(config.search, rungs=1))
        entropy = [seed, number] if number else seed  # the first rung starts like an undivided training run
        try:
            training, episodes = _train_and_play(phenotype, shorter, entropy, failures, progress, begun)
        except CheckpointError as error:  # the file is sound, but comes from a version with another network
            set_aside(rung.checkpoints[number - 1], error)
            return _train_to_rung(rung, phenotype, config, seed, failures, progress)
        begun = training.end
        save_checkpoint(begun, rung.checkpoints[number], owners[number])
    return training, episodes


def _train_and_play(
    phenotype: Phenotype,
    config: RunConfig,
    entropy: int | list[int],
    failures: Counter[str],
    progress: Progress | None,
    begun: Checkpoint | None = None,
) -> tuple[Training, Episodes]:
    """Train, then play evaluation episodes, whose start poses and object positions differ from those during training.

    The layouts of the evaluation are the same for all candidates. Failures of episodes are counted in
    `failures`, even if learning diverges.

    entropy: seed of all random numbers
    begun: checkpoint from which to continue; None: train from the start

    Raises:
        TrainingDiverged: rewards, loss, weights, actions or returns are not finite.
        CheckpointError: `begun` does not have the tensors of this policy.
    """
    weights, *seeds = (int(s) for s in np.random.SeedSequence(entropy).generate_state(3))
    envs = worlds_of(phenotype, config, *seeds)
    with closing(envs.training), closing(envs.selection), closing(envs.fitness):
        brain = Brain(phenotype.neurons, phenotype.layers, phenotype.encoder, config.wiring)
        try:
            training = train(Worlds(envs.training, envs.selection), brain, config.learning, weights, progress, begun)
            return training, play(training.policy, envs.fitness, seeds[1])
        finally:
            for worlds in (envs.training, envs.selection, envs.fitness):
                failures.update(worlds.failures)
