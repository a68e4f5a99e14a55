"""The genes: what evolution may change, in which units and ranges, and how a run uses each unless told otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from evolve.interval import Interval

__all__ = [
    "ALL_GENES",
    "APERTURE_SHAPES",
    "CLUSTERS",
    "GENES",
    "RELIEF_POINTS",
    "Gene",
    "GeneConfig",
    "gene_table",
    "group_members",
    "groups_of",
]

Cluster = Literal["morphological", "optical", "neural"]
CLUSTERS: tuple[Cluster, ...] = ("morphological", "optical", "neural")
RELIEF_POINTS = Interval(4, 9)  # of a relief along one side; names of its genes have a digit for each side
APERTURE_SHAPES = ("circle", "annulus", "slit", "triangle", "square", "pentagon", "hexagon")


@dataclass(frozen=True)
class GeneConfig:
    """How a run uses one gene: evolved over [low, high] from `start` where open, else held at `start`.

    opens_at  the first generation that varies it; until then it is held at its start
    """

    open: bool
    low: float
    high: float
    start: float
    opens_at: int = 0


@dataclass(frozen=True)
class Gene:
    """One gene: the values that make sense at all (`range`) and how a run uses it unless told otherwise (`default`)."""

    name: str
    cluster: Cluster
    kind: Literal["real", "integer"]
    range: Interval
    default: GeneConfig
    unit: str
    meaning: str

    @property
    def mutation(self) -> str:
        """How the optimizer "mutation" varies it; any other draws from the distribution it has learnt."""
        return "Gaussian" if self.kind == "real" else "±1"

    def decode(self, u: float, use: GeneConfig) -> float:
        """Gene's value at u in [0, 1]. Integers share [0, 1] in equal parts, so the ends are as likely as the rest."""
        if self.kind == "real":
            return use.low + u * (use.high - use.low)
        return min(use.low + float(np.floor(u * (use.high - use.low + 1))), use.high)

    def encode(self, value: float, use: GeneConfig) -> float:
        """Inverse of `decode`: for integers the middle of the value's part of [0, 1]."""
        if self.kind == "real":
            return (value - use.low) / (use.high - use.low)
        return (value - use.low + 0.5) / (use.high - use.low + 1)

    def mutated(self, u: float, sigma: float, normal: float, step: int, use: GeneConfig) -> float:
        """u after one mutation: a real gene by `normal` σ's, reflected at the ends; an integer by `step`, kept in."""
        if self.kind == "integer":
            value = self.decode(u, use) + step
            return self.encode(min(max(value, use.low), use.high), use)
        moved = (u + sigma * normal) % 2.0
        return min(moved, 2.0 - moved)


@lru_cache
def gene_table(relief_points: int = 4) -> Mapping[str, Gene]:
    """Every gene by name, in the order in which they stand in a genome; the relief has relief_points² of them."""
    genes = [*_body(), *_optics(relief_points), *_brain()]
    return {gene.name: gene for gene in genes}


def _body() -> list[Gene]:
    return [
        _count("n_eyes", (1, 16), (1, 16, 1), "", "eyes around the body"),
        _real("placement_range_deg", (0, 180), (0, 180, 90), "deg", "arc over which the eyes are spread"),
        _real("fov_deg", (1, 100), (1, 100, 45), "deg", "an eye's horizontal field of view"),
        _count("resolution_height", (1, 64), (1, 16, 1), "receptors", "an eye's receptors, top to bottom"),
        _count("resolution_width", (1, 64), (1, 16, 1), "receptors", "an eye's receptors, left to right"),
    ]


def _optics(relief_points: int) -> list[Gene]:
    points = [(i, j) for i in range(relief_points) for j in range(relief_points)]
    shapes = ", ".join(f"{number} {name}" for number, name in enumerate(APERTURE_SHAPES))
    return [
        # Below a hundredth (a radius of 1 µm in a 200 µm eye) the pupil is no wider than the wavelengths it admits.
        _real("relative_aperture", (0.01, 1), (0.01, 1, 0.5), "", "pupil diameter / retina width", "optical"),
        *(
            _real(f"doe_{i}{j}", (0, 1), (0, 1, 0.5), "relief height", f"relief control point ({i}, {j})", "optical")
            for i, j in points
        ),
        _real("refractive_index", (1, 2), (1, 2, 1.5), "", "index of the relief's material, at 588 nm", "optical"),
        # Glasses reach from 1/90 to 1/20; 0 is a material that does not disperse.
        _real(
            "dispersion",
            (0, 0.1),
            (0, 0.05, 0),
            "1 / Abbe number",
            "fall of the index with wavelength",
            "optical",
            False,
        ),
        _count(
            "aperture_shape",
            (0, len(APERTURE_SHAPES) - 1),
            (0, len(APERTURE_SHAPES) - 1, 0),
            "",
            f"pupil: {shapes}",
            "optical",
            False,
        ),
    ]


def _brain() -> list[Gene]:
    return [
        _count("memory_frames", (1, 32), (1, 10, 5), "frames", "past frames that the brain sees", "neural"),
        _count("neurons", (1, 512), (1, 512, 64), "", "neurons in each hidden layer", "neural"),
        _count("layers", (1, 4), (1, 4, 2), "", "hidden layers of actor and critic", "neural", False),
    ]


def _real(
    name: str,
    valid: tuple[float, float],
    search: tuple[float, float, float],
    unit: str,
    meaning: str,
    cluster: Cluster = "morphological",
    opened: bool = True,
) -> Gene:
    """A real gene; `search` is (low, high, start)."""
    return Gene(name, cluster, "real", Interval(*valid), _use(opened, search), unit, meaning)


def _count(
    name: str,
    valid: tuple[float, float],
    search: tuple[float, float, float],
    unit: str,
    meaning: str,
    cluster: Cluster = "morphological",
    opened: bool = True,
) -> Gene:
    """An integer gene."""
    return Gene(name, cluster, "integer", Interval(*valid), _use(opened, search), unit, meaning)


def _use(opened: bool, search: tuple[float, float, float]) -> GeneConfig:
    low, high, start = map(float, search)
    return GeneConfig(opened, low, high, start)


GENES: Mapping[str, Gene] = gene_table()
ALL_GENES: Mapping[str, Gene] = gene_table(int(RELIEF_POINTS.high))


def group_members(name: str) -> tuple[str, ...]:
    """Genes that a cluster's name, "doe" or a gene's own name stands for; () if it is none of them."""
    if name in ALL_GENES:
        return (name,)
    if name == "doe":
        return tuple(gene for gene in ALL_GENES if gene.startswith("doe_"))
    return tuple(gene.name for gene in ALL_GENES.values() if gene.cluster == name)


def groups_of(name: str) -> tuple[str, ...]:
    """Groups that a gene belongs to, the narrowest first; () for what is no gene."""
    if name not in ALL_GENES:
        return ()
    return (*(("doe",) if name.startswith("doe_") else ()), ALL_GENES[name].cluster)
