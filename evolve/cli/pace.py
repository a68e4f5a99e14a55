"""Measured speed of this machine: some ten seconds of real training, in the number of processes of the run."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from itertools import cycle, islice
from pathlib import Path
from tempfile import TemporaryDirectory

from evolve.config.run_config import ConfigError, LearningConfig, RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.learning.schedule import mean_passes, schedule
from evolve.search.job import ExecutorError
from evolve.search.worker import evaluate_candidate, prepare_device

__all__ = ["Pace", "measure_pace"]

ROLLOUTS = 4  # minimum that separates the times of start, step and evaluation; evaluations follow the second and fourth

DIED = (
    "a process that measured this machine's pace died, probably because memory ran out: use fewer workers "
    "(workers in the settings), or free some memory"
)


@dataclass(frozen=True)
class Pace:
    """Speed of one worker with one animal while all other workers are busy.

    start_s: time until the first world is ready
    steps_per_s: agent steps trained per second at the start, learning included
    play_s: time of one evaluation with all its episodes in parallel
    policy_bytes: size of the trained policy
    pass_s: time of each pass over the samples, per agent step
    """

    start_s: float
    steps_per_s: float
    play_s: float
    policy_bytes: int
    pass_s: float = 0.0

    def candidate_s(self, config: RunConfig) -> float:
        """Return the seconds for one candidate whose training is not divided into rungs."""
        return self.rung_s(config.learning, 0, config.learning.total_steps)

    def rung_s(self, learning: LearningConfig, begin: int, end: int) -> float:
        """Return the seconds for a rung from `begin` to `end` steps, with the evaluation after it."""
        plays = -(-(end - begin) // learning.eval_interval) + 1
        return self.start_s + self.training_s(learning, begin, end) + plays * self.play_s

    def training_s(self, learning: LearningConfig, begin: int, end: int) -> float:
        """Return the seconds of rollouts and updates; the number of passes decreases with the steps."""
        spared = learning.n_epochs - mean_passes(learning, begin, end)
        return (end - begin) * (1 / self.steps_per_s - spared * self.pass_s)


def measure_pace(config: RunConfig, animals: Mapping[str, Phenotype], workers: int) -> dict[str, Pace]:
    """Return the pace of the slowest worker with each animal; all workers measure at the same time.

    Raises:
        BackendError: Dr.Jit cannot work here.
        ConfigError: an animal cannot be evaluated here, for example because its eyes cannot be computed; the message
            names the animal and the reason.
        ExecutorError: a process died.
    """
    context = multiprocessing.get_context("spawn")
    tried = list(islice(cycle(animals), max(workers, len(animals))))
    paces: dict[str, list[Pace]] = {name: [] for name in animals}
    try:
        with ProcessPoolExecutor(workers, mp_context=context, initializer=prepare_device) as pool:
            lives = [pool.submit(_short_life, config, animals[name], seed) for seed, name in enumerate(tried)]
            for name, life in zip(tried, lives, strict=True):
                try:
                    paces[name].append(life.result())
                except ValueError as error:
                    pool.shutdown(cancel_futures=True)
                    raise ConfigError(f"an animal like the {name} one cannot be evaluated here: {error}") from error
    except BrokenProcessPool as error:
        raise ExecutorError(DIED) from error
    return {name: _slowest(found) for name, found in paces.items()}


def _slowest(paces: list[Pace]) -> Pace:
    return Pace(
        start_s=max(pace.start_s for pace in paces),
        steps_per_s=min(pace.steps_per_s for pace in paces),
        play_s=max(pace.play_s for pace in paces),
        policy_bytes=paces[0].policy_bytes,
        pass_s=min(pace.pass_s for pace in paces),
    )


def _short_life(config: RunConfig, animal: Phenotype, seed: int) -> Pace:
    """Measure a training run of four rollouts, with an evaluation after the second and after the fourth.

    The first update has all passes, and the third may have only a third of them.
    """
    rollout = config.learning.n_envs * config.learning.n_steps
    spans = {"total_steps": ROLLOUTS * rollout, "eval_interval": ROLLOUTS // 2 * rollout, "decay_after": rollout // 2}
    short = replace(config.learning, **spans)
    # Rungs of so short a training run would be shorter than a rollout.
    once = replace(config, learning=short, search=replace(config.search, rungs=1))
    marks: list[float] = []
    with TemporaryDirectory() as folder:
        policy = Path(folder) / "policy"
        began = time.perf_counter()
        outcome = evaluate_candidate(
            *(animal, once, seed, policy),
            progress=lambda steps, planned: marks.append(time.perf_counter()),
        )
        if outcome.failure is not None:
            raise ValueError(outcome.failure)
        size = policy.stat().st_size
    first, second, third, fourth = marks
    all_passes, fewer, few = (schedule(short, number * rollout)[0] for number in (1, 2, 3))
    step_s, late_step_s = (second - first) / rollout, (fourth - third) / rollout
    pass_s = max(step_s - late_step_s, 0.0) / (all_passes - few) if few < all_passes else 0.0
    pass_s = min(pass_s, step_s / all_passes)
    if pass_s == 0:
        step_s = (step_s + late_step_s) / 2
    return Pace(
        start_s=max(first - began - rollout * (step_s - all_passes * pass_s), 0.0),
        steps_per_s=1 / step_s,
        play_s=max(third - second - rollout * (step_s - (all_passes - fewer) * pass_s), 0.0),
        policy_bytes=size,
        pass_s=pass_s,
    )
