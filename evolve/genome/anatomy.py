"""Space constraints of eyes and receptors, and repair of gene values for which eyes or receptors would overlap.

Camera eyes sit on the equator of a head of radius `eye.head_radius`, and an eye is as wide as its retina. The angle
between neighbouring eyes is placement range / (eyes - 1). All retinas are `eye.sensor_width` wide and filled with
receptors, which are at least `eye.receptor_width` wide. If `eye.receptor_pitch` is above 0, the width of a retina is
instead the number of receptors along its width times this pitch. The height of an eye is not limited by the head, but
receptors are also at least `eye.receptor_width` high. The repair changes genes as little as possible. Costs
(`evolve.config.costs`) are computed for the repaired animal. For compound eyes, see `evolve.genome.head_surface`.

The argument `sizes` of all functions contains the settings shared by all eyes of a run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from evolve.genome import head_surface
from evolve.genome.eye_config import EyeConfig
from evolve.genome.genes import ALL_GENES, RHABDOM, SIDE, SIDES, VERTICAL, GeneConfig, highest, lowest

__all__ = ["contradiction", "fitted", "receptor_side", "retina_width", "sides", "vertical_fov"]

Values = dict[str, float]
Uses = Mapping[str, GeneConfig]
Pair = tuple[float, float]
Contradiction = tuple[str, tuple[str, ...]]
SLACK = 1e-9  # tolerance for rounding errors: eyes in contact must not count as overlapping


def retina_width(receptors: float, sizes: EyeConfig) -> float:
    """Return the width [m] of a retina with this number of receptors along its width. The eye has the same width.

    sizes: settings shared by all eyes of a run
    """
    return receptors * sizes.receptor_pitch if sizes.receptor_pitch > 0 else sizes.sensor_width


def vertical_fov(values: Values, sizes: EyeConfig) -> float | None:
    """Return an eye's vertical field of view [deg]; None for square receptors.

    values: value of each gene, by name
    """
    gene = {"receptors": None, "horizontal": "fov_deg", "gene": VERTICAL}[sizes.vertical_fov]
    return None if gene is None else values[gene]


def receptor_side(resolution: tuple[float, float], fov_deg: float, vertical: float | None, sizes: EyeConfig) -> float:
    """Return the shorter side of a receptor [m].

    resolution: numbers of receptors along the height and along the width of the eye
    fov_deg: horizontal field of view [deg]
    vertical: vertical field of view [deg]; None for square receptors
    """
    rows, columns = resolution
    width = retina_width(columns, sizes)
    if vertical is None:
        return width / columns
    return min(width / columns, width * _tangent(vertical) / _tangent(fov_deg) / rows)


def sides(values: Values) -> tuple[int, int]:
    """Return the numbers of receptors along the height and along the width of an eye.

    values: value of each gene of the animal, by name
    """
    height, width = (SIDE, SIDE) if SIDE in values else SIDES
    return int(values[height]), int(values[width])


def fitted(values: Values, uses: Uses, sizes: EyeConfig) -> Values:
    """Return the gene values after the repair of overlaps.

    If receptors are too narrow, their number along the width is reduced. `_with_high_receptors` repairs receptors that
    are not high enough. If eyes overlap, they are spread over a larger part of the head. If they overlap even on the
    largest part of the head that the search allows, the number of eyes is reduced. If the width of an eye depends on
    the number of its receptors, this number is then reduced as well, in about the same proportion as the number of
    eyes. Rhabdoms become at most as wide as the shorter side of a receptor, but their width is never below the lowest
    valid value of its gene. All other genes stay within their searched ranges.

    For compound eyes, see `evolve.genome.head_surface`.

    values: value of each gene, by name
    uses: searched range of each gene, by name
    """
    if sizes.compound:
        return head_surface.fitted(values, uses, sizes)
    fits, width = dict(values), _width_gene(uses)
    fits[width] = min(values[width], float(_most_receptors(sizes)))
    eyes, receptors = values["n_eyes"], fits[width]
    needed = _least_range_deg(eyes, receptors, sizes)
    if eyes > 1 and values["placement_range_deg"] < needed:
        widest = highest("placement_range_deg", uses)
        fits["placement_range_deg"] = min(needed, widest)
        fewest = receptors if sizes.receptor_pitch == 0 else lowest(width, uses)
        fits["n_eyes"], fits[width] = _thinned((eyes, receptors), (lowest("n_eyes", uses), fewest), widest, sizes)
    fits |= _with_high_receptors(fits, uses, sizes)
    if RHABDOM in values:
        side = 1e6 * receptor_side(sides(fits), fits["fov_deg"], vertical_fov(fits, sizes), sizes)
        fits[RHABDOM] = min(values[RHABDOM], max(side, ALL_GENES[RHABDOM].range.low))
    return fits


def _with_high_receptors(values: Values, uses: Uses, sizes: EyeConfig) -> Values:
    """Return changed gene values, by name. They make receptors at least `eye.receptor_width` high.

    If necessary, the number of rows is reduced. If even the lowest number of rows does not fit on the retina and the
    vertical field of view is a gene, this field grows, at most to its highest value. If that is not enough, the
    horizontal field of view shrinks. The retina keeps its width [m], so that a degree then takes more of it, and the
    retina becomes higher [m]. If the settings make all receptors square, the result is {}, because receptors that are
    wide enough are then also high enough.
    """
    vertical = vertical_fov(values, sizes)
    if vertical is None:
        return {}
    fov_deg, rows = values["fov_deg"], _height_gene(uses)
    shape = _RowsThatFit(values[_width_gene(uses)], rows == SIDE, sizes)
    fewest = lowest(rows, uses)
    if VERTICAL in values:
        vertical = min(max(vertical, shape.least_vertical_deg(fewest, fov_deg)), highest(VERTICAL, uses))
        fov_deg = max(min(fov_deg, shape.most_fov_deg(fewest, vertical)), lowest("fov_deg", uses))
    counts = range(int(values[rows]), int(fewest), -1)
    most = next((float(count) for count in counts if shape.fits(count, fov_deg, vertical)), fewest)
    return {rows: most} | ({VERTICAL: vertical, "fov_deg": fov_deg} if VERTICAL in values else {})


@dataclass(frozen=True)
class _RowsThatFit:
    """Test of whether a number of rows fits on a retina if receptors are at least `eye.receptor_width` high.

    columns: number of receptors along the width
    square: True if the number of columns equals the number of rows; `columns` is then ignored
    sizes: settings of the eyes
    """

    columns: float
    square: bool
    sizes: EyeConfig

    def _least_ratio(self, rows: float) -> float:
        """Return the smallest ratio of height to width [m/m] of a retina on which this number of rows fits."""
        width = retina_width(rows if self.square else self.columns, self.sizes)
        return rows * self.sizes.receptor_width / width

    def fits(self, rows: float, fov_deg: float, vertical: float) -> bool:
        return _tangent(vertical) * (1 + SLACK) >= self._least_ratio(rows) * _tangent(fov_deg)

    def least_vertical_deg(self, rows: float, fov_deg: float) -> float:
        return _degrees(self._least_ratio(rows) * _tangent(fov_deg))

    def most_fov_deg(self, rows: float, vertical: float) -> float:
        return _degrees(_tangent(vertical) / self._least_ratio(rows))


def _tangent(field_deg: float) -> float:
    return math.tan(math.radians(field_deg) / 2)


def _degrees(tangent: float) -> float:
    return math.degrees(2 * math.atan(tangent))


def _thinned(wanted: Pair, least: Pair, range_deg: float, sizes: EyeConfig) -> Pair:
    """Return numbers of eyes, and of receptors along an eye's width: those closest to `wanted` without overlap of eyes.

    This function is part of the repair of animals whose eyes would overlap: it reduces their numbers of eyes and of
    receptors. The distance from `wanted` is the sum of two squared logarithms: of the ratio of the two numbers of eyes,
    and of the ratio of the two numbers of receptors. With this distance, the repair halves both numbers rather than
    dividing one of them by four. If the repair always reduced the same number, evolution would drift towards animals in
    which the other number is large. Selection, not the repair, should choose between eyes and receptors.

    The required space depends on the number of gaps between eyes, eyes - 1. The ratio of two numbers of eyes is
    therefore computed from eyes - 0.5, the mean of the numbers of eyes and of gaps. This preserves the proportion of
    eyes to receptors best.

    wanted, least: numbers of eyes and receptors before the repair, and their smallest allowed values
    range_deg: angle over which the eyes may be spread [deg]
    """
    (eyes, receptors), (fewest_eyes, fewest) = wanted, least
    counts = range(int(fewest), int(receptors) + 1)
    fitting = [(min(eyes, float(_most_eyes(range_deg, count, sizes))), float(count)) for count in counts]
    allowed = [fit for fit in fitting if fit[0] >= fewest_eyes]
    return min(allowed, key=lambda fit: _ratio(eyes - 0.5, fit[0] - 0.5) ** 2 + _ratio(receptors, fit[1]) ** 2)


def _ratio(one: float, other: float) -> float:
    return math.log(one / other)


def contradiction(uses: Uses, sizes: EyeConfig) -> Contradiction | None:
    """Return None if `fitted` can repair every genome, so that no eyes or receptors overlap.

    Otherwise return an error message and the names of the settings that contradict each other.
    """
    if sizes.compound:
        return head_surface.contradiction(uses, sizes)
    return _crowded_retina(uses, sizes) or _low_retina(uses, sizes) or _crowded_head(uses, sizes)


def _crowded_retina(uses: Uses, sizes: EyeConfig) -> Contradiction | None:
    if 0 < sizes.receptor_pitch < sizes.receptor_width:
        return (
            f"eye.receptor_pitch = {sizes.receptor_pitch:g}: must be 0 or at least eye.receptor_width = "
            f"{sizes.receptor_width:g}",
            ("eye.receptor_pitch", "eye.receptor_width"),
        )
    width = _width_gene(uses)
    receptors = lowest(width, uses)
    if receptors > _most_receptors(sizes):
        return (
            f"{receptors:g} receptors of at least {sizes.receptor_width:g} m (eye.receptor_width) do not fit side by "
            f"side on a retina of {sizes.sensor_width:g} m (eye.sensor_width)",
            (f"genome.{width}.low", f"genome.{width}.start", "eye.receptor_width", "eye.sensor_width"),
        )
    return None


def _low_retina(uses: Uses, sizes: EyeConfig) -> Contradiction | None:
    fields = {"fov_deg": lowest("fov_deg", uses)} | ({VERTICAL: highest(VERTICAL, uses)} if VERTICAL in uses else {})
    vertical, rows, width = vertical_fov(fields, sizes), _height_gene(uses), _width_gene(uses)
    if vertical is None:
        return None
    fewest, columns = lowest(rows, uses), lowest(width, uses)
    if _RowsThatFit(columns, rows == SIDE, sizes).fits(fewest, fields["fov_deg"], vertical):
        return None
    return (
        f"{fewest:g} rows of receptors at least {sizes.receptor_width:g} m high (eye.receptor_width) do not fit on a "
        f"retina {retina_width(columns, sizes):g} m wide with fields of view of {fields['fov_deg']:g}° x {vertical:g}°",
        (f"genome.{rows}.low", f"genome.{rows}.start", "eye.receptor_width", "eye.vertical_fov"),
    )


def _crowded_head(uses: Uses, sizes: EyeConfig) -> Contradiction | None:
    width = _width_gene(uses)
    eyes, receptors = lowest("n_eyes", uses), lowest(width, uses)
    widest = highest("placement_range_deg", uses)
    if eyes == 1 or eyes <= _most_eyes(widest, receptors, sizes):
        return None
    pitched = sizes.receptor_pitch > 0
    source = f"{receptors:g} receptors of eye.receptor_pitch" if pitched else "eye.sensor_width"
    keys = ("eye.receptor_pitch", f"genome.{width}.low", f"genome.{width}.start") if pitched else ("eye.sensor_width",)
    return (
        f"{eyes:g} eyes of {retina_width(receptors, sizes):g} m ({source}) do not fit side by side on {widest:g}° of a "
        f"head of radius {sizes.head_radius:g} m (eye.head_radius)",
        ("genome.n_eyes.low", "genome.n_eyes.start", "eye.head_radius", *keys),
    )


def _height_gene(uses: Uses) -> str:
    return SIDE if SIDE in uses else SIDES[0]


def _width_gene(uses: Uses) -> str:
    return SIDE if SIDE in uses else SIDES[1]


def _most_receptors(sizes: EyeConfig) -> float:
    if sizes.receptor_pitch > 0:
        return math.inf
    return int(sizes.sensor_width / sizes.receptor_width * (1 + SLACK))


def _least_range_deg(eyes: float, receptors: float, sizes: EyeConfig) -> float:
    return math.degrees((eyes - 1) * retina_width(receptors, sizes) / sizes.head_radius)


def _most_eyes(range_deg: float, receptors: float, sizes: EyeConfig) -> int:
    return 1 + int(math.radians(range_deg) * sizes.head_radius / retina_width(receptors, sizes) * (1 + SLACK))
