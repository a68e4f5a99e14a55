"""What executors are given: jobs, and whom to tell how far they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evolve.config.run_config import RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.learning.training_stage import TrainingStage

__all__ = ["ATTEMPTS", "ExecutorError", "Job", "Progress"]

ATTEMPTS = 3  # a candidate whose worker dies is evaluated again, twice at most
Progress = Callable[[int, int, int], None]  # (candidate id, steps trained, steps planned)


class ExecutorError(RuntimeError):
    """The workers cannot work at all; the message is one line that says why."""


@dataclass(frozen=True)
class Job:
    """One candidate to evaluate: arguments of `evolve.learning.fitness.evaluate`, under the candidate's id.

    stage: how far it is trained, where budgets are divided; None: to the end
    """

    id: int
    phenotype: Phenotype
    config: RunConfig
    seed: int
    policy_path: Path
    stage: TrainingStage | None = None

    @property
    def arguments(self) -> tuple[Any, ...]:
        stage = () if self.stage is None else (self.stage,)
        return self.phenotype, self.config, self.seed, self.policy_path, *stage
