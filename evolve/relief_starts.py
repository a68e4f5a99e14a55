"""Where the genes of a relief start: what was spelled out for one number of them, for the eyes that a run has."""

from __future__ import annotations

from typing import Any

import numpy as np

from evolve.config import EyeConfig
from evolve.relief import doe_names, doe_own_names, refined

__all__ = ["no_such_gene", "with_relief"]

Tree = dict[str, Any]


def with_relief(tree: Tree, eye: EyeConfig) -> Tree:
    """`tree`, whose starts for a relief of 4 x 4 genes, if it spells them out, become the same surface's for more, and
    if they say one thing eightfold, an eighth of them where reliefs are symmetric."""
    genes, points = tree.get("genome", {}), eye.relief_points
    names, own = doe_names(points), doe_own_names(points, eye.relief_symmetric)
    given = [genes[name]["start"] for name in doe_names(4) if "start" in genes.get(name, {})]
    if points > 4 and len(given) == 16 and "start" not in genes.get("doe_44", {}):
        finer = refined(np.array(given), points)
        starts = {name: {**genes.get(name, {}), "start": float(u)} for name, u in zip(names, finer, strict=True)}
        genes = {**genes, **starts}
    if all("start" in genes.get(name, {}) for name in names):
        heights, wanted = ([genes[name]["start"] for name in which] for which in (names, own))
        if np.allclose(heights, wanted, rtol=0, atol=1e-9):
            genes = {name: use for name, use in genes.items() if name not in names or name in own}
    return {**tree, "genome": genes} if genes else tree


def no_such_gene(name: str, eye: EyeConfig) -> str:
    """Why these eyes have no such relief gene."""
    points = eye.relief_points
    if eye.relief_symmetric and name in doe_names(points):
        return f"genome.{name}: a symmetric relief has other genes ({', '.join(_relief_genes(eye))})"
    return f"genome.{name}: the relief has {points} x {points} genes; set eye.relief_points for more"


def _relief_genes(eye: EyeConfig) -> list[str]:
    return [name for name in eye.genes if name.startswith("doe_")]
