"""Quantities that differ between the episodes of a task: light, and sizes, colours, materials and places of objects.

All lights of a world, including the sky, are multiplied by one spectrum. Since light is additive, this multiplies the
radiance in each band by exactly the value of this spectrum in the band. Each world may have its own sizes, colours,
materials and places of objects (`sim.scene.world_models`), but all worlds share one kernel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.constants import c, h, k

from optics.numerics.arguments import did_you_mean, shown
from optics.numerics.number_types import full_precision, readable
from optics.spectra.spectrum import cie_1931, daylight

DAYLIGHT = 6504.0  # [K] the correlated colour temperature of CIE D65
LIGHT, TEMPERATURE = "light", "color_temperature"
# Quantities of named objects: "ball.size".
SIZE, COLOR, MATERIAL, START = OF_THINGS = ("size", "color", "material", "start")
# Limits of the ranges: factors, kelvins, components of red, green and blue, and lengths or angles.
LIMITS = {
    LIGHT: (1e-6, 1e6),
    TEMPERATURE: (1000.0, 40_000.0),
    SIZE: (1e-3, 1e3),
    COLOR: (0.0, 1.0),
    START: (-1e6, 1e6),
}
_VISIBLE = np.arange(380, 781, 5) * 1e-9

Range = tuple[Any, ...]
Drawn = float | np.ndarray | str


@dataclass(frozen=True)
class Variation:
    """Ranges of the quantities that differ between episodes.

    ranges: (low, high) for each quantity, by the quantity's name. Quantities of the light are "light" (a factor by
        which all lights are multiplied) and "color_temperature" [K]. Quantities of the object NAME are "NAME.size" (a
        factor), "NAME.color" (display-referred, 0 to 1) and "NAME.start" (initial position [m], or [rad] for a hinge).
        For colours and points in space, low and high have three numbers each, and are opposite corners of a box. If
        low = high, the value is the same in all episodes. "NAME.material" has names of materials instead of (low,
        high); one of them is drawn.

    Raises:
        ValueError: a name is unknown, or a range is invalid.
    """

    ranges: Mapping[str, Range]

    def __post_init__(self) -> None:
        if not isinstance(self.ranges, Mapping):
            raise ValueError(f"vary = {shown(self.ranges)}: must be ranges by name, such as {{'light': (0.1, 1)}}")
        for name, given in self.ranges.items():
            what = kind_of(name)
            if what == MATERIAL:
                _check_names(name, given)
                continue
            least, most = LIMITS[what]
            corners = _corners(f"vary: {name}", given)
            wanted = {COLOR: (3,), START: None}.get(what, ())
            fits = corners is not None and corners.shape[1:] in ({(), (3,)} if wanted is None else {wanted})
            if corners is None or not fits or not (least <= corners[0]).all() or not (corners[1] <= most).all():
                raise ValueError(f"vary: {name} = {given!r}: must be {_FORM[what]} within [{least:g}, {most:g}]")
            if (corners[0] > corners[1]).any():
                raise ValueError(f"vary: {name} = {given!r}: must be (low, high), low first")

    def draw(self, random: np.random.Generator) -> dict[str, Drawn]:
        """Return random values for one episode, in a dictionary with the same keys as `ranges`.

        Factors of light and of sizes are distributed uniformly in their logarithm. Temperatures are distributed
        uniformly in their reciprocal (mired), in which equal steps look equally large. Each component of a colour or a
        starting place is distributed uniformly between its low and its high limit. All materials have the same
        probability.
        """
        found: dict[str, Drawn] = {}
        for name, given in self.ranges.items():
            what = kind_of(name)
            if what == MATERIAL:
                found[name] = str(given[random.integers(len(given))])
                continue
            low, high = given
            if what in (LIGHT, SIZE):
                found[name] = low * (high / low) ** random.random()
            elif what == TEMPERATURE:
                found[name] = 1 / (1 / low + (1 / high - 1 / low) * random.random())
            else:
                corners = np.asarray(readable(name, (low, high)), float)
                drawn = corners[0] + (corners[1] - corners[0]) * random.random(corners.shape[1:])
                found[name] = drawn if drawn.ndim else float(drawn)
        return found

    def blank(self, n: int) -> dict[str, np.ndarray]:
        """Return arrays for the drawn values of n worlds, in a dictionary with the same keys as `ranges`.

        An array contains numbers, (n,) or (n, 3), or names of materials, (n,).
        """
        return {
            name: np.array(given)[np.zeros(n, int)] if kind_of(name) == MATERIAL else np.ones((n, *np.shape(given[0])))
            for name, given in self.ranges.items()
        }

    def of_things(self, what: str) -> dict[str, str]:
        """Return a dictionary from names of objects to those keys of `ranges` that belong to one quantity.

        For the quantity "size", an example is {"ball": "ball.size"}.

        what: the quantity: "size", "color", "material" or "start"
        """
        return {name.rpartition(".")[0]: name for name in self.ranges if kind_of(name) == what}

    @property
    def of_light(self) -> tuple[str, ...]:
        """Names of those entries of `ranges` that concern light: "light", "color_temperature", both or none."""
        return tuple(name for name in self.ranges if name in (LIGHT, TEMPERATURE))

    @property
    def of_appearances(self) -> bool:
        """True if sizes, colours or materials differ between episodes."""
        return any(kind_of(name) in (SIZE, COLOR, MATERIAL) for name in self.ranges)

    def light(self, values: Mapping[str, np.ndarray], wavelengths: np.ndarray) -> np.ndarray | None:
        """Return the factors of the lights, (world, band) float32; None if light does not vary.

        values: drawn values by name, (world,)
        wavelengths: centres of the bands [m], (band,)
        """
        if not self.of_light:
            return None
        n = len(values[self.of_light[0]])
        factors = np.ones((n, len(wavelengths)))
        if LIGHT in values:
            factors *= values[LIGHT][:, None]
        if TEMPERATURE in values:
            factors *= np.array([filter_to(kelvins, wavelengths) for kelvins in values[TEMPERATURE]])
        return factors.astype(np.float32)

    def extremes(self, wavelengths: np.ndarray) -> np.ndarray:
        """Return the factors by which the lights are multiplied, at all combinations of range limits.

        Only the ranges "light" and "color_temperature" are used, each at its low and its high limit. All factors are 1
        if light does not vary. The maximum over the whole array is the largest factor that the ranges permit. The
        maximum of a single band may be too small: a temperature inside its range may give a larger factor in this band
        than both limits. If the range extends from warm to cold light, this factor may exceed the band's maximum in the
        array by up to a third. The array has the shape (combination, band).

        wavelengths: centres of the bands [m], (band,)
        """
        names = self.of_light
        ends = [self.ranges[name] for name in names]
        corners = np.stack(np.meshgrid(*ends, indexing="ij"), axis=-1).reshape(-1, len(names)) if names else None
        if corners is None:
            return np.ones((1, len(wavelengths)), np.float32)
        found = self.light(dict(zip(names, corners.T, strict=True)), wavelengths)
        assert found is not None
        return found


_FORM = {
    LIGHT: "(low, high)",
    TEMPERATURE: "(low, high)",
    SIZE: "(low, high), factors,",
    COLOR: "((red, green, blue), (red, green, blue))",
    START: "(low, high), numbers or points (x, y, z),",
}


def kind_of(name: str) -> str:
    """Return the quantity that a key of `Variation.ranges` stands for; for example, "size" for "ball.size".

    The quantity is "light", "color_temperature", "size", "color", "material" or "start".

    Raises:
        ValueError: the quantity is unknown.
    """
    if name in (LIGHT, TEMPERATURE):
        return name
    thing, _, what = str(name).rpartition(".")
    if thing and what in OF_THINGS:
        return what
    near = [LIGHT, TEMPERATURE, *(f"{thing}.{each}" for each in OF_THINGS if thing)]
    known = [LIGHT, TEMPERATURE, *(f"NAME.{each}" for each in OF_THINGS)]
    hint = did_you_mean(name, near) or f": must be one of {', '.join(known)}"
    raise ValueError(f"vary: {name!r}{hint}")


def _check_names(name: str, given: Any) -> None:
    names = given if isinstance(given, tuple | list) and all(isinstance(each, str) for each in given) else ()
    if not names or len(set(names)) < len(names):
        raise ValueError(f"vary: {name} = {given!r}: must be (name, name, ...), materials, each of them once")


def filter_to(kelvins: float, wavelengths: np.ndarray) -> np.ndarray:
    """Return the transmission (band,) of a filter that changes the colour temperature of daylight to `kelvins` [K].

    It is the Planck spectrum at `kelvins`, divided by the Planck spectrum at 6504 K, the temperature of D65. The ratio
    is scaled to preserve the illuminance.

    wavelengths: centres of the bands [m], (band,)
    """
    seen = daylight(_VISIBLE) * cie_1931(_VISIBLE)[:, 1]
    scale = seen.sum() / (seen * _ratio(kelvins, _VISIBLE)).sum()
    found: np.ndarray = scale * _ratio(kelvins, wavelengths)
    return found


def _ratio(kelvins: float, wavelengths: np.ndarray) -> np.ndarray:
    """Return the ratio of the Planck spectra at the temperatures `kelvins` and 6504 K (D65), at wavelengths [m]."""
    x = h * c / (k * np.asarray(wavelengths))
    found: np.ndarray = np.expm1(x / DAYLIGHT) / np.expm1(x / kelvins)
    return found


def _corners(name: str, given: Any) -> np.ndarray | None:
    """Return (low, high) as an array (2,) or (2, 3); None if `given` has another shape or is not finite."""
    given = full_precision(name, given)
    try:
        corners = np.asarray(given, float)
    except (TypeError, ValueError):
        return None
    return corners if corners.shape in ((2,), (2, 3)) and np.isfinite(corners).all() else None
