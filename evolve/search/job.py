"""The class `Job`, a candidate that an executor evaluates, and `Progress`, the type of progress callbacks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evolve.config.run_config import RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.learning.training_rung import TrainingRung

__all__ = ["ATTEMPTS", "ExecutorError", "Job", "Progress"]

ATTEMPTS = 3  # maximum number of attempts to evaluate a candidate, if its worker dies in each
Progress = Callable[[int, int, int], None]  # (candidate id, steps trained, steps planned)


class ExecutorError(RuntimeError):
    """Candidates cannot be evaluated by the workers of an executor; the message states the reason in one line."""


@dataclass(frozen=True)
class Job:
    """One candidate to evaluate.

    id: id of the candidate
    phenotype, config: eyes and brain of the candidate, and settings of the run
    seed: seed of training and evaluation
    policy_path: file to which the trained policy is written
    rung: rung at whose end training stops; None: training is not divided into rungs
    """

    id: int
    phenotype: Phenotype
    config: RunConfig
    seed: int
    policy_path: Path
    rung: TrainingRung | None = None

    @property
    def arguments(self) -> tuple[Any, ...]:
        """Positional arguments of the function that evaluates the candidate."""
        rung = () if self.rung is None else (self.rung,)
        return self.phenotype, self.config, self.seed, self.policy_path, *rung
