"""Masks: amplitude transmittance over the pupil."""

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

OVERSHOOT = 0.02  # choice: largest excess of the spline over [-1, 1]
FINER = 4  # choice: steps per sample of this check


class Mask(ABC):
    """Amplitude transmittance, between -1 and 1; its square is the intensity transmittance."""

    @abstractmethod
    def amplitude(self, x: Array, y: Array, radius: Scalar, types: Precision) -> Array:
        """Amplitude at points (x, y) [m] of a pupil of this radius [m], flat Dr.Jit float64 arrays."""

    @abstractmethod
    def bandwidth(self, level: float, radius: float) -> float:
        """Spatial frequency [1/m] above which the mask's content is below `level`."""

    def detail(self, light: float, radius: float) -> float:
        """Spatial frequency [1/m] along x and y beyond which the mask sends at most this light.

        light: mean over the disk of a pupil of this radius [m]; 1 is all incident light.
        """
        return self.bandwidth(math.sqrt(light), radius)

    @property
    def rotationally_symmetric(self) -> bool:
        """True if the mask depends only on the distance from the axis, also under all requested derivatives."""
        return False

    @property
    def radius(self) -> float | None:
        """Radius [m] over which the mask is known; None: the pupil's, or unlimited."""
        return None

    @property
    def plain(self) -> bool:
        """True if all its numbers are plain ones, which cannot carry derivatives."""
        return False


@dataclass(frozen=True, eq=False)
class GaussianMask(Mask):
    """exp(-r²/w²), as for a laser beam or the guided mode of a photoreceptor: intensity falls to 1/e² at r = w.

    waist: w [m]; a Dr.Jit number may carry a derivative.

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
        """Frequency from the mask's spectrum, exp(-π²w²f²)."""
        return math.sqrt(max(-math.log(level), 1.0)) / (math.pi * number(self.waist))

    def detail(self, light: float, radius: float) -> float:
        """A share exp(-2π²w²f²) of the light lies beyond f."""
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
    """Amplitudes in [-1, 1] sampled at cell centres over the square [-radius, radius]², joined by cubic splines.

    The interpolation is that of HeightMap. For hard edges use apertures instead.

    samples: (n, n), (y, x).
    reach: half side [m] of the square, at least the pupil's radius; None: the pupil's.

    A Dr.Jit tensor of samples carries derivatives.

    Raises:
        ValueError: not square, empty, not finite, or beyond [-1, 1], which also happens to the spline at jumps.
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
        """Amplitudes, (y, x), at positions along either axis in units of the pupil's radius [m]; no derivatives."""
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
