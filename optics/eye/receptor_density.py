"""Density of receptors over a retina: a fovea, a visual streak, a map, or any function of directions."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from optics.eye.geometry import WIDEST_DEG, direction
from optics.numerics.arguments import in_range, reals, shown
from optics.numerics.read_only import read_only

__all__ = ["Density", "DensityMap", "Fovea", "VisualStreak", "density_of", "density_on"]

# Function of the angles (right, up) [degrees] of directions from the eye's axis, arrays of the same shape.
Density: TypeAlias = Callable[[np.ndarray, np.ndarray], Any]

# Choice: cells of the retina along an axis, for each receptor along it, on which a function is evaluated.
PER_RECEPTOR, FEWEST, MOST = 8, 512, 2048
HUMAN_E2_DEG = 1.04  # mean of r_2k on the four meridians: 1.058, 1.035, 1.084 and 0.9932 (Watson 2014, table 1)


@dataclass(frozen=True)
class Fovea:
    """Receptors whose acuity falls with the angle E from the fovea, as 1/(1 + E/E₂).

    The number of columns of receptors per horizontal angle and the number of rows per vertical angle follow this law.
    The density is the product of both. If the field is a square around the fovea, the receptors at the fovea have the
    shape of the average receptor. The default E₂ is that of midget ganglion cells, which limit human acuity. Source:
    Watson, J. Vision 14(7):15, 2014, equation 8. The first term of this equation is a density of (1 + E/E₂)⁻² in all
    directions. The second, smaller term is left out.

    e2_deg: angle E₂ [degrees] at which acuity is half of that at the fovea, 1e-3 to 1e3.
    center_deg: angles (right, up) [degrees] of the fovea from the eye's axis, -80 to 80.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
    """

    e2_deg: float = HUMAN_E2_DEG
    center_deg: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        in_range("Fovea: e2_deg", self.e2_deg, 1e-3, 1e3)
        object.__setattr__(self, "center_deg", direction("Fovea: center_deg", self.center_deg))

    def __call__(self, right_deg: np.ndarray, up_deg: np.ndarray) -> np.ndarray:
        """Return the number of receptors per area of the flat retina, up to a constant factor.

        right_deg, up_deg: directions that the receptors see, as angles [degrees] from the eye's axis.
        """
        right, up = self.center_deg
        return _per_length(right_deg, right, self.e2_deg) * _per_length(up_deg, up, self.e2_deg)


@dataclass(frozen=True)
class VisualStreak:
    """Receptors whose vertical acuity falls with the angle E above and below a horizontal streak, as 1/(1 + E/E₂).

    The horizontal angle between the columns of receptors is the same everywhere.

    e2_deg: angle E₂ [degrees] at which vertical acuity is half of that in the streak, 1e-3 to 1e3.
    elevation_deg: angle [degrees] of the streak above the eye's axis, -80 to 80.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
    """

    e2_deg: float = 5.0
    elevation_deg: float = 0.0

    def __post_init__(self) -> None:
        in_range("VisualStreak: e2_deg", self.e2_deg, 1e-3, 1e3)
        in_range("VisualStreak: elevation_deg", self.elevation_deg, -WIDEST_DEG, WIDEST_DEG)

    def __call__(self, right_deg: np.ndarray, up_deg: np.ndarray) -> np.ndarray:
        """Return the number of receptors per area of the flat retina, up to a constant factor.

        right_deg, up_deg: directions that the receptors see, as angles [degrees] from the eye's axis.
        """
        return _per_length(right_deg, 0.0, np.inf) * _per_length(up_deg, self.elevation_deg, self.e2_deg)


@dataclass(frozen=True, eq=False)
class DensityMap:
    """Density of receptors per area of the retina, as an array over the whole field.

    values: relative densities (row, column) of equal cells, with the top left of the visual field first.
    """

    values: np.ndarray

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", read_only(self.values))

    @cached_property
    def _key(self) -> tuple[tuple[int, ...], bytes]:
        return self.values.shape, self.values.tobytes()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, DensityMap) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    def __repr__(self) -> str:
        return f"DensityMap({self.values.shape[0]} x {self.values.shape[1]})"


def density_of(value: Any) -> Density | DensityMap | None:
    """Return the density of receptors in the form that an `Eye` stores.

    Raises:
        ValueError: the value is neither a hashable function, nor a map of positive numbers with at most 2048 rows and
            columns, nor None.
    """
    if value is None or isinstance(value, DensityMap):
        return value
    hashable = isinstance(value, Hashable)  # lattices are stored by their densities
    if callable(value) and hashable and not isinstance(value, type):
        found: Density = value
        return found
    wanted = "a function of (right_deg, up_deg) such as optics.Fovea(2.0), or a map (row, column) of positive numbers"
    if isinstance(value, str | type) or np.ndim(value) == 0:
        raise ValueError(f"density = {shown(value)}: must be {wanted}")
    values = reals("density", value)
    if values.ndim != 2 or values.size == 0 or max(values.shape) > MOST:
        raise ValueError(f"density has shape {values.shape}: must be {wanted}, with at most {MOST} rows and columns")
    return DensityMap(_checked("density", values).astype(float))


def density_on(
    density: Density | DensityMap, resolution: tuple[int, int], halves: tuple[float, float], middle: tuple[float, float]
) -> np.ndarray:
    """Return the relative density (row, column) on equal cells of the retina, from the top left of the visual field.

    resolution: number of receptors (height, width).
    halves: half height and half width of the field on the plane at distance 1 in front of the eye.
    middle: position (right, down) of the field's middle on this plane, the tangents of its angles from the axis.

    Raises:
        ValueError: the values of a function are not positive and finite, or do not have the shape of its arguments.
    """
    if isinstance(density, DensityMap):
        return density.values
    counts = [int(np.clip(PER_RECEPTOR * n, FEWEST, MOST)) for n in resolution]
    down, across = (
        at + half * ((2 * np.arange(n) + 1) / n - 1) for n, half, at in zip(counts, halves, middle[::-1], strict=True)
    )
    right, up = np.meshgrid(np.degrees(np.arctan(across)), -np.degrees(np.arctan(down)))
    found = reals("density(right_deg, up_deg)", density(right, up))
    if found.shape != right.shape:
        raise ValueError(f"density(right_deg, up_deg) has shape {found.shape}: must be that of the angles")
    return _checked("density(right_deg, up_deg)", found)


def _checked(name: str, values: np.ndarray) -> np.ndarray:
    if not np.isfinite(values).all():
        raise ValueError(f"{name} holds NaN or infinity: must be finite")
    if values.min() <= 0:
        raise ValueError(f"{name} is {values.min():g} at its smallest: must be greater than 0")
    return values


def _per_length(angle_deg: np.ndarray, middle_deg: float, e2_deg: float) -> np.ndarray:
    """Return the relative number of receptors per length of the flat retina along an axis.

    Per angle, it is 1/(1 + E/E₂), where E is the angle from `middle_deg`.

    The angle dα on the retina at the distance f has the length f dα/cos²α.
    """
    found: np.ndarray = np.cos(np.radians(angle_deg)) ** 2 / (1 + np.abs(angle_deg - middle_deg) / e2_deg)
    return found
