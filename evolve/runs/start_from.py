"""Starting from an animal of another run: `--from RUN:ID`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from evolve.analysis.statistics import gene_values
from evolve.config.provenance import Source
from evolve.config.run_config import RHABDOMS
from evolve.genome.genes import ALL_GENES, INHERITED, SIDE
from evolve.store.directory import Run

__all__ = ["starts_from"]

LENGTHS = ("sensor_width", "receptor_pitch", "relief_height")  # settings that genes of optics are multiplied with


def starts_from(text: str) -> Source:
    """Every gene's start as the animal RUN:ID has it (RUN alone: the run's best); RUN is a run directory. Where it sees
    through optics, also the lengths that its genes are measured in, or the same genes would be another lens.

    Raises:
        RunError: no such run, no such candidate, or none that succeeded.
    """
    path, candidate_id = _parsed(text)
    run = Run.open(path)
    candidate = run.candidate(candidate_id)
    values = gene_values(candidate.phenotype)
    values.pop(SIDE, None)  # height and width say the same, and do so in runs whose eyes are not square
    genome = {name: {"start": _exact(name, value)} for name, value in values.items() if not math.isnan(value)}
    tree: dict[str, Any] = {"genome": genome, "eye": {}}
    if candidate.phenotype.relief is not None:
        tree["eye"] |= {name: getattr(run.config.eye, name) for name in LENGTHS}
    if candidate.phenotype.rhabdom_diameter_um is not None:
        tree["eye"] |= {name: getattr(run.config.eye, name) for name in ("rhabdoms", *RHABDOMS)}
    if candidate.phenotype.lambda_max_nm is not None:
        tree["eye"]["receptors"] = INHERITED
    if candidate.phenotype.relief is not None and len(candidate.phenotype.relief) != 16:
        tree["eye"]["relief_points"] = math.isqrt(len(candidate.phenotype.relief))
    if candidate.phenotype.relief is not None:
        tree["eye"]["relief_symmetric"] = run.config.eye.relief_symmetric
    return Source(f"--from {path}:{candidate.id}", tree)


def _parsed(text: str) -> tuple[Path, int | None]:
    """Run directory and candidate; a path may hold colons of its own."""
    head, colon, tail = text.rpartition(":")
    if colon and tail.isdecimal():
        return Path(head), int(tail)
    return Path(text), None


def _exact(name: str, value: float) -> float | int:
    return int(value) if ALL_GENES[name].kind == "integer" else value
