"""Start of a run from an animal of another run (`--from RUN:ID`)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from evolve.analysis.statistics import gene_values
from evolve.config.eye_checks import IN_TIME, RHABDOMS
from evolve.config.provenance import Source
from evolve.genome.genes import ALL_GENES, INHERITED, SIDE, VERTICAL
from evolve.store.directory import Run

__all__ = ["starts_from"]

# Settings that determine the units and the axes of optical genes.
AXES = ("sensor_width", "receptor_pitch", "relief_height", "pupil_turned")


def starts_from(text: str) -> Source:
    """Return the genes of an animal as start values of a new run, with the settings on which these genes depend.

    Some genes are relative to settings: a relief's heights are fractions of `eye.relief_height`, for example. With
    other settings, the same genes would describe another lens. These settings are therefore returned as well.

    text: "RUN:ID", a run directory and the id of a candidate; "RUN" stands for the best candidate of the run

    Raises:
        RunError: the run or the candidate does not exist, no candidate has succeeded, or the record is damaged.
        ConfigError: the config of the run is invalid.
        OSError: config.toml cannot be read, or a file of the run is a link or FIFO.
    """
    path, candidate_id = _parsed(text)
    run = Run.open(path)
    candidate = run.candidate(candidate_id)
    values = gene_values(candidate.phenotype)
    height = run.config.eye.vertical_fov
    if height != "gene":
        values.pop(VERTICAL, None)
    values.pop(SIDE, None)  # height and width repeat its value, for eyes that are not square
    genome = {name: {"start": _exact(name, value)} for name, value in values.items() if not math.isnan(value)}
    tree: dict[str, Any] = {"genome": genome, "eye": {}}
    if candidate.phenotype.relief is not None:
        tree["eye"] |= {name: getattr(run.config.eye, name) for name in AXES}
    if candidate.phenotype.rhabdom_diameter_um is not None:
        tree["eye"] |= {name: getattr(run.config.eye, name) for name in ("rhabdoms", *RHABDOMS)}
    if candidate.phenotype.facet_diameter_um is not None:
        tree["eye"] |= {name: getattr(run.config.eye, name) for name in ("compound", "facet_area")}
    if candidate.phenotype.time_constant_ms is not None:
        tree["eye"] |= {name: getattr(run.config.eye, name) for name in ("temporal_order", *IN_TIME)}
    if height != "receptors":
        tree["eye"]["vertical_fov"] = height
    if candidate.phenotype.lambda_max_nm is not None:
        tree["eye"]["receptors"] = INHERITED
    if candidate.phenotype.relief is not None and len(candidate.phenotype.relief) != 16:
        tree["eye"]["relief_points"] = math.isqrt(len(candidate.phenotype.relief))
    if candidate.phenotype.relief is not None:
        tree["eye"]["relief_symmetric"] = run.config.eye.relief_symmetric
    return Source(f"--from {path}:{candidate.id}", tree)


def _parsed(text: str) -> tuple[Path, int | None]:
    """Return the run directory and the id of the candidate in "RUN:ID"; the id is None for "RUN".

    RUN may also contain colons.
    """
    head, colon, tail = text.rpartition(":")
    if colon and tail.isdecimal():
        return Path(head), int(tail)
    return Path(text), None


def _exact(name: str, value: float) -> float | int:
    return int(value) if ALL_GENES[name].kind == "integer" else value
