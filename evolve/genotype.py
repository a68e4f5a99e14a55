"""Genes: what evolution may change, and how a genome (a vector in [0, 1]^d) encodes the open ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from evolve.interval import Interval

__all__ = ["CLUSTERS", "GENES", "Gene", "GeneConfig", "Genotype", "group_members"]

Cluster = Literal["morphological", "optical", "neural"]
CLUSTERS: tuple[Cluster, ...] = ("morphological", "optical", "neural")
DOE_SHAPE = (4, 4)


@dataclass(frozen=True)
class GeneConfig:
    """How a run uses one gene: evolved over [low, high] from `start` where open, else held at `start`."""

    open: bool
    low: float
    high: float
    start: float


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
        """How CMA-ES varies it."""
        return "Gaussian" if self.kind == "real" else "Gaussian, rounded"

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


def _gene(
    name: str, cluster: Cluster, valid: Interval, search: tuple[float, float, float], unit: str, meaning: str
) -> Gene:
    """A real gene, open by default; `search` is (low, high, start)."""
    return Gene(name, cluster, "real", valid, GeneConfig(True, *map(float, search)), unit, meaning)


def _count(
    name: str, cluster: Cluster, valid: Interval, search: tuple[float, float, float], unit: str, meaning: str
) -> Gene:
    """An integer gene, open by default."""
    return Gene(name, cluster, "integer", valid, GeneConfig(True, *map(float, search)), unit, meaning)


def _table() -> dict[str, Gene]:
    body, optical, neural = CLUSTERS
    rows, columns = DOE_SHAPE
    genes = [
        _count("n_eyes", body, Interval(1, 16), (1, 16, 1), "", "eyes around the body"),
        _gene("placement_range_deg", body, Interval(0, 180), (0, 180, 90), "deg", "arc over which the eyes are spread"),
        _gene("fov_deg", body, Interval(1, 100), (1, 100, 45), "deg", "an eye's horizontal field of view"),
        _count(
            "resolution_height", body, Interval(1, 64), (1, 16, 1), "receptors", "an eye's receptors, top to bottom"
        ),
        _count("resolution_width", body, Interval(1, 64), (1, 16, 1), "receptors", "an eye's receptors, left to right"),
        # Below a hundredth (a radius of 1 µm in a 200 µm eye) the pupil is no wider than the wavelengths it admits.
        _gene("relative_aperture", optical, Interval(0.01, 1), (0.01, 1, 0.5), "", "pupil diameter / retina width"),
        *(
            _gene(
                f"doe_{i}{j}", optical, Interval(0, 1), (0, 1, 0.5), "relief height", f"relief control point ({i}, {j})"
            )
            for i in range(rows)
            for j in range(columns)
        ),
        _gene("refractive_index", optical, Interval(1, 2), (1, 2, 1.5), "", "index of the relief's material"),
        _count("memory_frames", neural, Interval(1, 32), (1, 10, 5), "frames", "past frames that the brain sees"),
        _count("neurons", neural, Interval(1, 512), (1, 512, 64), "", "neurons in each hidden layer"),
    ]
    return {gene.name: gene for gene in genes}


GENES: Mapping[str, Gene] = _table()


def group_members(name: str) -> tuple[str, ...]:
    """Genes that a cluster's name, "doe" or a gene's own name stands for; () if it is none of them."""
    if name in GENES:
        return (name,)
    if name == "doe":
        return tuple(gene for gene in GENES if gene.startswith("doe_"))
    return tuple(gene.name for gene in GENES.values() if gene.cluster == name)


@dataclass(frozen=True)
class Genotype:
    """The encoding of one run: which genes are open, in which order they stand in the genome, and over what range."""

    uses: Mapping[str, GeneConfig]

    @cached_property
    def open_genes(self) -> tuple[Gene, ...]:
        return tuple(gene for name, gene in GENES.items() if self.uses[name].open)

    @property
    def dimension(self) -> int:
        return len(self.open_genes)

    @property
    def start(self) -> NDArray[np.float64]:
        """Genome of the start phenotype, (dimension,)."""
        uses = self.uses
        return np.array([gene.encode(uses[gene.name].start, uses[gene.name]) for gene in self.open_genes])

    def decode(self, genome: NDArray[np.float64]) -> dict[str, float]:
        """Value of every gene, open or not. Total: coordinates outside [0, 1] are clipped.

        Raises:
            ValueError: `genome` has another length than `dimension`, or is not finite.
        """
        genome = np.asarray(genome, dtype=np.float64)
        if genome.shape != (self.dimension,) or not np.all(np.isfinite(genome)):
            raise ValueError(f"genome must be {self.dimension} finite numbers, got an array of shape {genome.shape}")
        values = {name: use.start for name, use in self.uses.items()}
        for gene, u in zip(self.open_genes, np.clip(genome, 0.0, 1.0), strict=True):
            values[gene.name] = gene.decode(float(u), self.uses[gene.name])
        return values
