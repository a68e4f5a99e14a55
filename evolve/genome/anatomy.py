"""Anatomy: eyes and receptors take room. What overlaps is repaired, by changing genes as little as will do.

Eyes sit on the equator of a head of radius `eye.head_radius`, each as wide as its retina; neighbours are
placement range / (eyes - 1) apart. Retinas are all `eye.sensor_width` wide, with receptors side by side, none narrower
than `eye.receptor_width`; or, where `eye.receptor_pitch` is above 0, as wide as so many receptors of that width.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from evolve.genome.eye_config import EyeConfig
from evolve.genome.genes import ALL_GENES, RHABDOM, SIDE, SIDES, GeneConfig

__all__ = ["contradiction", "fitted", "retina_width", "sides"]

Values = dict[str, float]
Uses = Mapping[str, GeneConfig]
Pair = tuple[float, float]
Contradiction = tuple[str, tuple[str, ...]]
SLACK = 1e-9  # of rounding: eyes that just touch do not overlap


def retina_width(receptors: float, sizes: EyeConfig) -> float:
    """Width of a retina with so many receptors side by side [m]: an eye's on the head."""
    return receptors * sizes.receptor_pitch if sizes.receptor_pitch > 0 else sizes.sensor_width


def sides(values: Values) -> tuple[int, int]:
    """An eye's receptors, (height, width)."""
    height, width = (SIDE, SIDE) if SIDE in values else SIDES
    return int(values[height]), int(values[width])


def fitted(values: Values, uses: Uses, sizes: EyeConfig) -> Values:
    """`values` of an animal in which nothing overlaps; genes stay within their searched ranges.

    Receptors too narrow are fewer, and rhabdoms wider than receptors narrower. Eyes too close are spread; where the
    searched range of their placement ends, there are fewer of them, or, where eyes of fewer receptors are narrower,
    fewer of both in like proportion.
    """
    fits, width = dict(values), _width_gene(uses)
    fits[width] = min(values[width], float(_most_receptors(sizes)))
    eyes, receptors = values["n_eyes"], fits[width]
    needed = _least_range_deg(eyes, receptors, sizes)
    if eyes > 1 and values["placement_range_deg"] < needed:
        widest = _highest("placement_range_deg", uses)
        fits["placement_range_deg"] = min(needed, widest)
        fewest = receptors if sizes.receptor_pitch == 0 else _lowest(width, uses)
        fits["n_eyes"], fits[width] = _thinned((eyes, receptors), (_lowest("n_eyes", uses), fewest), widest, sizes)
    if RHABDOM in values:
        pitch = 1e6 * retina_width(fits[width], sizes) / fits[width]
        fits[RHABDOM] = min(values[RHABDOM], max(pitch, ALL_GENES[RHABDOM].range.low))
    return fits


def _thinned(asked: Pair, least: Pair, range_deg: float, sizes: EyeConfig) -> Pair:
    """The eyes and their receptors that are most like those asked for, of those that fit and are not below the least.

    Likeness is by ratios: the least sum of squared logarithms halves both rather than quarter one. Were one of them
    always to give way, evolution would drift to the other; selection is to choose between eyes and receptors. Room goes
    with the gaps between eyes, one fewer than eyes; counted halfway, they keep their proportion to receptors best.
    """
    (eyes, receptors), (fewest_eyes, fewest) = asked, least
    counts = range(int(fewest), int(receptors) + 1)
    fitting = [(min(eyes, float(_most_eyes(range_deg, count, sizes))), float(count)) for count in counts]
    allowed = [fit for fit in fitting if fit[0] >= fewest_eyes]
    return min(allowed, key=lambda fit: _ratio(eyes - 0.5, fit[0] - 0.5) ** 2 + _ratio(receptors, fit[1]) ** 2)


def _ratio(one: float, other: float) -> float:
    return math.log(one / other)


def contradiction(uses: Uses, sizes: EyeConfig) -> Contradiction | None:
    """Why no animal with these genes fits together, and the settings to blame; None if every genome can be repaired."""
    return _crowded_retina(uses, sizes) or _crowded_head(uses, sizes)


def _crowded_retina(uses: Uses, sizes: EyeConfig) -> Contradiction | None:
    if 0 < sizes.receptor_pitch < sizes.receptor_width:
        return (
            f"eye.receptor_pitch = {sizes.receptor_pitch:g}: must be 0 or at least eye.receptor_width = "
            f"{sizes.receptor_width:g}",
            ("eye.receptor_pitch", "eye.receptor_width"),
        )
    width = _width_gene(uses)
    receptors = _lowest(width, uses)
    if receptors > _most_receptors(sizes):
        return (
            f"{receptors:g} receptors of at least {sizes.receptor_width:g} m (eye.receptor_width) do not fit side by "
            f"side on a retina of {sizes.sensor_width:g} m (eye.sensor_width)",
            (f"genome.{width}.low", f"genome.{width}.start", "eye.receptor_width", "eye.sensor_width"),
        )
    return None


def _crowded_head(uses: Uses, sizes: EyeConfig) -> Contradiction | None:
    width = _width_gene(uses)
    eyes, receptors = _lowest("n_eyes", uses), _lowest(width, uses)
    widest = _highest("placement_range_deg", uses)
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


def _lowest(name: str, uses: Uses) -> float:
    return uses[name].low if uses[name].open else uses[name].start


def _highest(name: str, uses: Uses) -> float:
    return uses[name].high if uses[name].open else uses[name].start
