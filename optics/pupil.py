"""The pupil: a circular aperture with a relief and, for validation, an ideal lens."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from optics.aperture import EDGE_REACH
from optics.arguments import in_range, positive
from optics.doe import HeightMap, Relief
from optics.grid import Grid
from optics.precision import Precision, opaque, precision
from optics.refractive_index import RefractiveIndex
from optics.source import PointSource

__all__ = ["Pupil"]


@dataclass(frozen=True, eq=False)
class Pupil:
    """Transmittance A(x, y) exp(ik (n - medium_n) h(x, y)), thin-element model.

    aperture_radius: [m].
    height: None; a square array [m] (y, x) of samples at cell centres over [-a, a]² (see HeightMap); or a Relief.
    n: refractive index of the relief, constant or dispersive.
    medium_n: index of what surrounds the pupil, on both sides.
    thin_lens_focal_length: adds an ideal lens exp(-ik(√(r² + f²) - f)) [m]; negative diverges.

    Raises:
        ValueError: names argument, value and valid range.
    """

    aperture_radius: float
    height: Relief | np.ndarray | None = None
    n: float | RefractiveIndex = 1.5
    medium_n: float = 1.0
    thin_lens_focal_length: float | None = None

    def __post_init__(self) -> None:
        positive("aperture_radius", self.aperture_radius)
        in_range("medium_n", self.medium_n, 1.0, 10.0)
        if not isinstance(self.n, RefractiveIndex):
            object.__setattr__(self, "n", RefractiveIndex(float(in_range("n", self.n, 1.0, 10.0))))
        if self.height is not None and not isinstance(self.height, Relief):
            object.__setattr__(self, "height", HeightMap(np.asarray(self.height, dtype=np.float64)))
        focal_length = self.thin_lens_focal_length
        if focal_length is not None:
            positive("abs(thin_lens_focal_length)", abs(focal_length))

    @property
    def area(self) -> float:
        return float(np.pi * self.aperture_radius**2)

    def index_step(self, wavelength: float) -> float:
        """n(λ) - medium_n."""
        assert isinstance(self.n, RefractiveIndex)
        return self.n.at(wavelength) - self.medium_n

    def path(self, x: Any, y: Any, wavelength: float, source: PointSource, types: Precision) -> Any:
        """Optical path [m] through source and pupil at points (x, y) [m], flat float64 arrays."""
        import drjit as dr

        total = source.path(x, y, types)
        if self.thin_lens_focal_length is not None:
            f = opaque(types, self.thin_lens_focal_length)
            r2 = x * x + y * y
            total -= r2 / (dr.sqrt(r2 + f * f) + dr.abs(f)) * dr.sign(f)
        total *= opaque(types, self.medium_n)
        step = self.index_step(wavelength)
        if isinstance(self.height, Relief) and step != 0:
            scale = opaque(types, 1 / self.aperture_radius)
            total += opaque(types, step) * self.height.height(x * scale, y * scale, types)
        return total

    def slopes(self, wavelength: float, source: PointSource) -> Slopes:
        """Gradient of the optical path over the disk and its soft edge, by central differences."""
        types = precision("float64")
        knots = self.height.knots if isinstance(self.height, Relief) else 1
        n = int(min(1025, max(97, 4 * knots + 1)))
        grid = Grid.square(n, 2 * (1 + EDGE_REACH) * self.aperture_radius / (n - 1))
        x, y = grid.coordinates(types)
        path = self.path(x, y, wavelength, source, types).numpy().reshape(grid.shape)
        along_y, along_x = np.gradient(path, grid.dx)
        return Slopes(grid, along_x, along_y, self.aperture_radius)

    def bandwidth(self, wavelength: float, tolerance: float) -> float:
        """Spatial frequency [1/m] above which the relief changes the phase by less than `tolerance` rad."""
        step = abs(self.index_step(wavelength))
        if not isinstance(self.height, Relief) or step == 0:
            return 0.0
        level = tolerance * wavelength / (2 * np.pi * step)
        return self.height.bandwidth(level) / self.aperture_radius


@dataclass(frozen=True, eq=False)
class Slopes:
    """Gradient of the optical path on a grid that covers the disk and its soft edge."""

    grid: Grid
    along_x: np.ndarray
    along_y: np.ndarray
    radius: float

    @cached_property
    def distance_from_axis(self) -> np.ndarray:
        return np.hypot(self.grid.x[None, :], self.grid.y[:, None])

    @property
    def steepest(self) -> float:
        """Largest slope over the disk and its soft edge."""
        inside = self.distance_from_axis <= (1 + EDGE_REACH) * self.radius
        return float(np.hypot(self.along_x, self.along_y)[inside].max())

    @property
    def steepest_inside(self) -> float:
        """Largest slope over the disk alone."""
        return float(np.hypot(self.along_x, self.along_y)[self.distance_from_axis <= self.radius].max())

    def rays(self, distance: float, medium_n: float) -> tuple[np.ndarray, np.ndarray]:
        """Where rays from the disk's points meet a plane at `distance` [m]; evanescent ones end at infinity."""
        inside = self.distance_from_axis <= self.radius
        px, py = self.along_x[inside] / medium_n, self.along_y[inside] / medium_n
        axial = np.sqrt(np.maximum(1 - px**2 - py**2, 0))
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = (np.where(axial > 0, distance * p / axial, np.inf * np.sign(p)) for p in (px, py))
        here = np.broadcast_to(self.grid.x[None, :], inside.shape)[inside]
        there = np.broadcast_to(self.grid.y[:, None], inside.shape)[inside]
        return here + x, there + y
