"""Sections of a run's configuration. Each setting is defined with its default, valid range and effect."""

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
    "WiringConfig",
    "WorldConfig",
    "setting",
]


@dataclass(frozen=True)
class WorldConfig:
    """Settings of the worlds in which animals are trained and evaluated."""

    mazes: int = setting(1, Interval(1, 32), "number of mazes in the task maze; an episode begins in any of them")
    unseen: bool = setting(
        False,
        None,
        "evaluate in other mazes than those of training; selection and early stopping use them: they are not held out",
    )
    course: str = setting("short", None, "navigation's course: short, or long (twice the length, half the actions)")
    evaluation_course: str = setting("short", None, "navigation's course in evaluation")
    least_light: float = setting(
        1.0,
        Interval(1e-6, 1),
        "darkest light of an episode, as a share of daylight; each episode draws its light between this and 1",
    )

    encoded_textures: bool = setting(
        True,
        None,
        "textures contain display colours, unless the model requests linear light; if false, those that MuJoCo's "
        "compiler resolves to linear light contain it, as in runs without this setting",
    )

    @property
    def training(self) -> dict[str, Any]:
        """Arguments of `sim.make_vec_env` that define the worlds in training."""
        return {"mazes": self.mazes, "world_seed": 0, "course": self.course}

    @property
    def evaluation(self) -> dict[str, Any]:
        """Arguments of `sim.make_vec_env` that define the worlds in which fitness is evaluated."""
        return {"mazes": self.mazes, "world_seed": int(self.unseen), "course": self.evaluation_course}

    @property
    def vary(self) -> dict[str, tuple[float, float]] | None:
        """Value of the argument `vary` of `sim.make_vec_env`; None if the light is the same in all episodes."""
        return {"light": (self.least_light, 1.0)} if self.least_light < 1 else None


@dataclass(frozen=True)
class SearchConfig:
    """Settings of the search: optimizer, population and successive halving."""

    population: int = setting(16, Interval(2, 10_000), "candidates per generation")
    generations: int = setting(50, Interval(1, 100_000), "generations")
    sigma: float = setting(0.2, Interval(0, 1, open_low=True), "initial step size, as a fraction of each gene's range")
    optimizer: str = setting("CMA", None, "CMA, mutation, or the name of any nevergrad optimizer")
    active: bool = setting(
        False,
        None,
        "CMA also learns from the worse half of a population; if the fittest are at the end of a gene's range, its "
        "steps then grow without bound",
    )
    steady_state: bool = setting(
        False, None, "propose a new candidate as soon as one has been evaluated; if false, generation by generation"
    )
    rungs: int = setting(
        1, Interval(1, 10), "rungs of a training run; only the better candidates continue after a rung; 1: no halving"
    )
    promoted: float = setting(
        0.5,
        Interval(0, 0.9, open_low=True),
        "share of candidates that continue after a rung; also a rung's budget as a share of the next rung's",
    )


@dataclass(frozen=True)
class LearningConfig:
    """Settings of the training of each candidate by PPO."""

    total_steps: int = setting(1_000_000, Interval(1, 10**10), "agent steps to train for")
    n_envs: int = setting(128, Interval(1, 65_536), "worlds simulated in parallel")
    n_steps: int = setting(32, Interval(2, 10**6), "steps per world between updates")
    batch_size: int = setting(1024, Interval(2, 10**7), "samples per gradient step")
    n_epochs: int = setting(10, Interval(1, 1000), "initial number of passes over the samples per update")
    least_epochs: int = setting(
        3,
        Interval(1, 1000),
        "minimum number of passes, which fall to it after the step size has halved; n_epochs or more: constant passes",
    )
    learning_rate: float = setting(
        3e-3,
        Interval(0, 1, open_low=True),
        "initial step size of Adam; brains of more than 64 units use √(64 / units) of it",
    )
    decay_after: int = setting(
        75_000,
        Interval(1, 10**10),
        "steps after which learning slows down as 1/steps: Adam's step size falls to half, then the passes decrease",
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
        "steps until contact has its full cost: a tenth of it for the first third, then rising exponentially",
    )
    rays_per_receptor: float = setting(
        8.0,
        Interval(0, 4096, open_low=True),
        "maximum rays, or areas, per receptor and frame in training and in its checkpoints",
    )
    least_return: float = setting(
        0.0, Interval(-1e6, 0), "a training episode is truncated when its return falls to this value; 0: never"
    )
    eval_interval: int = setting(50_000, Interval(1, 10**10), "training steps between evaluations")
    patience: int = setting(5, Interval(1, 10**6), "evaluations without improvement before training stops")


@dataclass(frozen=True)
class WiringConfig:
    """Settings of the connections between the receptors of an eye and its encoder.

    An axis of the retina with fewer receptors than `pool_side`, or more than `repeat_side`, is left as it is.
    """

    shared_encoder: bool = setting(False, None, "all eyes have the same encoder, with the same weights")
    pool_side: int = setting(
        0, Interval(0, 256), "signals are averaged to a grid of this many rows and columns before the encoder; 0: never"
    )
    repeat_side: int = setting(
        0,
        Interval(0, 256),
        "signals, averaged or not, are then repeated on a grid of this many rows and columns; 0: never",
    )


DIRECT = WiringConfig()  # each receptor is an input of its eye's own encoder


@dataclass(frozen=True)
class EvaluationConfig:
    """Settings of the evaluation of fitness."""

    episodes: int = setting(32, Interval(1, 10_000), "evaluation episodes whose mean return is the fitness")


SECTIONS: Mapping[str, type] = {
    "eye": EyeConfig,
    "world": WorldConfig,
    "search": SearchConfig,
    "learning": LearningConfig,
    "wiring": WiringConfig,
    "evaluation": EvaluationConfig,
}
