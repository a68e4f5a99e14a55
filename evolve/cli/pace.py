"""Measurement of the speed of this machine.

Real training is timed for a few seconds, at the same time in as many processes as the run will have.
"""

from __future__ import annotations

import math
import multiprocessing
import time
import warnings
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import cycle, islice
from pathlib import Path
from tempfile import TemporaryDirectory

from evolve.config.run_config import ConfigError, LearningConfig, RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.learning.schedule import mean_passes, schedule
from evolve.runs.begin import check_task
from evolve.search.job import ExecutorError
from evolve.search.local_executor import interrupts_held
from evolve.search.worker import evaluate_candidate, prepare_device

__all__ = ["Pace", "measure_pace"]

# Number of rollouts in a measurement. From fewer than three, the times for start, step and pass could not be computed
# separately. PLAYS evaluations follow the last rollout: one for the learning curve, and one for the fitness.
ROLLOUTS, PLAYS = 3, 2

DIED = (
    "a process that measured this machine's pace died, probably because memory ran out: use fewer workers "
    "(workers in the settings), or free some memory"
)


@dataclass(frozen=True)
class Pace:
    """Speed of one worker process that trains one animal while all other workers are busy.

    start_s: time until training starts [s]
    steps_per_s: number of agent steps per second at the beginning of training, including updates of the policy
    play_s: time of one evaluation, whose episodes run in parallel [s]
    policy_bytes: size of the file of a trained policy [bytes]
    pass_s: duration of one pass over the samples of an update, divided by the number of samples [s]. A sample is an
        agent step of the rollout
    """

    start_s: float
    steps_per_s: float
    play_s: float
    policy_bytes: int
    pass_s: float = 0.0

    def candidate_s(self, config: RunConfig) -> float:
        """Return the time for training and evaluating one candidate [s].

        The result assumes that training is not divided into rungs. A rung is a stage of training, after which only the
        better candidates continue.
        """
        return self.rung_s(config.learning, 0, config.learning.total_steps)

    def rung_s(self, learning: LearningConfig, begin: int, end: int) -> float:
        """Return the time for one rung, a stage of training from `begin` to `end` steps [s].

        The result includes the evaluations of the policy in this rung.
        """
        plays = -(-(end - begin) // learning.eval_interval) + 1
        return self.start_s + self.training_s(learning, begin, end) + plays * self.play_s

    def training_s(self, learning: LearningConfig, begin: int, end: int) -> float:
        """Return the time for rollouts and updates from `begin` to `end` steps [s].

        The number of passes over the samples in an update can decrease during training.
        """
        spared = learning.n_epochs - mean_passes(learning, begin, end)
        return (end - begin) * (1 / self.steps_per_s - spared * self.pass_s)


def measure_pace(config: RunConfig, animals: Mapping[str, Phenotype], workers: int) -> dict[str, Pace]:
    """Return the pace for each animal, by the animal's name: how fast one worker process trains and evaluates it.

    All workers measure at the same time. If several workers train the same animal, their measurements differ. Each
    field of `Pace` then has the most cautious of the measured values, which predicts the longest duration of the run.

    animals: animals that are trained for the measurement, by name
    workers: number of worker processes

    Raises:
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
        ConfigError: the user task fails, or its method `place` uses only one of several mounts (bodies, sites or
            cameras that carry eyes). It is also an error if an animal cannot be evaluated on this machine, for example
            because its eyes cannot be computed. The message states the reason, and names the animal if there is one.
        ExecutorError: a worker process died.
    """
    tried = list(islice(cycle(animals), max(workers, len(animals))))
    paces: dict[str, list[Pace]] = {name: [] for name in animals}
    try:
        with TemporaryDirectory() as folder, _pool(workers) as pool:
            if config.choice.named_code is not None:
                with interrupts_held():
                    check = pool.submit(check_task, config)
                for warning in check.result():
                    warnings.warn(warning, stacklevel=2)
            with interrupts_held():
                trials = [
                    pool.submit(_timed_training, config, animals[name], seed, Path(folder) / str(seed))
                    for seed, name in enumerate(tried)
                ]
            for name, trial in zip(tried, trials, strict=True):
                try:
                    paces[name].append(trial.result())
                except ValueError as error:
                    raise ConfigError(f"an animal like the {name} one cannot be evaluated here: {error}") from error
    except BrokenProcessPool as error:
        raise ExecutorError(DIED) from error
    return {name: _slowest(found) for name, found in paces.items()}


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of processes. If an exception leaves the context, the processes are terminated, not awaited.

    Jobs must be submitted within `interrupts_held`, so that only the parent receives Ctrl-C.
    """
    context, others = multiprocessing.get_context("spawn"), set(multiprocessing.active_children())
    with ProcessPoolExecutor(workers, mp_context=context, initializer=prepare_device) as pool:
        try:
            yield pool
        except BaseException:
            for process in set(multiprocessing.active_children()) - others:
                process.terminate()
            raise


def _slowest(paces: list[Pace]) -> Pace:
    return Pace(
        start_s=max(pace.start_s for pace in paces),
        steps_per_s=min(pace.steps_per_s for pace in paces),
        play_s=max(pace.play_s for pace in paces),
        policy_bytes=paces[0].policy_bytes,
        pass_s=min(pace.pass_s for pace in paces),
    )


def _timed_training(config: RunConfig, animal: Phenotype, seed: int, policy: Path) -> Pace:
    """Time a training run of three short rollouts, followed by the evaluations.

    The first update makes all passes over the samples. The second update makes only half as many, but at least
    `learning.least_epochs` passes, or all if there are fewer. The time of one pass follows from the difference between
    the times of the two updates. It counts as 0 if both make the same number of passes.

    policy: path to which the trained policy is written. The parent process removes the folder of this file, even after
        Ctrl-C

    Raises:
        ValueError: the animal cannot be evaluated; the message states the reason.
    """
    short = _with_short_rollouts(config.learning)
    rollout = short.n_envs * short.n_steps
    spans = {"total_steps": ROLLOUTS * rollout, "eval_interval": ROLLOUTS * rollout, "decay_after": rollout // 2}
    short = replace(short, **spans)
    # The training run is not divided into rungs, because they would be shorter than a rollout.
    once = replace(config, learning=short, search=replace(config.search, rungs=1))
    marks: list[float] = []
    began = time.perf_counter()
    outcome = evaluate_candidate(
        *(animal, once, seed, policy),
        progress=lambda steps, planned: marks.append(time.perf_counter()),
    )
    ended = time.perf_counter()
    if outcome.failure is not None:
        raise ValueError(outcome.failure)
    size = policy.stat().st_size
    first, second, third = marks
    all_passes, few, last = (schedule(short, number * rollout)[0] for number in (1, 2, 3))
    step_s, late_step_s = (second - first) / rollout, (third - second) / rollout
    pass_s = max(step_s - late_step_s, 0.0) / (all_passes - few) if few < all_passes else 0.0
    pass_s = min(pass_s, step_s / all_passes)
    if pass_s == 0:
        step_s = (step_s + late_step_s) / 2
    return Pace(
        start_s=max(first - began - rollout * (step_s - all_passes * pass_s), 0.0),
        steps_per_s=1 / step_s,
        play_s=max(ended - third - rollout * last * pass_s, 0.0) / PLAYS,
        policy_bytes=size,
        pass_s=pass_s,
    )


def _with_short_rollouts(learning: LearningConfig) -> LearningConfig:
    """Return the settings with rollouts shortened to the smallest number of steps that fills whole batches.

    Rollouts that are already shorter than this are not changed, unless they have only one step per environment, which
    becomes two. The measured time per step hardly changes, because an update takes a constant time per batch.
    """
    whole_batches = math.lcm(learning.batch_size, learning.n_envs) // learning.n_envs
    return replace(learning, n_steps=max(2, min(learning.n_steps, whole_batches)))
