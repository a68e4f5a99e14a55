"""`evolve tasks` and `evolve genes`: what there is."""

from __future__ import annotations

from argparse import Namespace

from evolve.config import TASKS, SearchConfig
from evolve.genotype import CLUSTERS, GENES, Gene

__all__ = ["genes", "tasks"]


def tasks(arguments: Namespace) -> int:
    """Print the tasks."""
    print("\n".join(f"{name:<12}{meaning}" for name, meaning in TASKS.items()))
    return 0


def genes(arguments: Namespace) -> int:
    """Print the genes: range, how far evolution searches and from where unless told otherwise, and what each does."""
    header = ("gene", "cluster", "kind", "range", "unit", "searched", "start", "mutation (initial)", "what it does")
    rows = [header, *(_row(GENES[name]) for cluster in CLUSTERS for name in GENES if GENES[name].cluster == cluster)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(header))]
    for row in rows:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
    print(f"\n{len(GENES)} genes. Freeze one, or a cluster: --set genome.NAME.open=false")
    return 0


def _row(gene: Gene) -> tuple[str, ...]:
    use = gene.default
    step = SearchConfig().sigma * (use.high - use.low)
    return (
        gene.name,
        gene.cluster,
        gene.kind,
        str(gene.range),
        gene.unit,
        f"[{use.low:g}, {use.high:g}]",
        f"{use.start:g}",
        f"{gene.mutation}, σ = {step:.3g}",
        gene.meaning,
    )
