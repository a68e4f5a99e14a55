"""Concentric rings, such as zone plates."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt
from typing import Any

import numpy as np

from optics.apertures.aperture import Aperture, Nodes, SoftAperture
from optics.apertures.circular import disk_table, ring_nodes
from optics.apertures.outline import Outline
from optics.apertures.soft_edge import SoftEdge
from optics.numerics.arguments import flag, positive, reals, shown, vacuum_wavelength
from optics.numerics.autodiff import Array
from optics.numerics.cost import SOFT_EDGE_SAMPLE
from optics.numerics.precision import Precision

__all__ = ["Rings"]

MOST = 500  # choice: largest number of radii


@dataclass(frozen=True, eq=False)
class Rings(Aperture):
    """Concentric open rings: from the first radius to the second, from the third to the fourth, and so on.

    radii: an even number of radii in ascending order, in pupil radii. They lie in [0, 1]; a first radius of 0 means an
        open centre.

    Raises:
        ValueError: the radii do not ascend, their number is odd, 0 or above 500, or a radius is not a number in [0, 1].
    """

    radii: Any

    def __post_init__(self) -> None:
        radii = np.array(reals("radii", self.radii))
        if radii.ndim != 1 or radii.size % 2 or not 2 <= radii.size <= MOST:
            raise ValueError(f"radii has shape {radii.shape}: must be an even number of radii, 2 to {MOST}")
        if not (np.diff(radii, prepend=0.0)[1:] > 0).all() or not (radii[0] >= 0 and radii[-1] <= 1):
            raise ValueError(f"radii = {shown(self.radii)}: must ascend within [0, 1]")
        radii.flags.writeable = False
        object.__setattr__(self, "radii", radii)

    @classmethod
    def zone_plate(
        cls, aperture_radius: float, focal_length: float, wavelength: float = 550e-9, open_centre: bool = True
    ) -> Rings:
        """Return a zone plate: every second Fresnel zone for a focal length and a wavelength. All lengths are in m.

        If parallel light falls on the pupil, the light from all open zones arrives in phase at the focus, one focal
        length behind the pupil. Zone n ends at the radius √(nλf + n²λ²/4), for the focal length f and the wavelength λ
        (Fresnel). A tenth of the incident light, 1/π², reaches this focus.

        wavelength: wavelength behind the pupil, equal to the vacuum wavelength divided by `Pupil.medium_n`.
        open_centre: True if the central zone is open, False if its neighbour is.

        Raises:
            ValueError: a length is not positive, open_centre is not a bool, or the number of zones is outside 2 to 500.
        """
        radius = positive("aperture_radius", aperture_radius)
        focal = positive("focal_length", focal_length)
        half = vacuum_wavelength(wavelength) / 2
        zones = (sqrt(focal**2 + radius**2) - focal) / half
        if not 2 <= zones <= MOST:
            raise ValueError(
                f"{zones:.3g} zones between a radius of {radius:g} m and a focal length of {focal:g} m: must be 2 to "
                f"{MOST}"
            )
        n = np.arange(int(zones * (1 + 1e-12)) + 1)
        ends = np.sqrt(n * half * (2 * focal + n * half)) / radius
        ends = np.minimum(np.append(ends[ends < 1 - 1e-9], 1.0), 1.0)
        ends = ends if flag("open_centre", open_centre) else ends[1:]
        return cls(ends[: len(ends) // 2 * 2])

    @property
    def rings(self) -> tuple[tuple[float, float], ...]:
        return tuple((float(inner), float(outer)) for inner, outer in self.radii.reshape(-1, 2))

    @property
    def area(self) -> float:
        return pi * sum(outer**2 - inner**2 for inner, outer in self.rings)

    @property
    def rotationally_symmetric(self) -> bool:
        return True

    @property
    def half_widths(self) -> tuple[float, float]:
        return float(self.radii[-1]), float(self.radii[-1])

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        r = np.hypot(reals("x", x), reals("y", y))
        return np.asarray(np.searchsorted(self.radii, r) % 2 == 1) | ((r == 0) & bool(self.radii[0] == 0))

    @property
    def outline(self) -> Outline:
        return Outline.circles(tuple(radius for radius in self.radii if radius > 0))

    def _nodes(self, cycles: float, digits: float) -> Nodes:
        parts = [ring_nodes(inner, outer, cycles, digits) for inner, outer in self.rings]
        return Nodes(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("x", "y", "weight")))

    def _softened(self, edge: SoftEdge) -> SoftAperture:
        return SoftRings(edge, self.radii)


@dataclass(frozen=True, eq=False)
class SoftRings(SoftAperture):
    """Rings with soft edges, computed as sums and differences of soft disks."""

    edge: SoftEdge
    radii: np.ndarray

    @property
    def seconds_per_point(self) -> float:
        return len(self.radii) * SOFT_EDGE_SAMPLE

    def transmittance(self, x: Array, y: Array, types: Precision) -> Array:
        import drjit as dr

        distance, total = dr.sqrt(x * x + y * y + 1e-40), dr.zeros(types.Float64, dr.width(x))
        for index, radius in enumerate(self.radii):
            if radius > 0:
                disk = disk_table(self.edge, float(radius)).at(distance, types)
                total = total + disk if index % 2 else total - disk
        return total
