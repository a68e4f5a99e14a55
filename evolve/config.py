"""Configuration of a run: what is asked for, checked value by value, frozen."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from evolve import anatomy
from evolve.genes import CLUSTERS, GENES, RELIEF_POINTS, Gene, GeneConfig, gene_table
from evolve.interval import Interval
from evolve.settings import AUTO, ConfigError
from optics.receptors import RECEPTORS

__all__ = [
    "INHERITED",
    "SECTIONS",
    "TASKS",
    "ConfigError",
    "EvaluationConfig",
    "EyeConfig",
    "GeneConfig",
    "LearningConfig",
    "RunConfig",
    "SearchConfig",
]

TASKS: Mapping[str, str] = {
    "navigation": "get as far as possible through a maze of striped corridors",
    "detection": "reach the goal sphere, avoid two adversaries that differ in stripe orientation only",
    "tracking": "detection with goal and adversaries that move",
    "foraging": "reach the goal sphere, avoid an adversary that differs below 400 nm only",
}


INHERITED = "genes"  # in place of receptors' name: each animal's are as its spectral genes say


def _setting(default: Any, valid: Interval | None, meaning: str) -> Any:
    """Dataclass field that knows its valid range and what it does."""
    return field(default=default, metadata={"valid": valid, "meaning": meaning})


@dataclass(frozen=True)
class EyeConfig:
    """What all eyes of a run have in common."""

    optics: bool = _setting(True, None, "see through pupil and relief; off: a perfect lens")
    sensor_width: float = _setting(200e-6, Interval(1e-6, 1e-2), "width of the retina [m]")
    noise_sigma: float = _setting(0.01, Interval(0, 10), "standard deviation of a receptor's noise [signal]")
    receptors: str = _setting(
        "rgb", None, "types of receptor: rgb, lms, honeybee or goldfish; genes: as an animal's spectral genes say"
    )
    bands: int = _setting(4, Interval(1, 64), "spectral bands")
    relief_height: float = _setting(
        100e-6, Interval(0, 1e-2, open_low=True), "height that a relief gene of 1 means [m]"
    )
    relief_points: int = _setting(
        4, RELIEF_POINTS, "genes of the relief along one side; 4: a bicubic patch, more: a cubic spline through as many"
    )
    relief_symmetric: bool = _setting(
        False, None, "reliefs look the same mirrored and turned by a quarter; an eighth of their genes says how"
    )
    rays_per_receptor: float | str = _setting(
        AUTO, Interval(0, 4096, open_low=True), "rays traced per receptor and frame; auto: as few as its noise allows"
    )
    head_radius: float = _setting(
        1e-3, Interval(0, 10, open_low=True), "radius of the head [m]; eyes on it do not overlap"
    )
    receptor_width: float = _setting(
        1e-6, Interval(0, 1e-2, open_low=True), "least width of a receptor [m]; receptors do not overlap"
    )

    @property
    def genes(self) -> Mapping[str, Gene]:
        """Every gene that animals with such eyes have, by name."""
        return gene_table(self.relief_points, self.relief_symmetric)


@dataclass(frozen=True)
class SearchConfig:
    """Who proposes candidates, how many at a time, and when it is told how they fared."""

    population: int = _setting(16, Interval(2, 10_000), "candidates per generation")
    generations: int = _setting(50, Interval(1, 100_000), "generations")
    sigma: float = _setting(0.2, Interval(0, 1, open_low=True), "initial step, as a part of each gene's range")
    optimizer: str = _setting("CMA", None, "CMA, mutation, or any optimizer of nevergrad by its name")
    steady_state: bool = _setting(
        False, None, "propose the next candidate as soon as one is evaluated; off: generation by generation"
    )
    rungs: int = _setting(
        1, Interval(1, 10), "budgets on the way to a whole training, on each of which only the better ones go on"
    )
    promoted: float = _setting(
        0.5, Interval(0, 0.9, open_low=True), "part that goes on from a rung, and of the next one's budget a rung has"
    )


@dataclass(frozen=True)
class LearningConfig:
    """PPO, for each candidate."""

    total_steps: int = _setting(1_000_000, Interval(1, 10**10), "agent steps to train for")
    n_envs: int = _setting(128, Interval(1, 65_536), "worlds simulated side by side")
    n_steps: int = _setting(32, Interval(2, 10**6), "steps per world between updates")
    batch_size: int = _setting(1024, Interval(2, 10**7), "samples per gradient step")
    n_epochs: int = _setting(10, Interval(1, 1000), "passes over the samples per update")
    learning_rate: float = _setting(3e-3, Interval(0, 1, open_low=True), "Adam's step size at first")
    decay_after: int = _setting(75_000, Interval(1, 10**10), "steps after which it falls, as one over the steps")
    gamma: float = _setting(0.9, Interval(0, 1), "discount per step")
    gae_lambda: float = _setting(0.9, Interval(0, 1), "share of what follows in an action's advantage, per step")
    value_weight: float = _setting(4.0, Interval(0, 1000), "weight of the critic's loss beside the actor's")
    first_speed: float = _setting(
        0.5, Interval(0, 1, open_low=True), "speed of the first actions, and twice its spread, as a part of the highest"
    )
    contact_ramp: int = _setting(
        0, Interval(0, 10**10), "steps until contact costs its all: a tenth for a third of them, then evenly more"
    )
    rays_per_eye: float = _setting(
        256.0,
        Interval(0, 10**7, open_low=True),
        "rays per eye and frame of a training, at most; one per receptor at least",
    )
    eval_interval: int = _setting(50_000, Interval(1, 10**10), "training steps between evaluations")
    patience: int = _setting(5, Interval(1, 10**6), "evaluations without improvement before training stops")


@dataclass(frozen=True)
class EvaluationConfig:
    """Fitness of a trained candidate."""

    episodes: int = _setting(32, Interval(1, 10_000), "evaluation episodes whose mean return is the fitness")


SECTIONS: Mapping[str, type] = {
    "eye": EyeConfig,
    "search": SearchConfig,
    "learning": LearningConfig,
    "evaluation": EvaluationConfig,
}


@dataclass(frozen=True)
class RunConfig:
    """Everything that decides a run's outcome, and how many processes work on it.

    Raises:
        ConfigError: settings that contradict each other.
    """

    task: str
    seed: int = _setting(0, Interval(0, 2**63 - 1), "seed of search, training and evaluation")
    workers: int = _setting(0, Interval(0, 1024), "worker processes; 0: one per core")
    eye: EyeConfig = field(default_factory=EyeConfig)
    genome: Mapping[str, GeneConfig] = field(default_factory=lambda: {name: g.default for name, g in GENES.items()})
    search: SearchConfig = field(default_factory=SearchConfig)
    learning: LearningConfig = field(default_factory=LearningConfig)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)

    def __post_init__(self) -> None:
        if self.task not in TASKS:
            raise ConfigError(f"task = {self.task!r}: must be one of {', '.join(TASKS)}", "task")
        if self.eye.receptors not in (known := (*RECEPTORS, INHERITED)):
            raise ConfigError(
                f"eye.receptors = {self.eye.receptors!r}: must be one of {', '.join(known)}", "eye.receptors"
            )
        for name, gene in self.eye.genes.items():
            _check_gene_use(gene, self.genome[name])
        self._check_clusters()
        self._check_phases()
        rollout = self.learning.n_envs * self.learning.n_steps
        if self.learning.batch_size > rollout:
            raise ConfigError(
                f"learning.batch_size = {self.learning.batch_size}: must be at most n_envs x n_steps = {rollout}",
                *("learning.batch_size", "learning.n_envs", "learning.n_steps"),
            )
        self._check_ladder(rollout)
        if (cramped := anatomy.contradiction(self.genome, self.eye)) is not None:
            message, keys = cramped
            raise ConfigError(message, *keys)

    def _check_clusters(self) -> None:
        """Something must be open, and nothing that the run leaves out."""
        genes = [gene for name, gene in self.eye.genes.items() if self.genome[name].open]
        opened = {
            cluster: [f"genome.{gene.name}.open" for gene in genes if gene.cluster == cluster] for cluster in CLUSTERS
        }
        if not self.eye.optics and opened["optical"]:
            raise ConfigError(
                "eye.optics = false leaves no optical gene to evolve: set genome.optical.open = false",
                *("eye.optics", *opened["optical"]),
            )
        if self.eye.receptors != INHERITED and opened["spectral"]:
            raise ConfigError(
                f"eye.receptors = {self.eye.receptors!r} leaves no spectral gene to evolve: set eye.receptors = "
                f"{INHERITED!r}, or genome.spectral.open = false",
                *("eye.receptors", *opened["spectral"]),
            )
        if not any(use.open for use in self.genome.values()):
            keys = [f"genome.{name}.open" for name in self.genome]
            raise ConfigError("genome: every gene is frozen; open at least one (genome.NAME.open = true)", *keys)

    def _check_ladder(self, rollout: int) -> None:
        """A ladder is climbed by whole generations, and its first rung must teach something."""
        search = self.search
        if search.rungs == 1:
            return
        if search.steady_state:
            raise ConfigError(
                f"search.rungs = {search.rungs}: a ladder needs generations; set search.steady_state = false",
                *("search.rungs", "search.steady_state"),
            )
        first = self.learning.total_steps * search.promoted ** (search.rungs - 1)
        if first < rollout:
            raise ConfigError(
                f"search.rungs = {search.rungs}: the first rung's budget, {first:.0f} steps, is less than one rollout "
                f"of {rollout} (learning.n_envs x n_steps)",
                *("search.rungs", "search.promoted", "learning.total_steps"),
            )

    def _check_phases(self) -> None:
        """Every open gene must open within the run, and one of them at its beginning."""
        opening = {name: use.opens_at for name, use in self.genome.items() if use.open}
        for name, generation in opening.items():
            if generation >= self.search.generations:
                raise ConfigError(
                    f"genome.{name}.opens_at = {generation}: must be below search.generations = "
                    f"{self.search.generations}, else the gene never opens",
                    *(f"genome.{name}.opens_at", "search.generations"),
                )
        if min(opening.values()) > 0:
            raise ConfigError(
                f"genome: no gene opens before generation {min(opening.values())}; one must open at 0",
                *(f"genome.{name}.opens_at" for name in opening),
            )

    @property
    def candidates(self) -> int:
        """Evaluations in the whole run."""
        return self.search.population * self.search.generations


def _check_gene_use(gene: Gene, use: GeneConfig) -> None:
    """A gene's search range must be one, and hold its start."""
    key = f"genome.{gene.name}"
    if use.start not in gene.range or math.isnan(use.start):
        raise ConfigError(f"{key}.start = {use.start:g}: must be in {gene.range}", f"{key}.start")
    if not use.open:
        return
    keys = (f"{key}.low", f"{key}.high", f"{key}.start")
    if not use.low < use.high:
        raise ConfigError(f"{key}: open, but low = {use.low:g} is not below high = {use.high:g}", *keys[:2])
    if not use.low <= use.start <= use.high:
        raise ConfigError(
            f"{key}.start = {use.start:g}: must be in the searched range [{use.low:g}, {use.high:g}]", *keys
        )
