"""Genomes: vectors with one number in [0, 1] for the value of each gene that the search varies (open gene)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from evolve.genome.genes import ALL_GENES, CLUSTERS, GENES, Gene, GeneConfig, group_members
from optics.numerics.number_types import full_precision

__all__ = ["CLUSTERS", "GENES", "Gene", "GeneConfig", "Genotype", "group_members"]


@dataclass(frozen=True)
class Genotype:
    """Encoding of gene values in one run: the genes that the search varies (open genes), their order and ranges.

    The search may begin to vary an open gene in a later generation (`opens_at`). Genomes of the generations before it
    also have a number for this gene, which encodes its start value.

    uses: settings of each gene of the animals, by name: open or frozen, search range, start value
    """

    uses: Mapping[str, GeneConfig]

    @cached_property
    def open_genes(self) -> tuple[Gene, ...]:
        """Genes that the search varies in this run (open genes), in the order of their coordinates in a genome."""
        return tuple(gene for name, gene in ALL_GENES.items() if name in self.uses and self.uses[name].open)

    @property
    def dimension(self) -> int:
        """Length of a genome: the number of genes that the search varies in this run (open genes)."""
        return len(self.open_genes)

    @property
    def start(self) -> NDArray[np.float64]:
        """Genome in which each gene that the search varies has its start value, (gene,)."""
        uses = self.uses
        return np.array([gene.encode(uses[gene.name].start, uses[gene.name]) for gene in self.open_genes])

    @cached_property
    def phases(self) -> tuple[int, ...]:
        """Generations in which the search begins to vary at least one gene, in ascending order."""
        return tuple(sorted({self.uses[gene.name].opens_at for gene in self.open_genes}))

    def varied(self, generation: int) -> NDArray[np.intp]:
        """Return the genome indices of the genes that the search varies in a generation, (k,), in ascending order."""
        return np.array([i for i, g in enumerate(self.open_genes) if self.uses[g.name].opens_at <= generation], np.intp)

    def decode(self, genome: NDArray[np.float64]) -> dict[str, float]:
        """Return the values of all genes by name, both open and frozen.

        genome: coordinates of the open genes, (dimension,); coordinates outside [0, 1] are clipped

        Raises:
            ValueError: the length of `genome` is not `dimension`, or the coordinates are not finite numbers, or are in
                half precision.
        """
        genome = np.asarray(full_precision("genome", genome), dtype=np.float64)
        if genome.shape != (self.dimension,) or not np.all(np.isfinite(genome)):
            raise ValueError(f"genome has shape {genome.shape}: must be {self.dimension} finite numbers")
        values = {name: use.start for name, use in self.uses.items()}
        for gene, u in zip(self.open_genes, np.clip(genome, 0.0, 1.0), strict=True):
            values[gene.name] = gene.decode(float(u), self.uses[gene.name])
        return values

    def count(self, steps: int) -> float:
        """Return the number of genotypes if each real gene that the search varies has `steps` distinct values.

        For an integer gene that the search varies, all whole numbers in its search range count. All other genes are
        fixed.
        """
        sizes = [
            self.uses[g.name].high - self.uses[g.name].low + 1 if g.kind == "integer" else steps
            for g in self.open_genes
        ]
        return float(np.prod(np.array(sizes, dtype=np.float64)))
