"""Space constraints of compound eyes: their facets share the surface of the head.

A facet of the width D is a hexagon with the area (√3/2) D². The facets of all eyes together have at most the area
`eye.facet_area`. Facets touch each other, so the local radius of an eye's surface is R = D/Δφ, where Δφ is the
interommatidial angle. In an acute zone, Δφ is smaller, and the surface is flatter. `sim.eyes.hexagonal_rows` places
ommatidia in Mercator's projection. Eyes are at most 180 degrees high in this projection, because the ommatidia of
higher eyes would crowd near the poles.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from evolve.genome.eye_config import EyeConfig
from evolve.genome.genes import RHABDOM, SIDES, GeneConfig, highest, lowest

__all__ = ["contradiction", "fitted"]

Values = dict[str, float]
Uses = Mapping[str, GeneConfig]
DIAMETER = "facet_diameter_um"
COUNTS = ("n_eyes", *SIDES)  # genes whose product is the number of facets
HEXAGON = math.sqrt(3) / 2  # area of a hexagon / its squared width, and distance of rows / distance of columns
HIGHEST_DEG = 180.0  # maximum height of an eye in Mercator's projection
SLACK = 1 + 1e-9  # tolerance for rounding errors


def fitted(values: Values, uses: Uses, sizes: EyeConfig) -> Values:
    """Return the gene values after a repair of eyes that are over 180° high, or whose facets do not fit on the head.

    The repair reduces four quantities: the numbers of eyes, of rows and of columns, and the width of the facets. Among
    all values of the four that fit and lie within the searched ranges, it chooses the nearest to the former values. The
    distance is the sum of the squared logarithms of the four ratios of new to former value, so that no quantity is
    reduced in preference to the others. Rhabdoms become at most as wide as a facet. The height of an eye is measured in
    Mercator's projection.

    values: value of each gene, by name
    uses: searched range of each gene, by name
    """
    counts = [np.arange(lowest(name, uses), values[name] + 1) for name in COUNTS]
    eyes, rows, columns = np.meshgrid(*counts, indexing="ij")
    widest = 1e6 * np.sqrt(sizes.facet_area / (HEXAGON * eyes * rows * columns))
    widths = np.minimum(values[DIAMETER], widest)
    fits = (widths * SLACK >= lowest(DIAMETER, uses)) & (_height(rows, columns, values["fov_deg"]) <= HIGHEST_DEG)
    reduced = zip((eyes, rows, columns, widths), (*COUNTS, DIAMETER), strict=True)
    distances = sum(np.log(values[name] / found) ** 2 for found, name in reduced)
    best = np.unravel_index(int(np.argmin(np.where(fits, distances, np.inf))), fits.shape)
    numbers = {name: float(found[best]) for name, found in zip(COUNTS, (eyes, rows, columns), strict=True)}
    width = float(widths[best])
    return {**values, **numbers, DIAMETER: width, RHABDOM: min(values[RHABDOM], width)}


def contradiction(uses: Uses, sizes: EyeConfig) -> tuple[str, tuple[str, ...]] | None:
    """Return None if the repair by `fitted` is possible for every genome.

    After the repair, eyes are at most 180° high in Mercator's projection, and their facets fit on the head. If the
    repair can fail, return an error message and the names of the settings that contradict each other.
    """
    eyes, rows, columns = (lowest(name, uses) for name in COUNTS)
    width, area = lowest(DIAMETER, uses), sizes.facet_area
    keys = tuple(f"genome.{name}.low" for name in COUNTS)
    if HEXAGON * eyes * rows * columns * (1e-6 * width) ** 2 > area * SLACK:
        return (
            f"{eyes:g} eyes of {rows:g} x {columns:g} facets, at least {width:g} µm wide, do not fit on {area:g} m² "
            "(eye.facet_area)",
            ("eye.facet_area", f"genome.{DIAMETER}.low", *keys),
        )
    field = highest("fov_deg", uses)
    if _height(rows, columns, field) > HIGHEST_DEG:
        return (
            f"{rows:g} rows of {columns:g} ommatidia are too high for a field of view of {field:g}°: must be below "
            f"{HIGHEST_DEG:g}° high",
            ("genome.fov_deg.high", *keys),
        )
    return None


def _height(rows: float | np.ndarray, columns: float | np.ndarray, fov_deg: float) -> float | np.ndarray:
    """Return the height [degrees] of an eye's field of view, measured in Mercator's projection."""
    return rows * HEXAGON * fov_deg / columns
