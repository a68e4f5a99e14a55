"""Masks: amplitude transmittance over the pupil."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np

from optics.elements.relief import HeightMap
from optics.elements.square_samples import map_samples
from optics.numerics.arguments import positive, shown
from optics.numerics.array_library import library, like
from optics.numerics.autodiff import Array, Scalar, is_differentiable, number

__all__ = ["GaussianMask", "Mask", "MaskMap"]

OVERSHOOT = 0.02  # choice: the spline through the samples may exceed [-1, 1] by this amount
FINER = 4  # choice: points per sample at which the overshoot is checked


class Mask(ABC):
    """Amplitude transmittance, between -1 and 1; its square is the intensity transmittance."""

    @abstractmethod
    def amplitude(self, x: Array, y: Array, radius: Scalar) -> Array:
        """Return the amplitude at points (x, y) [m] of a pupil of this radius [m].

        x, y: arrays of NumPy or PyTorch whose shapes broadcast, or flat Float64 arrays of Dr.Jit.
        """

    @abstractmethod
    def bandwidth(self, level: float, radius: float) -> float:
        """Return the spatial frequency [1/m] above which components of the mask's amplitude are below `level`.

        radius: radius of the pupil [m].
        """

    def detail(self, light: float, radius: float) -> float:
        """Return the frequency [1/m] along x and y beyond which the mask scatters at most a given amount of light.

        light: amount of light that may be scattered beyond this frequency, as a fraction of the light that falls on the
            whole disk of the pupil.
        radius: radius of the pupil [m].
        """
        return self.bandwidth(math.sqrt(light), radius)

    @property
    def rotationally_symmetric(self) -> bool:
        """True if the mask and its requested derivatives depend only on the distance from the axis."""
        return False

    @property
    def radius(self) -> float | None:
        """Radius [m] of the area in which the mask's amplitude is defined; for a square, half of its side.

        None: the area is as wide as the pupil, or unlimited.
        """
        return None

    @property
    def plain(self) -> bool:
        """True if all numbers of the mask are plain Python or NumPy numbers, which cannot carry derivatives."""
        return False


@dataclass(frozen=True, eq=False)
class GaussianMask(Mask):
    """The amplitude exp(-r²/w²) at the distance r from the axis, as of a laser beam or a photoreceptor's guided mode.

    At r = w the intensity is 1/e².

    waist: w [m]. It may carry a derivative, as a Dr.Jit number or a PyTorch tensor.

    Raises:
        ValueError: waist is not positive.
    """

    waist: Scalar

    def __post_init__(self) -> None:
        positive("waist", self.waist, carried=True)

    def amplitude(self, x: Array, y: Array, radius: Scalar) -> Array:
        waist = like(x, self.waist)
        return library(x).exp(-(x * x + y * y) / (waist * waist))

    def bandwidth(self, level: float, radius: float) -> float:
        """Return the frequency f [1/m] at which the spectrum exp(-π²w²f²) falls to `level`; at least 1/(πw).

        w is the waist.
        """
        return math.sqrt(max(-math.log(level), 1.0)) / (math.pi * number(self.waist))

    def detail(self, light: float, radius: float) -> float:
        """Return the frequency f [1/m] along x and y beyond which the mask scatters at most a given amount of light.

        If the waist is w, the fraction exp(-2π²w²f²) of the transmitted light lies beyond f.

        light: amount of light that may be scattered beyond f, as a fraction of the light that falls on the whole disk
            of the pupil.
        radius: radius of the pupil [m].
        """
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
    """Amplitudes in [-1, 1], sampled at cell centres over the square [-reach, reach]², joined by cubic splines.

    HeightMap describes the interpolation. For hard edges use apertures instead.

    samples: (row, column); rows ascend with y, columns with x.
    reach: half side [m] of the square, at least the pupil's radius. None: equal to the pupil's radius.

    The samples may carry derivatives, as a Dr.Jit or PyTorch tensor.

    Raises:
        ValueError: the samples are not two-dimensional, are empty or of half precision, or one is not a real number in
            [-1, 1]. The reach is not positive, or the spline exceeds [-1, 1] by more than 0.02, as it may at jumps.
    """

    samples: np.ndarray | Array
    reach: float | None = None
    _map: HeightMap = field(init=False, repr=False)

    def __post_init__(self) -> None:
        values = map_samples(self.samples, "samples", "amplitudes")
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
                "[-1, 1]; for hard edges use an aperture, such as difference(Circle(), Disk(0.3))"
            )

    def _most(self) -> float:
        """Return the largest magnitude of the spline through the samples.

        Only points within the circle that is inscribed in the square of the samples are considered.
        """
        n = FINER * self._map.knots
        at = (np.arange(n) + 0.5) * 2 / n - 1
        return float(np.abs(self._map.on_grid(at)[np.hypot(*np.meshgrid(at, at)) <= 1]).max())

    def amplitude(self, x: Array, y: Array, radius: Scalar) -> Array:
        scale = 1 / like(x, radius if self.reach is None else self.reach)
        return self._map.height(x * scale, y * scale)

    def on_grid(self, at: np.ndarray, radius: float) -> np.ndarray:
        """Return amplitudes (y, x) at the same positions along both axes, without derivatives.

        at: positions in units of the pupil's radius.
        radius: radius of the pupil [m].
        """
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
