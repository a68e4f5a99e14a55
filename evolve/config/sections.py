"""The sections of a run's configuration: each setting with its default, its valid range and what it does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from evolve.config.checks import AUTO
from evolve.genome.genes import RELIEF_POINTS, Gene, gene_table
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


def setting(default: Any, valid: Interval | None, meaning: str) -> Any:
    """Dataclass field that knows its valid range and what it does."""
    return field(default=default, metadata={"valid": valid, "meaning": meaning})


@dataclass(frozen=True)
class EyeConfig:
    """What all eyes of a run have in common."""

    optics: bool = setting(True, None, "see through pupil and relief; off: a perfect lens")
    sensor_width: float = setting(200e-6, Interval(1e-6, 1e-2), "width of the retina [m]")
    noise_sigma: float = setting(0.01, Interval(0, 10), "standard deviation of a receptor's noise [signal]")
    illuminance: float = setting(
        0.0, Interval(0, 1e6), "daylight on the scene [lx], whose photons receptors count; 0: no shot noise"
    )
    integration_time: float = setting(
        0.02, Interval(1e-6, 1e3), "time over which a receptor sums photons [s]; counts where illuminance does"
    )
    receptors: str = setting(
        "rgb", None, "types of receptor: rgb, lms, honeybee or goldfish; genes: as an animal's spectral genes say"
    )
    bands: int = setting(4, Interval(1, 64), "spectral bands")
    relief_height: float = setting(100e-6, Interval(0, 1e-2, open_low=True), "height that a relief gene of 1 means [m]")
    relief_points: int = setting(
        4, RELIEF_POINTS, "genes of the relief along one side; 4: a bicubic patch, more: a cubic spline through as many"
    )
    relief_symmetric: bool = setting(
        False, None, "reliefs look the same mirrored and turned by a quarter; an eighth of their genes says how"
    )
    rays_per_receptor: float | str = setting(
        AUTO, Interval(0, 4096, open_low=True), "rays traced per receptor and frame; auto: as few as its noise allows"
    )
    head_radius: float = setting(
        1e-3, Interval(0, 10, open_low=True), "radius of the head [m]; eyes on it do not overlap"
    )
    receptor_width: float = setting(
        1e-6, Interval(0, 1e-2, open_low=True), "least width of a receptor [m]; receptors do not overlap"
    )

    @property
    def genes(self) -> Mapping[str, Gene]:
        """Every gene that animals with such eyes have, by name."""
        return gene_table(self.relief_points, self.relief_symmetric)


@dataclass(frozen=True)
class WorldConfig:
    """What the worlds of a run are like, beside its task."""

    mazes: int = setting(1, Interval(1, 32), "mazes of navigation; episodes begin in any of them")
    unseen: bool = setting(
        False,
        None,
        "evaluate in as many mazes that nobody trains in; off: in the same. The search, and when to stop, go by these",
    )

    @property
    def training(self) -> dict[str, Any]:
        """Arguments of `sim.make_vec_env` for worlds to learn in."""
        return {"mazes": self.mazes, "world_seed": 0}

    @property
    def evaluation(self) -> dict[str, Any]:
        """The same for those that fitness comes from."""
        return {"mazes": self.mazes, "world_seed": int(self.unseen)}


@dataclass(frozen=True)
class SearchConfig:
    """Who proposes candidates, how many at a time, and when it is told how they fared."""

    population: int = setting(16, Interval(2, 10_000), "candidates per generation")
    generations: int = setting(50, Interval(1, 100_000), "generations")
    sigma: float = setting(0.2, Interval(0, 1, open_low=True), "initial step, as a part of each gene's range")
    optimizer: str = setting("CMA", None, "CMA, mutation, or any optimizer of nevergrad by its name")
    steady_state: bool = setting(
        False, None, "propose the next candidate as soon as one is evaluated; off: generation by generation"
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
    n_envs: int = setting(128, Interval(1, 65_536), "worlds simulated side by side")
    n_steps: int = setting(32, Interval(2, 10**6), "steps per world between updates")
    batch_size: int = setting(1024, Interval(2, 10**7), "samples per gradient step")
    n_epochs: int = setting(10, Interval(1, 1000), "passes over the samples per update")
    learning_rate: float = setting(3e-3, Interval(0, 1, open_low=True), "Adam's step size at first")
    decay_after: int = setting(75_000, Interval(1, 10**10), "steps after which it falls, as one over the steps")
    gamma: float = setting(0.9, Interval(0, 1), "discount per step")
    gae_lambda: float = setting(0.9, Interval(0, 1), "share of what follows in an action's advantage, per step")
    value_weight: float = setting(4.0, Interval(0, 1000), "weight of the critic's loss beside the actor's")
    first_speed: float = setting(
        0.5, Interval(0, 1, open_low=True), "speed of the first actions, and twice its spread, as a part of the highest"
    )
    contact_ramp: int = setting(
        0, Interval(0, 10**10), "steps until contact costs its all: a tenth for a third of them, then evenly more"
    )
    rays_per_eye: float = setting(
        256.0,
        Interval(0, 10**7, open_low=True),
        "rays per eye and frame of a training, at most; one per receptor at least",
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
