"""Anatomy: eyes and receptors take room. What overlaps is repaired, by changing as few genes as little as will do.

Eyes sit on the equator of a head of radius `eye.head_radius`, each as wide as its retina; neighbours are
placement range / (eyes - 1) apart. Receptors lie side by side on the retina, none narrower than `eye.receptor_width`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

from evolve.genome.genes import GeneConfig

__all__ = ["contradiction", "fitted"]

Values = dict[str, float]
Uses = Mapping[str, GeneConfig]
SLACK = 1e-9  # of rounding: eyes that just touch do not overlap


class Sizes(Protocol):
    """What takes room, all in metres."""

    @property
    def sensor_width(self) -> float: ...
    @property
    def head_radius(self) -> float: ...
    @property
    def receptor_width(self) -> float: ...


def fitted(values: Values, uses: Uses, sizes: Sizes) -> Values:
    """`values` of an animal in which nothing overlaps; genes stay within their searched ranges.

    Eyes too close are spread; where the searched range of their placement ends, there are fewer of them. Receptors too
    narrow are fewer.
    """
    fits = dict(values)
    fits["resolution_width"] = min(values["resolution_width"], float(_most_receptors(sizes)))
    needed = _least_range_deg(values["n_eyes"], sizes)
    if values["n_eyes"] > 1 and values["placement_range_deg"] < needed:
        widest = _highest("placement_range_deg", uses)
        fits["placement_range_deg"] = min(needed, widest)
        fits["n_eyes"] = min(values["n_eyes"], float(_most_eyes(widest, sizes)))
    return fits


def contradiction(uses: Uses, sizes: Sizes) -> tuple[str, tuple[str, ...]] | None:
    """Why no animal with these genes fits together, and the settings to blame; None if every genome can be repaired."""
    eyes, receptors = _lowest("n_eyes", uses), _lowest("resolution_width", uses)
    widest = _highest("placement_range_deg", uses)
    if receptors > _most_receptors(sizes):
        return (
            f"{receptors:g} receptors of at least {sizes.receptor_width:g} m (eye.receptor_width) do not fit side by "
            f"side on a retina of {sizes.sensor_width:g} m (eye.sensor_width)",
            ("genome.resolution_width.low", "genome.resolution_width.start", "eye.receptor_width", "eye.sensor_width"),
        )
    if eyes > 1 and eyes > _most_eyes(widest, sizes):
        return (
            f"{eyes:g} eyes of {sizes.sensor_width:g} m (eye.sensor_width) do not fit side by side on {widest:g}° of a "
            f"head of radius {sizes.head_radius:g} m (eye.head_radius)",
            ("genome.n_eyes.low", "genome.n_eyes.start", "eye.head_radius", "eye.sensor_width"),
        )
    return None


def _most_receptors(sizes: Sizes) -> int:
    return int(sizes.sensor_width / sizes.receptor_width * (1 + SLACK))


def _least_range_deg(eyes: float, sizes: Sizes) -> float:
    return math.degrees((eyes - 1) * sizes.sensor_width / sizes.head_radius)


def _most_eyes(range_deg: float, sizes: Sizes) -> int:
    return 1 + int(math.radians(range_deg) * sizes.head_radius / sizes.sensor_width * (1 + SLACK))


def _lowest(name: str, uses: Uses) -> float:
    return uses[name].low if uses[name].open else uses[name].start


def _highest(name: str, uses: Uses) -> float:
    return uses[name].high if uses[name].open else uses[name].start
