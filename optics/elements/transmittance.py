"""Masks: how much of the light's amplitude a pupil lets through from place to place."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np

from optics.elements.relief import HeightMap
from optics.elements.square_samples import square_samples
from optics.numerics.arguments import positive, shown
from optics.numerics.autodiff import Array, Scalar, is_differentiable, number
from optics.numerics.precision import Precision, opaque, padded_for_packets, precision

__all__ = ["GaussianMask", "Mask", "MaskMap"]

OVERSHOOT = 0.02  # choice: by which the spline may leave [-1, 1]
FINER = 4  # choice: steps per sample at which that is looked at


class Mask(ABC):
    """Transmittance of the amplitude, between -1 and 1; its square is that of the intensity."""

    @abstractmethod
    def amplitude(self, x: Array, y: Array, radius: Scalar, types: Precision) -> Array:
        """At points (x, y) [m] of a pupil of this radius [m], flat Dr.Jit float64 arrays."""

    @abstractmethod
    def bandwidth(self, level: float, radius: float) -> float:
        """Spatial frequency [1/m] above which its content is below `level`."""

    def detail(self, light: float, radius: float) -> float:
        """Spatial frequency [1/m] along x and y beyond which it sends no more than this light, as a mean over the disk
        of a pupil of this radius [m]; 1 is all that falls onto it."""
        return self.bandwidth(math.sqrt(light), radius)

    @property
    def rotationally_symmetric(self) -> bool:
        """Whether it depends on the distance from the axis alone, under any change that is asked about."""
        return False

    @property
    def radius(self) -> float | None:
        """[m], of what it is known over; None: the pupil's, or everywhere."""
        return None

    @property
    def plain(self) -> bool:
        """Whether its numbers are plain ones, of which nobody can ask for a derivative."""
        return False


@dataclass(frozen=True, eq=False)
class GaussianMask(Mask):
    """exp(-r²/w²), as a laser's beam or the guiding of a photoreceptor has it: intensity falls to 1/e² at r = w.

    waist: w [m], which may be a Dr.Jit number that carries a derivative.

    Raises:
        ValueError: not positive.
    """

    waist: Scalar

    def __post_init__(self) -> None:
        positive("waist", self.waist, carried=True)

    def amplitude(self, x: Array, y: Array, radius: Scalar, types: Precision) -> Array:
        import drjit as dr

        return dr.exp(-(x * x + y * y) / dr.square(opaque(types, self.waist)))

    def bandwidth(self, level: float, radius: float) -> float:
        """Its spectrum is exp(-π²w²f²)."""
        return math.sqrt(max(-math.log(level), 1.0)) / (math.pi * number(self.waist))

    def detail(self, light: float, radius: float) -> float:
        """Of the light exp(-2π²w²f²) goes beyond f."""
        waist = number(self.waist)
        beam = (waist / radius) ** 2 / 2 * -math.expm1(-2 * (radius / waist) ** 2)
        return math.sqrt(max(-math.log(light / beam), 0.0) / 2) / (math.pi * waist)

    @property
    def rotationally_symmetric(self) -> bool:
        return True

    @property
    def plain(self) -> bool:
        return not is_differentiable(self.waist)


@dataclass(frozen=True, eq=False)
class MaskMap(Mask):
    """Amplitudes in [-1, 1] sampled at cell centres over the square [-radius, radius]², joined by cubic splines (see
    HeightMap). For edges at which light is let through or not there are apertures.

    samples: (n, n), (y, x). reach: [m] of the square, at least the pupil's radius; None: the pupil's.

    A Dr.Jit tensor of samples carries derivatives.

    Raises:
        ValueError: not square, empty, not finite, or beyond [-1, 1], as the spline is where samples jump.
    """

    samples: np.ndarray | Array
    reach: float | None = None
    _map: HeightMap = field(init=False, repr=False)

    def __post_init__(self) -> None:
        values = square_samples(self.samples, "samples", "amplitudes")
        if np.abs(values).max() > 1 + 1e-9:
            raise ValueError(f"samples reach {shown(float(np.abs(values).max()))}: must be amplitudes in [-1, 1]")
        if self.reach is not None:
            object.__setattr__(self, "reach", positive("reach", self.reach))
        if not is_differentiable(self.samples):
            object.__setattr__(self, "samples", values)
        object.__setattr__(self, "_map", HeightMap(self.samples))
        if (most := self._most()) > 1 + OVERSHOOT:
            raise ValueError(
                f"samples jump, so that the spline through them reaches {most:.3g}: must be smooth amplitudes within "
                "[-1, 1]; hard edges are apertures, as difference(Circle(), Disk(0.3))"
            )

    def _most(self) -> float:
        """Largest amplitude within the circle."""
        n = FINER * len(self._map._heights)
        at = (np.arange(n) + 0.5) * 2 / n - 1
        x, y = (padded_for_packets(axis[np.hypot(*np.meshgrid(at, at)) <= 1]) for axis in np.meshgrid(at, at))
        types = precision("float64")
        spline = HeightMap(self._map._heights)
        return float(np.abs(spline.height(types.Float64(x), types.Float64(y), types).numpy()).max())

    def amplitude(self, x: Array, y: Array, radius: Scalar, types: Precision) -> Array:
        scale = 1 / opaque(types, radius if self.reach is None else self.reach)
        return self._map.height(x * scale, y * scale, types)

    def on_grid(self, at: np.ndarray, radius: float) -> np.ndarray:
        """Amplitudes, (y, x), at places along either axis in units of a pupil's radius [m]; without derivative."""
        return self._map.on_grid(at if self.reach is None else at * (radius / self.reach))

    def bandwidth(self, level: float, radius: float) -> float:
        return self._map.bandwidth(level) / (radius if self.reach is None else self.reach)

    def detail(self, light: float, radius: float) -> float:
        part = 1.0 if self.reach is None else min(radius / self.reach, 1.0)
        return self._map.detail(math.sqrt(light), part) / radius

    @property
    def rotationally_symmetric(self) -> bool:
        return self._map.rotationally_symmetric

    @property
    def radius(self) -> float | None:
        return self.reach

    @property
    def plain(self) -> bool:
        return not is_differentiable(self.samples)
