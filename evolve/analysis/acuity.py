"""Acuity of an animal: the finest gratings that the spacing of its eyes and receptors resolves."""

from __future__ import annotations

from evolve.genome.phenotype import Phenotype
from sim.eyes.hexagonal_rows import ROW_DISTANCE

__all__ = ["acuity_cpd", "acuity_vertical_cpd"]


def acuity_cpd(phenotype: Phenotype) -> float:
    """Return the horizontal acuity: the frequency of the finest vertical grating that is resolved [cycles/degree].

    It is 1 / (2 min(a, b)), after Tiwary, Young et al. (2025). The angle between neighbouring eyes is
    a = `placement_range_deg` / (`n_eyes` - 1), and that between neighbouring columns of receptors is b = `fov_deg` /
    columns. With a single eye, or if all eyes look in the same direction, only b counts, because no angle separates the
    eyes.
    """
    between_receptors = phenotype.fov_deg / phenotype.resolution[1]
    if phenotype.n_eyes == 1 or phenotype.placement_range_deg == 0:
        return 1 / (2 * between_receptors)
    between_eyes = phenotype.placement_range_deg / (phenotype.n_eyes - 1)
    return 1 / (2 * min(between_eyes, between_receptors))


def acuity_vertical_cpd(phenotype: Phenotype) -> float:
    """Return the vertical acuity: the frequency of the finest horizontal grating that is resolved [cycles/degree].

    It is 1 / (2 Δ), where Δ is the angle between neighbouring rows of receptors: vertical fov / rows. If receptors are
    square, rows are as far apart as columns, fov/columns. Rows of ommatidia are √3/2 times as far apart as columns.
    Eyes are placed side by side, so the number of eyes has no effect on the vertical acuity.
    """
    rows, columns = phenotype.resolution
    if phenotype.facet_diameter_um is not None:
        return columns / (2 * ROW_DISTANCE * phenotype.fov_deg)
    if phenotype.vertical_fov_deg is None:
        return columns / (2 * phenotype.fov_deg)
    return rows / (2 * phenotype.vertical_fov_deg)
