"""How fast this machine evaluates: some ten seconds of the real thing, in as many processes as the run will have."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import cycle, islice
from pathlib import Path
from tempfile import TemporaryDirectory

from evolve.config.run_config import ConfigError, RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.search.worker import evaluate_candidate, prepare_device

__all__ = ["Pace", "measure_pace"]

ROLLOUTS = 4  # chosen, the fewest that tell start, step and evaluation apart; evaluations follow the second and fourth


@dataclass(frozen=True)
class Pace:
    """What one worker achieves with one animal while all others work too.

    start_s: until its first world is ready
    steps_per_s: agent steps trained per second, learning included
    play_s: one evaluation: all its episodes, side by side
    policy_bytes of its trained policy
    """

    start_s: float
    steps_per_s: float
    play_s: float
    policy_bytes: int

    def candidate_s(self, config: RunConfig) -> float:
        """Seconds for one candidate that trains to the end in one go."""
        return self.stage_s(config.learning.total_steps, config.learning.eval_interval)

    def stage_s(self, steps: int, eval_interval: int) -> float:
        """Seconds for a budget stage of so many steps, and the evaluation after it."""
        plays = -(-steps // eval_interval) + 1
        return self.start_s + steps / self.steps_per_s + plays * self.play_s


def measure_pace(config: RunConfig, animals: Mapping[str, Phenotype], workers: int) -> dict[str, Pace]:
    """Pace with each animal, of the slowest worker that tried it; all workers try at the same time.

    Raises:
        BackendError: Dr.Jit cannot work here.
        ConfigError: an animal cannot be evaluated here: its eyes cannot be computed, say; names which and why.
    """
    context = multiprocessing.get_context("spawn")
    tried = list(islice(cycle(animals), max(workers, len(animals))))
    paces: dict[str, list[Pace]] = {name: [] for name in animals}
    with ProcessPoolExecutor(workers, mp_context=context, initializer=prepare_device) as pool:
        lives = [pool.submit(_short_life, config, animals[name], seed) for seed, name in enumerate(tried)]
        for name, life in zip(tried, lives, strict=True):
            try:
                paces[name].append(life.result())
            except ValueError as error:
                pool.shutdown(cancel_futures=True)
                raise ConfigError(f"an animal like the {name} one cannot be evaluated here: {error}") from error
    return {name: _slowest(found) for name, found in paces.items()}


def _slowest(paces: list[Pace]) -> Pace:
    return Pace(
        start_s=max(pace.start_s for pace in paces),
        steps_per_s=min(pace.steps_per_s for pace in paces),
        play_s=max(pace.play_s for pace in paces),
        policy_bytes=paces[0].policy_bytes,
    )


def _short_life(config: RunConfig, animal: Phenotype, seed: int) -> Pace:
    """A life of four rollouts: from one to the next, with an evaluation between the second and the third."""
    rollout = config.learning.n_envs * config.learning.n_steps
    short = replace(config.learning, total_steps=ROLLOUTS * rollout, eval_interval=ROLLOUTS // 2 * rollout)
    # Stages of the budget would be shorter than a rollout.
    once = replace(config, learning=short, search=replace(config.search, rungs=1))
    marks: list[float] = []
    with TemporaryDirectory() as folder:
        policy = Path(folder) / "policy"
        began = time.perf_counter()
        evaluate_candidate(
            *(animal, once, seed, policy),
            progress=lambda steps, planned: marks.append(time.perf_counter()),
        )
        size = policy.stat().st_size
    first, second, third, fourth = marks
    step_s = (second - first + fourth - third) / 2 / rollout
    return Pace(
        start_s=max(first - began - rollout * step_s, 0.0),
        steps_per_s=1 / step_s,
        play_s=max(third - second - rollout * step_s, 0.0),
        policy_bytes=size,
    )
