"""The genes: quantities that evolution can change, with their units, valid ranges and default settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import product
from typing import Literal

import numpy as np

from evolve.genome.interval import Interval
from evolve.genome.relief_genes import representatives

__all__ = [
    "ALL_GENES",
    "APERTURE_SHAPES",
    "CLUSTERS",
    "FACETS",
    "FAMILIES",
    "GENES",
    "INHERITED",
    "LAMBDA_MAX",
    "OPTIONAL",
    "RELIEF_POINTS",
    "RHABDOM",
    "SIDE",
    "SIDES",
    "TILT",
    "TIME_CONSTANT",
    "VERTICAL",
    "Gene",
    "GeneConfig",
    "gene_table",
    "group_members",
    "groups_of",
    "highest",
    "lowest",
]

Cluster = Literal["morphological", "optical", "neural", "spectral"]
CLUSTERS: tuple[Cluster, ...] = ("morphological", "optical", "neural", "spectral")
FAMILIES = ("doe", "lambda_max")  # beginnings of names of similar genes: heights of the relief, peaks of pigments
# Number of points along one side of a relief. The names of its genes have one digit for the row and one for the column.
RELIEF_POINTS = Interval(4, 9)
SIDE = "resolution"  # gene of square eyes, which replaces the two genes SIDES
SIDES = ("resolution_height", "resolution_width")
RHABDOM = "rhabdom_diameter_um"  # gene of eyes whose receptors are rhabdoms
VERTICAL = "vertical_fov_deg"  # gene of eyes whose height evolves
TIME_CONSTANT = "time_constant_ms"  # gene of eyes whose receptors integrate over time
FACETS = ("acute_zone", "facet_diameter_um", "f_number", "rhabdom_length_um")  # genes of compound eyes
OPTIONAL = (RHABDOM, VERTICAL, TIME_CONSTANT, *FACETS)  # genes that exist only with certain settings of eyes
OF_PUPILS = ("relative_aperture", "refractive_index", "dispersion", "aperture_shape")  # genes of pupils, and "doe_*"
TILT = "elevation_deg"  # gene that exists only in user tasks; in built-in tasks eyes look along the floor
REAL: Literal["real"] = "real"
INTEGER: Literal["integer"] = "integer"
APERTURE_SHAPES = ("circle", "annulus", "slit", "triangle", "square", "pentagon", "hexagon")
# Start values of the receptor types' peaks [nm]: red, green and blue as in "rgb", then one in the ultraviolet.
LAMBDA_MAX: Mapping[str, float] = {f"lambda_max_{i}_nm": peak for i, peak in enumerate((600, 520, 460, 360))}


@dataclass(frozen=True)
class GeneConfig:
    """Settings of one gene in a run. Values are in the unit of the gene, and `RunConfig` checks them.

    The search varies an open gene within [low, high], beginning at `start`; `low` must be below `high`. A frozen gene
    (`open` is False) has the value `start`.

    opens_at: first generation in which the search varies the gene; before it, the gene has the value `start`
    """

    open: bool
    low: float
    high: float
    start: float
    opens_at: int = 0


def lowest(name: str, uses: Mapping[str, GeneConfig]) -> float:
    """Return the lowest value that a gene can have in a run. `uses` contains the settings of all genes, by name."""
    return uses[name].low if uses[name].open else uses[name].start


def highest(name: str, uses: Mapping[str, GeneConfig]) -> float:
    """Return the highest value that a gene can have in a run. `uses` contains the settings of all genes, by name."""
    return uses[name].high if uses[name].open else uses[name].start


@dataclass(frozen=True)
class Gene:
    """One gene, a quantity that evolution can change.

    name: name of the gene in settings, tables and records
    cluster: "morphological", "optical", "neural" or "spectral"
    kind: "real" or "integer"
    range: valid values, the same in all runs
    default: settings (search range, start value, ...) of the gene if the configuration of a run does not mention it
    unit: unit of the values; "" for a number without a unit
    meaning: description for tables and messages
    """

    name: str
    cluster: Cluster
    kind: Literal["real", "integer"]
    range: Interval
    default: GeneConfig
    unit: str
    meaning: str

    @property
    def mutation(self) -> str:
        """Kind of mutation that the optimizer "mutation" applies: "Gaussian" for real genes, "±1" for integer genes."""
        return "Gaussian" if self.kind == "real" else "±1"

    def decode(self, u: float, use: GeneConfig) -> float:
        """Return the gene's value at a coordinate. An integer gene divides [0, 1] into equal intervals, one per value.

        u: coordinate in [0, 1], which is not checked
        use: settings of the gene in a run; the coordinates 0 and 1 correspond to `use.low` and `use.high`
        """
        if self.kind == "real":
            return use.low + u * (use.high - use.low)
        return min(use.low + float(np.floor(u * (use.high - use.low + 1))), use.high)

    def encode(self, value: float, use: GeneConfig) -> float:
        """Return a coordinate that `decode` maps to the value; for integer genes, the middle of these coordinates.

        use: settings of the gene in a run; real values from `use.low` to `use.high` have coordinates from 0 to 1

        Raises:
            ZeroDivisionError: the gene is real, and `use.low` equals `use.high`.
        """
        if self.kind == "real":
            return (value - use.low) / (use.high - use.low)
        return (value - use.low + 0.5) / (use.high - use.low + 1)

    def mutated(self, u: float, sigma: float, normal: float, step: int, use: GeneConfig) -> float:
        """Return the coordinate u after one mutation.

        The coordinate of a real gene changes by `normal` times `sigma` and is reflected at 0 and 1. The value of an
        integer gene changes by `step` and is clipped to [use.low, use.high].

        sigma: step size, as a fraction of the searched range
        normal: random number from a standard normal distribution
        step: change of the value of an integer gene, a whole number such as 1 or -1
        use: settings of the gene in a run
        """
        if self.kind == "integer":
            value = self.decode(u, use) + step
            return self.encode(min(max(value, use.low), use.high), use)
        moved = (u + sigma * normal) % 2.0
        return min(moved, 2.0 - moved)


@lru_cache
def gene_table(
    relief_points: int = 4,
    relief_symmetric: bool = False,
    square: bool = False,
    optional: frozenset[str] = frozenset(),
    pupils: bool = True,
) -> Mapping[str, Gene]:
    """Return, by name and in genome order, the genes of animals whose eyes have the properties described below.

    relief_points: number of points of the relief along one side; without symmetry, there are relief_points² genes
    relief_symmetric: True if the relief is symmetric, so that the genes of an eighth of its area determine all of it
    square: True if eyes are square and have one gene for both sides
    optional: names of those optional genes (`OPTIONAL`) that the animals have
    pupils: True if eyes have a pupil with a relief, and not facets
    """
    relief = set(representatives(relief_points, relief_symmetric)) if pupils else set()
    absent = {*(SIDES if square else (SIDE,)), *(() if pupils else OF_PUPILS), *OPTIONAL} - optional
    return {
        name: gene
        for name, gene in _all_genes(relief_points).items()
        if name not in absent and (name in relief or not name.startswith("doe_"))
    }


def _all_genes(relief_points: int) -> dict[str, Gene]:
    genes = (*_body(), *_optics(relief_points), *_brain(), *_spectra())
    return {gene.name: gene for gene in genes}


def _body() -> list[Gene]:
    gene = partial(_gene, "morphological")
    return [
        gene("n_eyes", INTEGER, (1, 32), (1, 16, 1), "", "number of eyes around the body"),
        gene("placement_range_deg", REAL, (0, 180), (0, 180, 90), "deg", "arc over which the eyes are spread"),
        _frozen(gene(TILT, REAL, (-90, 90), (-60, 60, 0), "deg", "elevation of the eyes; only in user tasks")),
        gene("fov_deg", REAL, (1, 100), (1, 100, 45), "deg", "an eye's horizontal field of view"),
        gene(VERTICAL, REAL, (1, 170), (1, 100, 45), "deg", "an eye's vertical field of view"),
        gene("resolution_height", INTEGER, (1, 64), (1, 16, 1), "receptors", "an eye's receptors, top to bottom"),
        gene("resolution_width", INTEGER, (1, 64), (1, 16, 1), "receptors", "an eye's receptors, left to right"),
        gene(SIDE, INTEGER, (1, 64), (1, 16, 1), "receptors", "a square eye's receptors, along either side"),
        gene("acute_zone", REAL, (1, 5), (1, 3, 1), "", "density of ommatidia in the middle of an eye / mean density"),
    ]


def _optics(relief_points: int) -> list[Gene]:
    gene = partial(_gene, "optical")
    places = list(product(range(relief_points), repeat=2))
    shapes = ", ".join(f"{number} {name}" for number, name in enumerate(APERTURE_SHAPES))
    last = len(APERTURE_SHAPES) - 1
    return [
        # A pupil below 0.01 (a radius of 1 µm in an eye 200 µm wide) would be about as narrow as a wavelength.
        gene("relative_aperture", REAL, (0.01, 1), (0.01, 1, 0.5), "", "pupil diameter / retina width"),
        *(
            gene(f"doe_{i}{j}", REAL, (0, 1), (0, 1, 0.5), "relief height", f"relief control point ({i}, {j})")
            for i, j in places
        ),
        gene("refractive_index", REAL, (1, 2), (1, 2, 1.5), "", "index of the relief's material, at 588 nm"),
        # Glasses have values from 1/90 to 1/20. The value 0 means no dispersion.
        _frozen(
            gene("dispersion", REAL, (0, 0.1), (0, 0.05, 0), "1 / Abbe number", "fall of the index with wavelength")
        ),
        _frozen(gene("aperture_shape", INTEGER, (0, last), (0, last, 0), "", f"pupil: {shapes}")),
        # Rhabdoms thinner than 0.8 µm guide almost no red light, and those wider than 10 µm have a hundred modes.
        _frozen(gene(RHABDOM, REAL, (0.8, 10), (1, 6, 2), "µm", "diameter of rhabdoms, at most a receptor's width")),
        # Facets of small wasps are 5 µm wide, and those of dragonflies 80 µm.
        gene("facet_diameter_um", REAL, (4, 100), (8, 40, 20), "µm", "width of a facet; all facets fit on the head"),
        gene("f_number", REAL, (1, 10), (1.5, 4, 2), "", "focal length of a facet in air / its width"),
        gene("rhabdom_length_um", REAL, (10, 1000), (50, 400, 200), "µm", "length of a compound eye's rhabdoms"),
    ]


def _brain() -> list[Gene]:
    gene = partial(_gene, "neural")
    return [
        # Photoreceptors of fast flies in bright light have 3 ms, and those of toads in the dark have seconds.
        _frozen(gene(TIME_CONSTANT, REAL, (0.1, 10_000), (1, 500, 20), "ms", "time constant of the receptors' filter")),
        gene("memory_frames", INTEGER, (1, 32), (1, 10, 5), "frames", "frames that the brain sees"),
        gene("neurons", INTEGER, (1, 512), (1, 512, 64), "", "neurons in each hidden layer"),
        _frozen(gene("layers", INTEGER, (1, 4), (1, 4, 2), "", "hidden layers of actor and critic")),
    ]


def _spectra() -> list[Gene]:
    """Return the genes for the number of receptor types and for the wavelength at which each type absorbs most.

    The template of pigment spectra in `optics` was measured for peaks from 357 to 620 nm, and accepts peaks from 330 to
    700 nm.
    """
    gene, most = partial(_gene, "spectral"), len(LAMBDA_MAX)
    return [
        _frozen(gene("receptor_types", INTEGER, (1, most), (1, most, 3), "", "types of receptor, one channel each")),
        *(
            _frozen(gene(name, REAL, (330, 700), (330, 650, start), "nm", f"peak of receptor type {i}'s pigment"))
            for i, (name, start) in enumerate(LAMBDA_MAX.items())
        ),
    ]


def _gene(
    cluster: Cluster,
    name: str,
    kind: Literal["real", "integer"],
    valid: tuple[float, float],
    search: tuple[float, float, float],
    unit: str,
    meaning: str,
) -> Gene:
    """Return a gene that is open by default: the search varies it, unless the settings of a run freeze it.

    valid: (low, high) of the valid values
    search: (low, high, start), the default search range and start value
    """
    low, high, start = map(float, search)
    return Gene(name, cluster, kind, Interval(*valid), GeneConfig(True, low, high, start), unit, meaning)


def _frozen(gene: Gene) -> Gene:
    """Return the gene with another default: the search varies it only if the settings of a run say so."""
    return replace(gene, default=replace(gene.default, open=False))


GENES: Mapping[str, Gene] = gene_table()
ALL_GENES: Mapping[str, Gene] = _all_genes(int(RELIEF_POINTS.high))  # genes of all kinds of eyes together


@lru_cache(maxsize=1024)
def group_members(name: str) -> tuple[str, ...]:
    """Return the names of the genes in a group, which is a cluster, such as "optical", or a family, such as "doe".

    The families are "doe" and "lambda_max". The result is (name,) for the name of a gene, and () for an unknown name.
    """
    return tuple(gene for gene in ALL_GENES if name in (gene, *groups_of(gene)))


@lru_cache(maxsize=1024)
def groups_of(name: str) -> tuple[str, ...]:
    """Return a gene's family, "doe" or "lambda_max", if it has one, and its cluster; () if the name is unknown."""
    if name not in ALL_GENES:
        return ()
    families = tuple(family for family in FAMILIES if name.startswith(f"{family}_"))
    return (*families, ALL_GENES[name].cluster)


INHERITED = "genes"  # value of the setting `eye.receptors` if each animal's spectral genes determine its receptors
