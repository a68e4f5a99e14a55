"""Start values for the genes of a pupil's relief, converted to the number of genes that the eyes of a run have."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from evolve.config.checks import ConfigError
from evolve.config.run_config import EyeConfig
from evolve.genome.genes import RELIEF_POINTS
from evolve.genome.relief_genes import PATCH, doe_names, refined, representatives

__all__ = ["no_such_gene", "with_relief"]

Tree = dict[str, Any]


def with_relief(tree: Tree, eye: EyeConfig) -> Tree:
    """Return the settings `tree`, with the start values of relief genes converted to the number of genes of the eyes.

    The start values in `tree` may describe a whole relief of 4 x 4 points, by all its genes or by the genes of a
    symmetric relief. If the eyes have more points, these values are converted to the same surface with more points. If
    reliefs are symmetric, settings that follow from others by symmetry are removed.

    Raises:
        ConfigError: `tree` contains start values for more than 4 x 4 genes, and the eyes have even more genes.
    """
    genes, names = tree.get("genome", {}), doe_names(eye.relief_points)
    side = _spelled_out(genes)
    if PATCH < side < eye.relief_points:
        raise ConfigError(
            f"eye.relief_points = {eye.relief_points}: heights of {side} x {side} points cannot be converted; "
            f"must be {side}",
            "eye.relief_points",
        )
    given = next((names for names in _patches(eye) if set(names) == _with_start(genes)), None)
    if given is not None and eye.relief_points > PATCH:
        finer = refined(np.array([genes[name]["start"] for name in given]), eye.relief_points)
        exist = set(representatives(eye.relief_points, given != doe_names(PATCH)))
        starts = {name: {**genes.get(name, {}), "start": float(u)} for name, u in zip(names, finer, strict=True)}
        genes = {**genes, **{name: use for name, use in starts.items() if name in exist}}
    if eye.relief_symmetric and all("start" in genes.get(name, {}) for name in names):
        own = dict(zip(names, representatives(eye.relief_points, True), strict=True))
        images = {name for name in names if own[name] != name and _same(genes[name], genes[own[name]])}
        genes = {name: use for name, use in genes.items() if name not in images}
    return {**tree, "genome": genes} if genes else tree


def _patches(eye: EyeConfig) -> list[list[str]]:
    """Return lists of the names of the genes that determine the 4 x 4 points of a relief, one name for each point.

    The first list is for a relief without symmetry. If the eyes have symmetric reliefs, there is a second list, in
    which several points have the same gene.
    """
    return [representatives(PATCH, symmetric) for symmetric in (False, True)[: 1 + eye.relief_symmetric]]


def _spelled_out(genes: Tree) -> int:
    """Return N if exactly the relief genes of an N x N square have start values, else 0."""
    given = _with_start(genes)
    return next((side for side in range(PATCH, int(RELIEF_POINTS.high) + 1) if given == set(doe_names(side))), 0)


def _with_start(genes: Tree) -> set[str]:
    return {name for name, use in genes.items() if name.startswith("doe_") and "start" in use}


def _same(one: Tree, other: Tree) -> bool:
    """Return whether the settings of two genes are equal, apart from rounding errors of the start values."""
    rest, others = ({key: value for key, value in use.items() if key != "start"} for use in (one, other))
    return rest == others and math.isclose(one["start"], other["start"], abs_tol=1e-9)


def no_such_gene(name: str, eye: EyeConfig) -> str:
    """Return a message that explains why these eyes lack a relief gene."""
    points = eye.relief_points
    if eye.relief_symmetric and name in doe_names(points):
        own = ", ".join(_relief_genes(eye))
        return f"genome.{name}: a symmetric relief has other genes ({own}); set eye.relief_symmetric = false for all"
    return f"genome.{name}: the relief has {points} x {points} genes; set eye.relief_points for more"


def _relief_genes(eye: EyeConfig) -> list[str]:
    return [name for name in eye.genes if name.startswith("doe_")]
