"""What differs between the episodes of a task of one's own: how bright its lights are, and how warm.

All of a world's lights, the sky among them, are multiplied by one spectrum, and signals with them, exactly: light adds
up. So all worlds are still one kernel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.constants import c, h, k

from optics.numerics.arguments import did_you_mean
from optics.spectra.spectrum import cie_1931, daylight

DAYLIGHT = 6504.0  # [K] the correlated colour temperature of CIE D65
LIMITS = {"light": (1e-6, 1e6), "color_temperature": (1000.0, 40_000.0)}  # of their ranges: a factor, and kelvins
_VISIBLE = np.arange(380, 781, 5) * 1e-9


@dataclass(frozen=True)
class Variation:
    """ranges: (low, high) by name, those of LIMITS; low = high is one value for all

    Raises:
        ValueError: another name, or no range.
    """

    ranges: Mapping[str, tuple[float, float]]

    def __post_init__(self) -> None:
        for name, given in self.ranges.items():
            if name not in LIMITS:
                hint = did_you_mean(name, list(LIMITS)) or f": must be one of {', '.join(LIMITS)}"
                raise ValueError(f"vary: {name!r}{hint}")
            least, most = LIMITS[name]
            if not _is_range(given) or not least <= given[0] <= given[1] <= most:
                raise ValueError(f"vary: {name} = {given!r}: must be (low, high) within [{least:g}, {most:g}]")

    def draw(self, random: np.random.Generator) -> dict[str, float]:
        """For one episode: factors evenly over their logarithm, temperatures over their reciprocal, in which equal
        steps look alike (mired)."""
        found = {}
        for name, (low, high) in self.ranges.items():
            share = random.random()
            if name == "light":
                found[name] = low * (high / low) ** share
            else:
                found[name] = 1 / (1 / low + (1 / high - 1 / low) * share)
        return found

    def light(self, values: Mapping[str, np.ndarray], wavelengths: np.ndarray) -> np.ndarray:
        """What lights are multiplied by, (world, band) float32; values: by name, of each world · wavelengths [m]"""
        n = len(next(iter(values.values())))
        factors = np.ones((n, len(wavelengths)))
        if "light" in values:
            factors *= values["light"][:, None]
        if "color_temperature" in values:
            factors *= np.array([filter_to(kelvins, wavelengths) for kelvins in values["color_temperature"]])
        return factors.astype(np.float32)

    def extremes(self, wavelengths: np.ndarray) -> np.ndarray:
        """`light` at the ends of all ranges, (case, band): no band is ever brighter or darker by a percent."""
        names = list(self.ranges)
        corners = np.stack(np.meshgrid(*self.ranges.values(), indexing="ij"), axis=-1).reshape(-1, len(names))
        return self.light(dict(zip(names, corners.T, strict=True)), wavelengths)


def filter_to(kelvins: float, wavelengths: np.ndarray) -> np.ndarray:
    """Transmission (band,) of a filter that makes of daylight what has this colour temperature and is as bright for
    people: the ratio of black bodies of this temperature and of DAYLIGHT (Planck's law), so scaled that daylight keeps
    its illuminance."""
    seen = daylight(_VISIBLE) * cie_1931(_VISIBLE)[:, 1]
    scale = seen.sum() / (seen * _ratio(kelvins, _VISIBLE)).sum()
    found: np.ndarray = scale * _ratio(kelvins, wavelengths)
    return found


def _ratio(kelvins: float, wavelengths: np.ndarray) -> np.ndarray:
    """Of Planck's spectra, both of which fall as λ⁻⁵."""
    x = h * c / (k * np.asarray(wavelengths))
    found: np.ndarray = np.expm1(x / DAYLIGHT) / np.expm1(x / kelvins)
    return found


def _is_range(given: Any) -> bool:
    try:
        return np.shape(given) == (2,) and bool(np.isfinite(np.asarray(given, float)).all())
    except (TypeError, ValueError):
        return False
