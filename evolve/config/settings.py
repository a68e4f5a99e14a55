"""The sections of a run's configuration: each setting with its default, its valid range and what it does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from evolve.genome.eye_config import EyeConfig, setting
from evolve.genome.interval import Interval

__all__ = [
    "SECTIONS",
    "EvaluationConfig",
    "EyeConfig",
    "LearningConfig",
    "SearchConfig",
    "WorldConfig",
    "setting",
]


@dataclass(frozen=True)
class WorldConfig:
    """What the worlds of a run are like, beside its task."""

    mazes: int = setting(1, Interval(1, 32), "number of mazes in the task maze; an episode begins in any of them")
    unseen: bool = setting(
        False,
        None,
        "evaluate in other mazes than those trained in; selection and early stopping use them, so not held out",
    )
    course: str = setting("short", None, "navigation's course: short, or long, twice as long in half as many actions")
    evaluation_course: str = setting("short", None, "navigation's course in evaluation")
    least_light: float = setting(
        1.0,
        Interval(1e-6, 1),
        "darkest light that an episode may have, as a share of daylight; each draws its own between that and 1",
    )

    @property
    def training(self) -> dict[str, Any]:
        """Arguments of `sim.make_vec_env` for worlds to learn in."""
        return {"mazes": self.mazes, "world_seed": 0, "course": self.course}

    @property
    def evaluation(self) -> dict[str, Any]:
        """The same for those that fitness comes from."""
        return {"mazes": self.mazes, "world_seed": int(self.unseen), "course": self.evaluation_course}

    @property
    def vary(self) -> dict[str, tuple[float, float]] | None:
        """What differs between episodes, as `sim.make_vec_env` has it; None: nothing."""
        return {"light": (self.least_light, 1.0)} if self.least_light < 1 else None


@dataclass(frozen=True)
class SearchConfig:
    """Who proposes candidates, how many at a time, and when it is told how they fared."""

    population: int = setting(16, Interval(2, 10_000), "candidates per generation")
    generations: int = setting(50, Interval(1, 100_000), "generations")
    sigma: float = setting(0.2, Interval(0, 1, open_low=True), "initial step size, as a fraction of each gene's range")
    optimizer: str = setting("CMA", None, "CMA, mutation, or the name of any nevergrad optimizer")
    active: bool = setting(
        False,
        None,
        "CMA learns from the worse half of a population, too; where the fittest are at the end of a gene's range, its "
        "steps then grow without bound",
    )
    steady_state: bool = setting(
        False, None, "propose a new candidate as soon as one has been evaluated; if false, generation by generation"
    )
    rungs: int = setting(
        1, Interval(1, 10), "budget stages of a training; after each, only the better candidates go on; 1: no halving"
    )
    promoted: float = setting(
        0.5,
        Interval(0, 0.9, open_low=True),
        "share of candidates that go on after a budget stage; also a stage's budget as a share of the next one's",
    )


@dataclass(frozen=True)
class LearningConfig:
    """PPO, for each candidate."""

    total_steps: int = setting(1_000_000, Interval(1, 10**10), "agent steps to train for")
    n_envs: int = setting(128, Interval(1, 65_536), "worlds simulated in parallel")
    n_steps: int = setting(32, Interval(2, 10**6), "steps per world between updates")
    batch_size: int = setting(1024, Interval(2, 10**7), "samples per gradient step")
    n_epochs: int = setting(10, Interval(1, 1000), "passes over the samples per update, at first")
    least_epochs: int = setting(
        3,
        Interval(1, 1000),
        "fewest passes, to which they fall once the step size has halved; n_epochs or more: they stay as many",
    )
    learning_rate: float = setting(
        3e-3,
        Interval(0, 1, open_low=True),
        "initial step size of Adam; brains of more than 64 units take √(64 / units) of it",
    )
    decay_after: int = setting(
        75_000,
        Interval(1, 10**10),
        "steps after which learning slows down as one over the steps: Adam's step size halves, then passes get fewer",
    )
    gamma: float = setting(0.9, Interval(0, 1), "discount per step")
    gae_lambda: float = setting(
        0.9, Interval(0, 1), "decay per step of the generalised advantage estimate (its lambda)"
    )
    value_weight: float = setting(4.0, Interval(0, 1000), "weight of the critic's loss relative to the actor's")
    first_speed: float = setting(
        0.5,
        Interval(0, 1, open_low=True),
        "mean speed of the untrained policy, and twice its spread, as a fraction of the top speed",
    )
    contact_ramp: int = setting(
        0,
        Interval(0, 10**10),
        "steps until contact costs its full price: a tenth of it for a third of them, then rising exponentially",
    )
    rays_per_receptor: float = setting(
        8.0,
        Interval(0, 4096, open_low=True),
        "most rays, or areas, per receptor and frame in training and in its checkpoints",
    )
    least_return: float = setting(
        0.0, Interval(-1e6, 0), "a training episode whose rewards add up to no more is truncated; 0: none is"
    )
    eval_interval: int = setting(50_000, Interval(1, 10**10), "training steps between evaluations")
    patience: int = setting(5, Interval(1, 10**6), "evaluations without improvement before training stops")


@dataclass(frozen=True)
class EvaluationConfig:
    """Fitness of a trained candidate."""

    episodes: int = setting(32, Interval(1, 10_000), "evaluation episodes whose mean return is the fitness")


SECTIONS: Mapping[str, type] = {
    "eye": EyeConfig,
    "world": WorldConfig,
    "search": SearchConfig,
    "learning": LearningConfig,
    "evaluation": EvaluationConfig,
}
