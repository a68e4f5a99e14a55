"""Training runs with regular evaluations: goals reached over steps and CPU seconds."""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
from stable_baselines3.common.vec_env import VecEnvWrapper

import sim
from evolve.config.run_config import LearningConfig
from evolve.learning.played_episodes import play
from evolve.learning.policy import Brain
from evolve.learning.ppo import AdaptingPPO
from sim.tasks.reward import EVALUATION, TRAINING

__all__ = ["Case", "Row", "read_rows", "steps_to", "watched", "wilson", "write_rows"]

UNSEEN = 10_000  # added to the seed of a training run: evaluation worlds have unseen starts


@dataclass(frozen=True)
class Case:
    """A training run: eyes, task and settings.

    episodes: number of episodes in every evaluation, in worlds where an episode ends at the first object touched.
    """

    name: str
    eyes: sim.Eyes
    task: str = "detection"
    learning: LearningConfig = field(default_factory=LearningConfig)
    memory: int = 5
    neurons: int = 64
    rays_per_receptor: float | str = 1
    episodes: int = 100


@dataclass(frozen=True)
class Row:
    """One evaluation. Errors are standard errors of means, and NaN means not measured.

    cpu_seconds: CPU time of rollouts and updates so far, one thread.
    update_seconds: CPU time of updates.
    contacts: actions in contact per episode.
    distance: distance [m] of an episode's end from its start.
    """

    case: str
    seed: int
    steps: int
    cpu_seconds: float
    update_seconds: float
    goals: int
    adversaries: int
    episodes: int
    mean_return: float
    return_error: float = math.nan
    contacts: float = math.nan
    distance: float = math.nan
    distance_error: float = math.nan

    @property
    def fitness(self) -> float:
        """Fitness of an episode in the maze, where progress adds up to the distance from the start."""
        weights = EVALUATION
        return (
            weights.progress * self.distance
            + weights.contact * self.contacts
            + weights.goal * self.goals / self.episodes
        )

    @property
    def fitness_error(self) -> float:
        """Upper bound on the standard error of the fitness in a maze without goals.

        The number of contacts is computed from the difference between return and distance. Errors are assumed to add
        up.
        """
        contacts_error = TRAINING.progress * self.distance_error + self.return_error
        return EVALUATION.progress * self.distance_error - EVALUATION.contact * contacts_error


class Journey(VecEnvWrapper):
    """Worlds that record contacts (n,) and distance from the start [m] (n,) of their first episodes since a reset."""

    def reset(self) -> Any:
        observation = self.venv.reset()
        self.contacts, self.distance = np.zeros(self.num_envs), np.zeros(self.num_envs)
        self.playing = np.ones(self.num_envs, bool)
        self.start = self.venv.state.start.copy()
        return observation

    def step_wait(self) -> Any:
        observation, reward, done, infos = self.venv.step_wait()
        position = np.array([info["position"] for info in infos])
        contact = np.array([info["reward_terms"]["contact"] != 0 for info in infos])
        self.contacts += self.playing & contact
        self.distance[self.playing] = np.linalg.norm(position - self.start, axis=1)[self.playing]
        self.playing &= ~done
        return observation, reward, done, infos


def watched(case: Case, seed: int) -> Iterable[Row]:
    """Train once; yield a row after every `eval_interval` steps, without early stopping."""
    dr.set_thread_count(1)
    common: dict[str, Any] = {"memory": case.memory, "rays_per_receptor": case.rays_per_receptor}
    worlds = sim.make_vec_env(case.task, case.eyes, case.learning.n_envs, seed, **common)
    unseen = Journey(sim.make_vec_env(case.task, case.eyes, case.episodes, seed + UNSEEN, **common))
    model = AdaptingPPO(worlds, Brain(case.neurons), case.learning, seed)
    cpu_seconds = update_seconds = 0.0
    update = model.train

    def timed_update() -> None:
        nonlocal update_seconds
        began = time.process_time()
        update()
        update_seconds += time.process_time() - began

    model.train = timed_update
    while model.num_timesteps < case.learning.total_steps:
        began = time.process_time()
        model.learn(case.learning.eval_interval, reset_num_timesteps=False)
        cpu_seconds += time.process_time() - began
        episodes = play(model.policy, unseen, seed + UNSEEN)
        yield Row(
            case=case.name,
            seed=seed,
            steps=model.num_timesteps,
            cpu_seconds=round(cpu_seconds, 2),
            update_seconds=round(update_seconds, 2),
            goals=int((episodes.verdicts > 0).sum()),
            adversaries=int((episodes.verdicts < 0).sum()),
            episodes=case.episodes,
            mean_return=round(float(episodes.returns.mean()), 4),
            return_error=_error(episodes.returns),
            contacts=round(float(unseen.contacts.mean()), 2),
            distance=round(float(unseen.distance.mean()), 2),
            distance_error=_error(unseen.distance),
        )


def _error(values: np.ndarray) -> float:
    """Return the standard error of the mean."""
    return round(float(values.std(ddof=1)) / math.sqrt(len(values)), 4)


def wilson(successes: int, trials: int, z: float = 1.96) -> tuple[float, float]:
    """Return the interval for a probability, 95 % by default (Wilson 1927)."""
    share, spread = successes / trials, z * z / trials
    middle = (share + spread / 2) / (1 + spread)
    half = z / (1 + spread) * math.sqrt(share * (1 - share) / trials + spread / (4 * trials))
    return middle - half, middle + half


def steps_to(rows: Iterable[Row], threshold: float) -> Row | None:
    """Return the first evaluation in which the goal was reached first in at least this share of the episodes."""
    return next((row for row in rows if row.goals >= threshold * row.episodes), None)


def read_rows(path: Path) -> list[Row]:
    """Return the rows of a CSV file; an empty list without a file."""
    if not path.exists():
        return []
    kinds = {"str": str, "int": int, "float": float}
    with path.open(encoding="utf-8", newline="") as file:
        return [Row(**{f.name: kinds[str(f.type)](line[f.name]) for f in fields(Row)}) for line in csv.DictReader(file)]


def write_rows(rows: Iterable[Row], path: Path) -> None:
    """Write the rows to a CSV file atomically."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".tmp")
    with unfinished.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, [f.name for f in fields(Row)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
    unfinished.replace(path)
