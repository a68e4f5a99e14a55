"""`evolve tasks`, `evolve presets` and `evolve genes`: lists of tasks, presets and genes."""

from __future__ import annotations

import json
from argparse import Namespace

from evolve.config.run_config import TASKS, SearchConfig
from evolve.config.sources import preset_about, preset_names
from evolve.genome.genes import CLUSTERS, GENES, Gene
from evolve.runs.output import results, say, spelled

__all__ = ["genes", "presets", "tasks"]


def tasks(arguments: Namespace) -> int:
    """Print the tasks."""
    if arguments.json:
        say(json.dumps(dict(TASKS), indent=1))
        return 0
    say("\n".join(f"{name:<12}{meaning}" for name, meaning in TASKS.items()))
    return 0


def presets(arguments: Namespace) -> int:
    """Print the presets, each with its task, its scales and its purpose.

    A preset without a task can be used with any task. Scales, such as "laptop" and "paper", are alternative settings
    for shorter and longer runs; some presets have none.
    """
    found = [preset_about(name) for name in preset_names()]
    if arguments.json:
        say(json.dumps(found, indent=1))
        return 0
    for one in found:
        say(f"{one['name']:<24}{one['task'] or 'any task':<12}{', '.join(one['scales']) or '-':<16}{one['about']}")
    return 0


def genes(arguments: Namespace) -> int:
    """Print the genes with their valid range, default search range, start value and meaning."""
    ordered = [gene for cluster in CLUSTERS for gene in GENES.values() if gene.cluster == cluster]
    if arguments.json:
        say(json.dumps([_record(gene) for gene in ordered], indent=1))
        return 0
    header = ("gene", "cluster", "kind", "range", "unit", "open", "searched", "start", "mutation", "meaning")
    rows = [header, *(_row(gene) for gene in ordered)]
    rows = [tuple(spelled(cell, results()) for cell in row) for row in rows]
    widths = [max(len(row[column]) for row in rows) for column in range(len(header))]
    for row in rows:
        say("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
    say(
        f"\n{len(GENES)} genes. Open or freeze a gene or a cluster: --set genome.NAME.open=true or false\n"
        "Open a gene from generation N: --set genome.NAME.opens_at=N\n"
        "Use a relief of N x N genes: --set eye.relief_points=N\n"
        "Use only an eighth of these genes, mirrored and rotated: --set eye.relief_symmetric=true\n"
        "Use a single gene, resolution, for height and width: --set eye.square=true\n"
        "Spectral genes need --set eye.receptors=genes; otherwise all eyes have the receptors that it names.\n"
        "Mutations apply to search.optimizer=mutation; CMA starts with Gaussian steps of the same size."
    )
    return 0


def _row(gene: Gene) -> tuple[str, ...]:
    use = gene.default
    step = f", σ = {_step(gene):.3g}" if gene.kind == "real" else ""
    return (
        gene.name,
        gene.cluster,
        gene.kind,
        str(gene.range),
        gene.unit,
        "yes" if use.open else "no",
        f"[{use.low:g}, {use.high:g}]",
        f"{use.start:g}",
        f"{gene.mutation}{step}",
        gene.meaning,
    )


def _step(gene: Gene) -> float:
    return SearchConfig().sigma * (gene.default.high - gene.default.low)


def _record(gene: Gene) -> dict[str, object]:
    return {
        "name": gene.name,
        "cluster": gene.cluster,
        "kind": gene.kind,
        "range": [gene.range.low, gene.range.high],
        "unit": gene.unit,
        "open": gene.default.open,
        "searched": [gene.default.low, gene.default.high],
        "start": gene.default.start,
        "mutation": gene.mutation,
        "meaning": gene.meaning,
    }
