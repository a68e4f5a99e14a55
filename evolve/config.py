"""Configuration of a run: what is asked for, checked value by value, frozen."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from evolve.genotype import GENES, Gene, GeneConfig
from evolve.interval import Interval

__all__ = [
    "SECTIONS",
    "TASKS",
    "ConfigError",
    "EvaluationConfig",
    "EyeConfig",
    "GeneConfig",
    "LearningConfig",
    "RunConfig",
    "SearchConfig",
    "check_gene_value",
    "check_value",
]

TASKS: Mapping[str, str] = {
    "navigation": "get as far as possible through a maze of striped corridors",
    "detection": "reach the goal sphere, avoid two adversaries that differ in stripe orientation only",
    "tracking": "detection with goal and adversaries that move",
}


class ConfigError(ValueError):
    """A setting that cannot be used; the message is one line naming key, value and what is allowed."""


def _setting(default: Any, valid: Interval | None, meaning: str) -> Any:
    """Dataclass field that knows its valid range and what it does."""
    return field(default=default, metadata={"valid": valid, "meaning": meaning})


@dataclass(frozen=True)
class EyeConfig:
    """What all eyes of a run have in common."""

    optics: bool = _setting(True, None, "see through pupil and relief; off: a perfect lens")
    sensor_width: float = _setting(200e-6, Interval(1e-6, 1e-2), "width of the retina [m]")
    noise_sigma: float = _setting(0.01, Interval(0, 10), "standard deviation of a receptor's noise [signal]")
    bands: int = _setting(4, Interval(1, 64), "spectral bands")
    relief_height: float = _setting(
        100e-6, Interval(0, 1e-2, open_low=True), "height that a relief gene of 1 means [m]"
    )
    rays_per_receptor: int = _setting(4, Interval(1, 4096), "rays traced per receptor and frame")


@dataclass(frozen=True)
class SearchConfig:
    """CMA-ES."""

    population: int = _setting(16, Interval(2, 10_000), "candidates per generation")
    generations: int = _setting(50, Interval(1, 100_000), "generations")
    sigma: float = _setting(0.2, Interval(0, 1, open_low=True), "initial step, as a part of each gene's range")


@dataclass(frozen=True)
class LearningConfig:
    """PPO, for each candidate."""

    total_steps: int = _setting(1_000_000, Interval(1, 10**10), "agent steps to train for")
    n_envs: int = _setting(64, Interval(1, 65_536), "worlds simulated side by side")
    n_steps: int = _setting(64, Interval(2, 10**6), "steps per world between updates")
    batch_size: int = _setting(1024, Interval(2, 10**7), "samples per gradient step")
    n_epochs: int = _setting(4, Interval(1, 1000), "passes over the samples per update")
    learning_rate: float = _setting(1e-3, Interval(0, 1, open_low=True), "Adam's step size")
    gamma: float = _setting(0.99, Interval(0, 1), "discount per step")
    eval_interval: int = _setting(50_000, Interval(1, 10**10), "training steps between evaluations")
    patience: int = _setting(5, Interval(1, 10**6), "evaluations without improvement before training stops")


@dataclass(frozen=True)
class EvaluationConfig:
    """Fitness of a trained candidate."""

    episodes: int = _setting(6, Interval(1, 10_000), "evaluation episodes whose mean return is the fitness")


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
            raise ConfigError(f"task = {self.task!r}: must be one of {', '.join(TASKS)}")
        for name, gene in GENES.items():
            _check_gene_use(gene, self.genome[name])
        if not self.eye.optics and any(self.genome[name].open for name, g in GENES.items() if g.cluster == "optical"):
            raise ConfigError("eye.optics = false leaves no optical gene to evolve: set genome.optical.open = false")
        if not any(use.open for use in self.genome.values()):
            raise ConfigError("genome: every gene is frozen; open at least one (genome.NAME.open = true)")
        rollout = self.learning.n_envs * self.learning.n_steps
        if self.learning.batch_size > rollout:
            raise ConfigError(
                f"learning.batch_size = {self.learning.batch_size}: must be at most n_envs x n_steps = {rollout}"
            )

    @property
    def candidates(self) -> int:
        """Evaluations in the whole run."""
        return self.search.population * self.search.generations


def check_value(cls: type, name: str, value: Any, key: str) -> Any:
    """`value` as field `name` of `cls` takes it; raises ConfigError naming `key`, the value and what is allowed."""
    definition = next(f for f in fields(cls) if f.name == name)
    kind = {"int": int, "float": float, "bool": bool, "str": str}[str(definition.type)]
    return _checked(value, kind, definition.metadata.get("valid"), key)


def check_gene_value(gene: Gene, name: str, value: Any, key: str) -> Any:
    """`value` as a gene's "open", "low", "high" or "start" takes it; raises ConfigError."""
    if name == "open":
        return _checked(value, bool, None, key)
    return float(_checked(value, int if gene.kind == "integer" else float, gene.range, key))


def _checked(value: Any, kind: type[Any], valid: Interval | None, key: str) -> Any:
    """`value`, if it is of this kind (a whole number may stand for a number) and in `valid`."""
    names = {int: "an integer", float: "a number", bool: "true or false", str: "text"}
    shown = str(value).lower() if isinstance(value, bool) else repr(value)
    if kind is float and type(value) is int:
        value = float(value)
    if type(value) is not kind:
        raise ConfigError(f"{key} = {shown}: must be {names[kind]}")
    if valid is not None and value not in valid:
        raise ConfigError(f"{key} = {shown}: must be in {valid}")
    return value


def _check_gene_use(gene: Gene, use: GeneConfig) -> None:
    """A gene's search range must be one, and hold its start."""
    key = f"genome.{gene.name}"
    if use.start not in gene.range or math.isnan(use.start):
        raise ConfigError(f"{key}.start = {use.start:g}: must be in {gene.range}")
    if not use.open:
        return
    if not use.low < use.high:
        raise ConfigError(f"{key}: open, but low = {use.low:g} is not below high = {use.high:g}")
    if not use.low <= use.start <= use.high:
        raise ConfigError(f"{key}.start = {use.start:g}: must be in the searched range [{use.low:g}, {use.high:g}]")
