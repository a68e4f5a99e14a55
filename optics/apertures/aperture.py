"""Interface of all apertures: shape, soft edge for samples on a grid, and quadrature nodes fitted to the edge.

The spectrum of a hard edge has no band limit. If a hard edge is sampled on a Cartesian grid with N samples along an
axis, the error of sums over the samples falls only like N⁻¹ to N⁻¹·⁵. The aperture is therefore convolved with a
low-pass kernel of compact support (optics.apertures.soft_edge). Sums over samples (the trapezoid rule) then converge as
fast as the kernel's side lobes fall. The softened transmittance is 1 or 0 except within `reach` of the edge.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from optics.apertures.outline import Outline
from optics.apertures.soft_edge import SoftEdge
from optics.numerics.arguments import in_range, positive
from optics.numerics.autodiff import Array
from optics.numerics.cost import SOFT_EDGE_SAMPLE
from optics.numerics.precision import Precision, padded_for_packets

__all__ = ["EDGE_REACH", "LEAST_RIPPLE", "Aperture", "Nodes", "SoftAperture"]

# Choice: the largest reach of the soft edge beyond the aperture, in radii.
EDGE_REACH = 0.25
LEAST_RIPPLE = 1e-13  # choice: smallest ripple of a soft edge's spectrum; it is above the rounding errors of float64
MOST_CYCLES = 1e90  # far above any realistic value, so that the planner, and not this check, refuses a pupil


class SoftAperture(ABC):
    """An aperture with a soft edge, for samples on a grid.

    Lengths are in units of the pupil's radius R, and frequencies in cycles per R.

    The spectrum equals that of the hard aperture up to the frequency `passband` and is 0 beyond `stopband`, in both
    cases to within `ripple`. At distances above `reach` from the edge, the transmittance is 1 or 0.
    """

    rotationally_symmetric: ClassVar[bool] = False
    edge: SoftEdge

    @property
    def passband(self) -> float:
        return self.edge.passband

    @property
    def stopband(self) -> float:
        return self.edge.stopband

    @property
    def ripple(self) -> float:
        return self.edge.ripple

    @property
    def reach(self) -> float:
        return self.edge.reach

    @property
    def seconds_per_point(self) -> float:
        """Approximate cost [s] of `transmittance` for one point."""
        return SOFT_EDGE_SAMPLE

    @abstractmethod
    def transmittance(self, x: Array, y: Array, types: Precision) -> Array:
        """Return the transmittance at points (x, y), which are flat Dr.Jit Float64 arrays.

        It is differentiable in x and y.
        """


@dataclass(frozen=True, eq=False)
class Nodes:
    """Quadrature nodes over an aperture, as flat float64 arrays for Dr.Jit.

    x, y: positions [pupil radii].
    weight: weights [squared pupil radii].
    """

    x: np.ndarray
    y: np.ndarray
    weight: np.ndarray

    def __post_init__(self) -> None:
        for name in ("x", "y", "weight"):
            object.__setattr__(self, name, padded_for_packets(getattr(self, name)))

    def __len__(self) -> int:
        return len(self.weight)


class Aperture(ABC):
    """An opening in an opaque screen, within the unit circle. Lengths are in units of the pupil's radius R."""

    @property
    @abstractmethod
    def area(self) -> float:
        """Area in squared pupil radii."""

    @property
    @abstractmethod
    def rotationally_symmetric(self) -> bool:
        """True if the aperture is known to be invariant under every rotation about the axis."""

    @property
    def mirror_symmetric(self) -> bool:
        """True if the aperture is known to be invariant under mirroring of x and of y."""
        return self.rotationally_symmetric

    @property
    def rings(self) -> tuple[tuple[float, float], ...]:
        """Inner and outer radii of the open rings, in pupil radii. Only valid for rotationally symmetric apertures."""
        return ((0.0, 1.0),)

    @property
    @abstractmethod
    def half_widths(self) -> tuple[float, float]:
        """Half the width and half the height of the smallest centred rectangle that contains the aperture."""

    @property
    @abstractmethod
    def outline(self) -> Outline:
        """Edge of the aperture."""

    @abstractmethod
    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return a mask of the points that lie within the aperture. Points on the edge may belong to either side.

        x, y: positions in pupil radii, in arrays whose shapes broadcast.

        Raises:
            ValueError: a position is not a real number.
        """

    def nodes(self, cycles: float, digits: float) -> Nodes:
        """Return quadrature nodes for integrands with spatial frequencies up to `cycles` cycles per pupil radius.

        For integrands of at most 1, sums over the nodes have an error of at most 10^-digits times the area.

        The limit `cycles` applies to the local frequency of the integrand at every point and in every direction. If the
        amplitude of the integrand varies, the frequencies of this variation count as well.

        Raises:
            ValueError: cycles is outside [0, 1e5], or digits is outside [0, 16].
        """
        return self._nodes(in_range("cycles", cycles, 0.0, 1e5), in_range("digits", digits, 0.0, 16.0))

    def node_count(self, cycles: float, digits: float) -> int | None:
        """Return the number of `nodes`, or None if it is unknown until they are computed."""
        return None

    def soften(self, passband: float, ripple: float, widest_reach: float = EDGE_REACH) -> SoftAperture:
        """Return the aperture after a low-pass filter.

        The filter leaves frequencies up to `passband` [cycles per pupil radius] unchanged, to within `ripple`. The soft
        edge extends at most `widest_reach` [pupil radii] beyond the aperture. Within this limit, the
        width of the filter's transition from pass band to stop band is chosen so that the soft aperture needs the
        fewest samples.

        Raises:
            ValueError: passband is outside [0, 1e90], ripple is outside [1e-13, 0.5], or widest_reach is not positive.
        """
        in_range("passband", passband, 0.0, MOST_CYCLES)
        in_range("ripple", ripple, LEAST_RIPPLE, 0.5)
        positive("widest_reach", widest_reach, "pupil radii")
        return self._softened(SoftEdge.cheapest(passband, ripple, widest_reach, self.half_widths))

    def with_edge(self, passband: float, stopband: float, ripple: float) -> SoftAperture:
        """Return the aperture after a low-pass filter with a given transition band [cycles per pupil radius].

        Frequencies below `passband` stay unchanged and those above `stopband` vanish, to within `ripple`. The method
        `soften` is given no stopband: it chooses the one that needs the fewest samples.
        """
        return _with_edge(self, SoftEdge(passband, stopband, ripple))

    @abstractmethod
    def _nodes(self, cycles: float, digits: float) -> Nodes:
        """Return quadrature nodes that are fitted to the edge."""

    @abstractmethod
    def _softened(self, edge: SoftEdge) -> SoftAperture:
        """Return the aperture convolved with the edge's kernel."""


@lru_cache(maxsize=64)
def _with_edge(aperture: Aperture, edge: SoftEdge) -> SoftAperture:
    return aperture._softened(edge)
