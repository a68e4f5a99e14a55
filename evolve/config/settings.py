"""Sections of a run's configuration. Each setting is defined with its default, valid range and effect.

The dataclasses do not check their values; `RunConfig` checks them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from evolve.config.costs import CostsConfig
from evolve.genome.eye_config import EyeConfig, setting
from evolve.genome.interval import Interval

__all__ = [
    "FAMILY",
    "SECTIONS",
    "CostsConfig",
    "EvaluationConfig",
    "EyeConfig",
    "LearningConfig",
    "SearchConfig",
    "WiringConfig",
    "WorldConfig",
    "setting",
]

FAMILY = "family"  # value of world.layouts


@dataclass(frozen=True)
class WorldConfig:
    """Settings of the worlds for training and evaluation of animals. `evolve config schema` describes each field."""

    mazes: int = setting(1, Interval(1, 32), "number of mazes in the task maze; an episode begins in any of them")
    unseen: bool = setting(
        False,
        None,
        "evaluate in mazes that training does not use; early stopping and selection use them, so they are no test set",
    )
    course: str = setting("short", None, "navigation's course: short, or long (twice the length, half the actions)")
    evaluation_course: str = setting("short", None, "navigation's course in evaluation")
    layouts: str = setting(
        "fixed",
        None,
        "layouts of navigation and maze: fixed (set by course, mazes and unseen); or family: random courses or "
        "mazes in three sets without a common layout, for training, selection (early stopping and fitness) and test",
    )
    family_seed: int = setting(0, Interval(0, 2**63 - 1), "seed of a family; the same layouts for all candidates")
    training_layouts: int = setting(8, Interval(1, 100), "number of a family's layouts for training")
    selection_layouts: int = setting(8, Interval(1, 100), "number of a family's layouts for selection")
    test_layouts: int = setting(8, Interval(1, 100), "number of a family's layouts for final results")
    layout_rows: int = setting(13, Interval(7, 31), "cells of a family's layouts along y, outer walls included; odd")
    layout_columns: int = setting(39, Interval(15, 99), "cells of a family's layouts along x; odd")
    path_width: int = setting(3, Interval(1, 3), "width of the paths of a family's courses [cells]: 1 or 3")
    layout_actions: int = setting(
        0, Interval(0, 10**6), "actions after which an episode in a family's layouts is truncated; 0: 256"
    )
    selection_set: str = setting(
        "selection",
        None,
        "a family's set for early stopping and fitness: selection; or training, which rewards memory of the layouts",
    )
    wall_height: float = setting(1.0, Interval(0.4, 100), "height of the walls [m]; 0.5 in the published code")
    least_light: float = setting(
        1.0,
        Interval(1e-6, 1),
        "lowest light level, relative to daylight; the level of each episode is drawn between this and 1",
    )

    medium: str = setting(
        "air",
        None,
        "water or air between surfaces and eyes: air (clear; in a user task, its own medium), clear_ocean, "
        "coastal_water or fog; under water, eyes are immersed",
    )
    encoded_textures: bool = setting(
        True,
        None,
        "textures contain display colours, unless the model requests linear light; if false, MuJoCo's "
        "compiler decides which textures contain linear light, as in runs without this setting",
    )

    @property
    def training(self) -> dict[str, Any]:
        """Arguments of `sim.build_world` that define the worlds in training."""
        return {"mazes": self.mazes, "seed": 0, "course": self.course, **self._walls("training")}

    @property
    def evaluation(self) -> dict[str, Any]:
        """Arguments of `sim.build_world` that define the worlds in which fitness is evaluated."""
        fixed = {"mazes": self.mazes, "seed": int(self.unseen), "course": self.evaluation_course}
        return {**fixed, **self._walls(self.selection_set)}

    @property
    def test(self) -> dict[str, Any]:
        """Arguments of `sim.build_world` that define the worlds in which final results are measured.

        If `world.layouts` requests a family of random layouts, the worlds have the layouts of the family's test set,
        which neither training nor selection uses. If the layouts are fixed, the worlds are those in which fitness is
        evaluated.
        """
        return {**self.evaluation, **self._walls("test")}

    def _walls(self, name: str) -> dict[str, Any]:
        """Return arguments of `sim.build_world`: the height of walls, the medium and a set of layouts.

        name: name of the set of layouts: "training", "selection" or "test"
        """
        layouts = None
        if self.layouts == FAMILY:
            from sim.worlds.layout_family import LayoutFamily  # loads MuJoCo, which `evolve list` does not need

            counts = {"n_training": self.training_layouts, "n_selection": self.selection_layouts}
            size = {"rows": self.layout_rows, "columns": self.layout_columns, "path_width": self.path_width}
            steps = self.layout_actions or None
            family = LayoutFamily(self.family_seed, **counts, n_test=self.test_layouts, **size, episode_steps=steps)
            layouts = getattr(family, name)
        return {"layouts": layouts, "wall_height": self.wall_height, "medium": self.medium}

    @property
    def vary(self) -> dict[str, tuple[float, float]] | None:
        """Value of the argument `vary` of `sim.make_vec_env`; None if the light is the same in all episodes."""
        return {"light": (self.least_light, 1.0)} if self.least_light < 1 else None


@dataclass(frozen=True)
class SearchConfig:
    """Settings of the search, such as optimizer and population. `RunConfig` checks the values.

    `evolve config schema` describes each field.
    """

    population: int = setting(16, Interval(2, 10_000), "candidates per generation")
    generations: int = setting(50, Interval(1, 100_000), "generations")
    sigma: float = setting(0.2, Interval(0, 1, open_low=True), "initial step size, as a fraction of each gene's range")
    optimizer: str = setting("CMA", None, "CMA, mutation, or the name of any nevergrad optimizer")
    active: bool = setting(
        False,
        None,
        "CMA also learns from the worse half of a population; its steps then grow without bound if the "
        "fittest candidates are at the end of a gene's range",
    )
    steady_state: bool = setting(
        False, None, "propose a new candidate as soon as one has been evaluated; if false, generation by generation"
    )
    rungs: int = setting(
        1,
        Interval(1, 10),
        "rungs (stages) of successive halving; only the better candidates continue after a rung; 1: no halving",
    )
    promoted: float = setting(
        0.5,
        Interval(0, 0.9, open_low=True),
        "fraction of candidates that continue after a rung; also a rung's steps as a fraction of the next rung's",
    )


@dataclass(frozen=True)
class LearningConfig:
    """Settings of the training of each candidate by PPO. `RunConfig` checks the values.

    `evolve config schema` describes each field.
    """

    total_steps: int = setting(1_000_000, Interval(1, 10**10), "number of agent steps in a training run")
    n_envs: int = setting(128, Interval(1, 65_536), "worlds simulated in parallel")
    n_steps: int = setting(32, Interval(2, 10**6), "steps per world between updates")
    batch_size: int = setting(1024, Interval(2, 10**7), "samples per gradient step")
    n_epochs: int = setting(10, Interval(1, 1000), "initial number of passes over the samples per update")
    least_epochs: int = setting(
        3,
        Interval(1, 1000),
        "minimum number of passes; they start to fall after the step size has halved; n_epochs or more: no fall",
    )
    learning_rate: float = setting(
        3e-3,
        Interval(0, 1, open_low=True),
        "initial step size of Adam; multiplied by √(64 / units) for brains with more than 64 units per layer",
    )
    decay_after: int = setting(
        75_000,
        Interval(1, 10**10),
        "steps after which step size x passes falls as 1/steps: first Adam's step size falls to half, then the passes",
    )
    gamma: float = setting(0.9, Interval(0, 1), "discount per step")
    gae_lambda: float = setting(
        0.9, Interval(0, 1), "decay per step of the generalised advantage estimate (its lambda)"
    )
    value_weight: float = setting(4.0, Interval(0, 1000), "weight of the critic's loss relative to the actor's")
    first_speed: float = setting(
        0.5,
        Interval(0, 1, open_low=True),
        "mean speed of the untrained policy, as a fraction of the top speed; its standard deviation is half of it",
    )
    contact_ramp: int = setting(
        0,
        Interval(0, 10**10),
        "steps until contact has its full cost; the cost is a tenth for the first third, then rises exponentially",
    )
    rays_per_receptor: float = setting(
        8.0,
        Interval(0, 4096, open_low=True),
        "maximum number of rays, or areas, per receptor and frame in training and in its evaluations",
    )
    least_return: float = setting(
        0.0, Interval(-1e6, 0), "a training episode is truncated when its return falls to this value; 0: never"
    )
    eval_interval: int = setting(50_000, Interval(1, 10**10), "training steps between evaluations of the policy")
    patience: int = setting(5, Interval(1, 10**6), "evaluations without improvement after which training stops")


@dataclass(frozen=True)
class WiringConfig:
    """Settings of the connections between the receptors of an eye and its encoder.

    `evolve config schema` describes each field.

    `pool_side` has no effect along an axis with at most `pool_side` receptors. `repeat_side` has no effect along an
    axis with at least `repeat_side` signals after the averaging by `pool_side`. Both must be 0 for compound eyes.
    """

    shared_encoder: bool = setting(False, None, "all eyes have the same encoder, with the same weights")
    pool_side: int = setting(
        0, Interval(0, 256), "signals are averaged on a grid of this many rows and columns before the encoder; 0: never"
    )
    repeat_side: int = setting(
        0,
        Interval(0, 256),
        "signals, averaged or not, are then repeated on a grid of this many rows and columns; 0: never",
    )


DIRECT = WiringConfig()  # each receptor is an input of its eye's own encoder


@dataclass(frozen=True)
class EvaluationConfig:
    """Settings of the evaluation of fitness. `RunConfig` checks the values.

    `evolve config schema` describes each field.
    """

    episodes: int = setting(32, Interval(1, 10_000), "evaluation episodes whose mean return is the task fitness")


SECTIONS: Mapping[str, type] = {
    "eye": EyeConfig,
    "world": WorldConfig,
    "search": SearchConfig,
    "learning": LearningConfig,
    "wiring": WiringConfig,
    "evaluation": EvaluationConfig,
    "costs": CostsConfig,
}
