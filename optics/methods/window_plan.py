"""Samples of several pupils, chosen for PSFs with coarse tolerances.

A pupil has only as many samples as the light that arrives in the window requires (see `window_edges`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from optics.apertures.aperture import SoftAperture
from optics.elements.light_stack import LightStack
from optics.methods.mirrored_matrix import mirroring_share
from optics.methods.pupil_sampling import MOST_ACROSS
from optics.methods.sine_stack import SineStack
from optics.methods.window_edges import FINER, WindowEdges
from optics.methods.window_geometry import WindowGeometry, window_geometry
from optics.methods.window_rank import Derivatives, WindowRays, window_ranks
from optics.numerics.grid import Grid

__all__ = ["MOST_ENTRIES", "TIGHTEST", "WindowPlan", "plan_costs"]

TIGHTEST = 3e-4  # choice: smallest tolerance at which this way of sampling saves time
STEPS = 8  # choice: numbers of samples per octave; equal ones share arrays
ELSEWHERE = 8  # choice: number of steps between 0 and the largest sine
SHIFT = (math.sqrt(5) - 1) / 2  # choice: shift of the finer samples of the check in pitches, see `window_check`
# Time [s]: per PSF, per sample of the pupil, per entry of the slow factor, and per multiplication.
PER_PSF, PER_SAMPLE, PER_ENTRY, PER_PRODUCT = 4e-4, 1.5e-8, 3e-8, 8.5e-11
MOST_ENTRIES = 4e6  # choice, limited by memory: largest number of entries of the slow factor


@dataclass(frozen=True, eq=False)
class WindowPlan:
    """Samples of several pupils, chosen for computing PSFs over one window by sums over these samples.

    stack: light of the beams, each with its pupil.
    tolerance: tolerances of the PSFs, (beam,).
    derivatives: requested derivatives, which need more samples than the PSFs alone; None if none are requested.
    smoothed: True if strongly curved waves may be convolved with the kernel that softens the edge of the pupil. The
        convolution reduces the number of samples. It is not used with derivatives.
    """

    stack: LightStack
    window: Grid
    tolerance: np.ndarray
    derivatives: Derivatives | None = None
    smoothed: bool = False

    @cached_property
    def geometry(self) -> WindowGeometry:
        """The window and all properties of the beams except reliefs, wavefronts and masks.

        The properties are radii, distances, wavelengths, refractive indices, ideal lenses and sources.
        """
        return window_geometry(self.stack, self.window)

    @cached_property
    def edges(self) -> WindowEdges:
        """Soft edges, and the densities of samples that they need."""
        return WindowEdges(self.stack, self.geometry, self.tolerance, self.derivatives, self.smoothed)

    @cached_property
    def counts(self) -> np.ndarray:
        """Number n of samples of each pupil from its middle to its rim, the same along x and along y, (beam,).

        A pupil has 2n + 1 samples along either axis. The number is 0 for pupils that cannot be sampled in this way,
        because rays are too oblique, or because too many samples or interpolation points would be necessary.
        """
        suitable, across = self._rims[2] & self._finer_rims[2], self._rims[0]
        needed = np.where(suitable, across / self._pitch(self.edges.density), 0)
        within = suitable & (needed < MOST_ACROSS)
        least = np.ceil(np.where(within, needed, 1) - 1e-9)
        # Some densities have steps already.
        stepped = self.edges.stepped | (self.derivatives is not None)
        step = np.where(stepped, 1, np.maximum(1, 2 ** np.floor(np.log2(least / STEPS))))
        found = np.where(within, np.ceil(least / step) * step, 0).astype(int)
        finer = 2 * self.finer_count(found) + 1
        fits = np.maximum(self.ranks * (2 * found + 1), finer) <= math.sqrt(MOST_ENTRIES)
        return np.where(fits & (self.ranks > 0), found, 0)

    @staticmethod
    def finer_count(count: np.ndarray) -> np.ndarray:
        """Return the number n of samples from a pupil's middle to its rim in the finer grid for `window_check`.

        `window_check` compares a PSF with a sum over this grid, which is finer than the grid that the PSF is computed
        from. The finer grid has 2n + 1 samples along either axis.

        count: number of samples from the middle to the rim in the grid of the PSF, see `counts`.
        """
        return np.ceil(FINER * count + SHIFT).astype(int)

    @property
    def ranks(self) -> np.ndarray:
        """Number of interpolation points of the slow factor along each axis of the window, (beam,).

        The slow factor is the quotient of the diffraction kernel and a Fourier kernel. The number is 0 if more than
        MOST_RANK points would be necessary.
        """
        return self._ranks[0]

    @property
    def crossed(self) -> np.ndarray:
        """True for beams whose slow factor is approximated with `cross_term` instead of interpolation, (beam,).

        The slow factor is the quotient of the diffraction kernel and a Fourier kernel. It is approximated by the
        product of its values on the x and y axes of the window, times a correction from `cross_term`.
        """
        return self._ranks[1]

    @cached_property
    def _rays(self) -> WindowRays:
        return WindowRays.from_slopes(self.stack.slopes, self.geometry)

    @cached_property
    def elsewhere(self) -> np.ndarray:
        """A typical sine of the points of each pupil, (beam,).

        The sines of a point are the x and y components of the unit vector from the middle of the window to the point,
        minus those of the unit vector to the pupil's centre. The diffraction kernel along x is computed for points with
        the typical sine along y, and the kernel along y for points with this sine along x (see `SineGeometry`).

        The typical sine is `WindowRays.mean_sine`, rounded to a multiple of a step, so that similar PSFs can share
        arrays. The step is 1/ELSEWHERE of the sine of the largest angle between the axis and a line from the middle of
        the window to the outer end of the pupil's soft edge.
        """
        step = np.minimum(self._rims[1], 1.0) / ELSEWHERE
        return np.asarray(np.rint(self._rays.mean_sine / step) * step)

    @cached_property
    def _ranks(self) -> tuple[np.ndarray, np.ndarray]:
        steepest = np.minimum(self._rims[1], 1 - 1e-9)  # finite points, also for pupils without a rank
        factor = self.geometry.ray_factor(self.stack.slopes.across, steepest, self.elsewhere)
        return window_ranks(self.geometry, factor, self._rays, self.tolerance, self.derivatives)

    def samples(self, places: np.ndarray) -> tuple[SineStack, SineStack]:
        """Return the samples of the pupils of chosen beams, and finer samples of the same pupils.

        `window_check` estimates the errors of the PSFs from sums over the finer samples.

        places: indices of the chosen beams. All these beams must have the same number of samples (`counts`).
        """
        count = int(self.counts[places[0]])
        sets = (count, 0.0, self._rims, self.edges.edges), (
            int(self.finer_count(np.array(count))), SHIFT, self._finer_rims, self.edges.finer_edges,
        )  # fmt: skip
        found = []
        for many, shift, (half, steepest, _), edges in sets:
            at = (half[places] / (many - shift))[:, None] * (np.arange(-many, many + 1) + shift)
            geometry = self.stack.distance[places], self.window.centre, steepest[places], self.elsewhere[places]
            own = tuple(edges[k] for k in places), self.stack.radius[places], self.edges.curvature[places]
            found.append(SineStack(*geometry, at, *own))
        return found[0], found[1]

    @cached_property
    def seconds(self) -> np.ndarray:
        """Predicted time [s] for computing the PSF of each beam alone, (beam,)."""
        return self._costs[0]

    @cached_property
    def bytes(self) -> np.ndarray:
        """Predicted memory [bytes] for computing the PSF of each beam alone, (beam,)."""
        return self._costs[1]

    @cached_property
    def _costs(self) -> tuple[np.ndarray, np.ndarray]:
        across, finer = 2 * self.counts + 1, 2 * self.finer_count(self.counts) + 1
        return plan_costs(self.window, self.ranks, across, finer, self.crossed)

    def _pitch(self, density: np.ndarray) -> np.ndarray:
        """Return the largest spacing at which a pupil has at least `density` samples per radius everywhere, (beam,).

        The sines of a point of the pupil are the x and y components of the unit vector from the middle of the window to
        the point. Samples are evenly spaced in their sines, and the result is a difference of sines. The distance of
        two points is at most z/cos³θ times the difference of their sines. z is the distance of the window, and θ the
        angle of the steepest ray.
        """
        steepest = np.minimum(self._rims[1], 1 - 1e-12)
        found: np.ndarray = self.stack.radius * (1 - np.square(steepest)) ** 1.5 / (self.stack.distance * density)
        return found

    @cached_property
    def _rims(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self._sines(self.edges.edges)

    @cached_property
    def _finer_rims(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self._sines(self.edges.finer_edges)

    def _sines(self, edges: list[SoftAperture]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.geometry.rims(np.array([edge.reach for edge in edges]))


def plan_costs(window: Grid, rank: Any, across: Any, finer: Any, crossed: Any = False) -> tuple[Any, Any]:
    """Return the predicted time [s] and memory [bytes] of a PSF; the arguments are numbers or arrays (beam,).

    rank: number of interpolation points along each axis of the window, from which the slow factor is interpolated. The
        slow factor is the factor by which the diffraction kernel differs from a Fourier kernel.
    across: number of samples along an axis of the pupil.
    finer: number of samples along an axis of a second, finer grid, with which `window_check` estimates the PSF's error.
    crossed: True if the slow factor is not interpolated, but computed by an approximate formula (`cross_term`). The
        formula takes a second sum over the pupil.
    """
    (height, width), inner = window.shape, rank * across
    products = (inner * inner * width + height * inner * width) * np.where(crossed, 2, 1)
    products = products * mirroring_share(window, inner)
    samples = across**2 + finer**2
    entries = np.where(rank == 1, 0, inner * inner)
    seconds = PER_PSF + samples * PER_SAMPLE + entries * PER_ENTRY + products * PER_PRODUCT
    return seconds, 16 * (4 * inner * inner + inner * (height + 2 * width) + samples)
