"""Adaptation of the start values of relief genes to eyes whose reliefs have more points or are symmetric."""

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
    """Return the settings `tree`, with the start values of relief genes adapted to the reliefs of these eyes.

    A relief is defined by its heights at a square grid of points. A gene determines the height of one point or, in a
    symmetric relief, of several points.

    If `tree` contains the start values of a relief of 4 x 4 points, and the reliefs of the eyes have more points, the
    values are replaced by those of the same surface with more points. If reliefs are symmetric, settings that follow
    from others by symmetry are removed.

    Raises:
        ConfigError: `tree` contains start values for a relief of more than 4 x 4 points, and the reliefs of the eyes
            have even more points.
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
    """Return, for each point of a relief of 4 x 4 points, the name of the gene that determines the height there.

    The first list in the result is for a relief without symmetry. If the eyes have symmetric reliefs, there is a second
    list, in which several points have the same gene.
    """
    return [representatives(PATCH, symmetric) for symmetric in (False, True)[: 1 + eye.relief_symmetric]]


def _spelled_out(genes: Tree) -> int:
    """Return the number of points along each side of the relief for which `genes` contains all start values.

    The result is 0 if the genes with start values are not exactly the genes of one relief without symmetry.
    """
    given = _with_start(genes)
    return next((side for side in range(PATCH, int(RELIEF_POINTS.high) + 1) if given == set(doe_names(side))), 0)


def _with_start(genes: Tree) -> set[str]:
    return {name for name, use in genes.items() if name.startswith("doe_") and "start" in use}


def _same(one: Tree, other: Tree) -> bool:
    """Return whether two genes have equal settings, apart from rounding errors of their start values.

    one, other: settings of each gene by name, such as "open" and "start"
    """
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
