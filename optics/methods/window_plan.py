"""Samples of several pupils at coarse tolerances: as few as the light in the window needs.

Samples at the pitch Δs, in sines, repeat the light of the window with the period λ/Δs. The period must be half the
width of the window, plus the distance from the middle within which nearly all light arrives. The light that is
diffracted at the edge of the pupil spreads further. A soft edge keeps it out of the window. The softer edge only
changes light far from the geometrical rays of the edge, where there is little light.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from optics.apertures.aperture import EDGE_REACH, SoftAperture
from optics.apertures.soft_edge import SoftEdge
from optics.elements.light_stack import LightStack
from optics.elements.wavefront import Zernike
from optics.methods.pupil_sampling import MOST_ACROSS
from optics.methods.sine_stack import SineGeometry, SineStack, rim_sines
from optics.methods.window_rank import Derivatives, WindowRays, window_ranks
from optics.numerics.grid import Grid

__all__ = ["TIGHTEST", "WindowPlan"]

TIGHTEST = 3e-4  # choice: smallest tolerance at which this way of sampling saves time
# Choices for the soft edge: ripple of its spectrum, of the samples and of the finer samples of the check.
RIPPLES, RIPPLE_EXPONENT = (0.015, 0.004), 0.5
# Choices for the passband of the soft edge, in cycles per radius: margin at a tolerance of 0.01, exponent of the
# tolerance, and the largest passband of the check, relative to that of the samples.
EDGE_CYCLES, EXPONENT, SHARPER = 3.0, -0.6, 2.0
NEGLECTED = 3e-4  # choice: light that is neglected, as a share of all light, at a tolerance of 0.01
# Choices: cycles around the middle of the window up to which light from the edge matters, and cycles by which
# diffraction spreads the light of a ray.
NEAR_CYCLES, SPREAD_CYCLES = 6.5, 2.0
# Choices: distance from the axis [radii] beyond which rays count as rays of the edge, and cycles of most of these rays,
# relative to their median.
RIM, RIM_CYCLES = 0.85, 1.2
# Choices for PSFs that carry derivatives, to which points near the edge contribute as much as others. The soft edge is
# then narrow: ripples as above, passband relative to the stopband; cycles per radius at a tolerance of 0.01, the same
# relative to those of the rays at the edge, exponent of the tolerance, and cycles per cell between knots.
CARRIED_RIPPLES, CARRIED_PASSBAND = (0.03, 0.0075), 0.35
CARRIED_CYCLES, CARRIED_RIM_CYCLES, CARRIED_EXPONENT, CELL_CYCLES = 7.6, 5.7, -0.4, 0.375
# Choices: numbers of samples and sharpnesses of the edge per octave; equal ones share arrays and tables.
STEPS, EDGES = 8, 4
ELSEWHERE = 8  # choice: number of steps between 0 and the largest sine
FINER, SHIFT = 2.0 ** (1 / 3), (math.sqrt(5) - 1) / 2  # choices for the finer samples of the check, see `window_check`
# Time [s]: per PSF, per sample of the pupil, per entry of the slow factor, and per multiplication.
PER_PSF, PER_SAMPLE, PER_ENTRY, PER_PRODUCT = 4e-4, 1.5e-8, 3e-8, 1.5e-10
MOST_ENTRIES = 4e6  # choice, limited by memory: largest number of entries of the slow factor


@dataclass(frozen=True, eq=False)
class WindowPlan:
    """Samples of several pupils for one window.

    tolerance: tolerances of the PSFs, (beam,).
    derivatives: needs of derivatives; None if none are requested.
    """

    stack: LightStack
    window: Grid
    tolerance: np.ndarray
    derivatives: Derivatives | None = None

    @property
    def half(self) -> float:
        """Distance [m] from the middle of the window within which interpolation points lie."""
        return max(self.window.own_half_width, self.window.dx)

    @cached_property
    def counts(self) -> np.ndarray:
        """Numbers n of samples between the middle and either end, (beam,); 0 if the method is not suitable.

        A pupil has 2n + 1 samples along either axis.
        """
        suitable, across = self._rims[2] & self._finer_rims[2], self._rims[0]
        needed = np.where(suitable, across / self._pitch(self._density), 0)
        within = suitable & (needed < MOST_ACROSS)
        least = np.ceil(np.where(within, needed, 1) - 1e-9)
        step = np.maximum(1, 2 ** np.floor(np.log2(least / STEPS)))
        found = np.where(within, np.ceil(least / step) * step, 0).astype(int)
        finer = 2 * self.finer_count(found) + 1
        fits = np.maximum(self.ranks * (2 * found + 1), finer) <= math.sqrt(MOST_ENTRIES)
        return np.where(fits & (self.ranks > 0), found, 0)

    @staticmethod
    def finer_count(count: np.ndarray) -> np.ndarray:
        """Return the number of samples of the check between the middle and an end."""
        return np.ceil(FINER * count + SHIFT).astype(int)

    @property
    def ranks(self) -> np.ndarray:
        """Ranks of the slow factor over the window, (beam,); 0 if the method is not suitable."""
        return self._ranks[0]

    @property
    def crossed(self) -> np.ndarray:
        """Whether the sums include `cross_term`, (beam,)."""
        return self._ranks[1]

    @cached_property
    def _rays(self) -> WindowRays:
        return WindowRays.from_stack(self.stack, self.window)

    @cached_property
    def _elsewhere(self) -> np.ndarray:
        """Sines for `SineGeometry`, in steps of a share of the largest sine, so that PSFs can share arrays, (beam,)."""
        step = np.minimum(self._rims[1], 1.0) / ELSEWHERE
        return np.asarray(np.rint(self._rays.mean_sine / step) * step)

    @cached_property
    def _ranks(self) -> tuple[np.ndarray, np.ndarray]:
        steepest = np.minimum(self._rims[1], 1.0)
        geometry = SineGeometry(self.stack.distance, self.window.centre, steepest, self._elsewhere)
        return window_ranks(self.stack, geometry, self._rays, self.window, self.tolerance, self.derivatives)

    def samples(self, places: np.ndarray) -> tuple[SineStack, SineStack]:
        """Return the samples of some pupils, which have the same count, and the finer samples of the check.

        places: indices of the beams.
        """
        count = int(self.counts[places[0]])
        sets = (count, 0.0, self._rims, self._edges), (
            int(self.finer_count(np.array(count))), SHIFT, self._finer_rims, self._finer_edges,
        )  # fmt: skip
        found = []
        for many, shift, (half, steepest, _), edges in sets:
            at = (half[places] / (many - shift))[:, None] * (np.arange(-many, many + 1) + shift)
            geometry = self.stack.distance[places], self.window.centre, steepest[places], self._elsewhere[places]
            found.append(SineStack(*geometry, at, tuple(edges[k] for k in places), self.stack.radius[places]))
        return found[0], found[1]

    @cached_property
    def seconds(self) -> np.ndarray:
        """Predicted times of single PSFs [s], (beam,)."""
        return self._costs[0]

    @cached_property
    def bytes(self) -> np.ndarray:
        """Predicted memory of single PSFs, (beam,)."""
        return self._costs[1]

    @cached_property
    def _costs(self) -> tuple[np.ndarray, np.ndarray]:
        across, (height, width) = 2 * self.counts + 1, self.window.shape
        inner = self.ranks * across
        products = (inner * inner * width + height * inner * width) * np.where(self.crossed, 2, 1)
        samples = across**2 + (2 * self.finer_count(self.counts) + 1) ** 2
        entries = np.where(self.ranks == 1, 0, inner * inner)
        seconds = PER_PSF + samples * PER_SAMPLE + entries * PER_ENTRY + products * PER_PRODUCT
        return seconds, 16 * (4 * inner * inner + inner * (height + 2 * width) + samples)

    @cached_property
    def _window_cycles(self) -> np.ndarray:
        """Cycles per radius of the Fourier kernel at the sides of the window."""
        stack = self.stack
        found: np.ndarray = self.half * stack.radius / (stack.wavelength * stack.distance)
        return found

    @property
    def _near_cycles(self) -> np.ndarray:
        """The same in the part of the window where light from the edge is bright enough to matter."""
        return np.minimum(self._window_cycles, NEAR_CYCLES)

    @cached_property
    def _density(self) -> np.ndarray:
        """Numbers of samples per radius, which are also the numbers of cycles per radius that they resolve."""
        stack, along = self.stack, self._to_middle
        share = NEGLECTED * np.minimum(self.tolerance / 0.01, 1.0) ** 2
        last = np.maximum(0, np.ceil(along.shape[1] * (1 - share)).astype(int) - 1)
        reach = np.take_along_axis(np.sort(along, axis=1), last[:, None], axis=1)[:, 0]
        masks = [
            0.0 if beam.pupil.mask is None else beam.pupil.mask.bandwidth(min(tolerance, 0.1), radius) * radius
            for beam, radius, tolerance in zip(stack.beams, stack.radius, self.tolerance, strict=True)
        ]
        direct = self._window_cycles + reach
        if self.derivatives is not None:
            # High modes grow outside the circle, so that their derivatives need a sharper edge.
            fronts = [beam.pupil.wavefront for beam in stack.beams]
            orders = np.array([front.order if isinstance(front, Zernike) else 0 for front in fronts])
            rim = self._rim / RIM_CYCLES
            sharp = CARRIED_CYCLES + CARRIED_RIM_CYCLES * rim + orders + self.derivatives.cells * CELL_CYCLES
            widest = _transition(CARRIED_RIPPLES[1]) / (1 - CARRIED_PASSBAND) * 2.0 ** (1 / EDGES)
            sharp = sharp * (self.tolerance / 0.01) ** CARRIED_EXPONENT
            return np.asarray(np.maximum(direct + sharp + masks, widest + self._window_cycles / 2))
        edges = self._near_cycles + self._rim + self._passband + _transitions(self._ripples[0])
        return np.asarray(masks + np.maximum(direct + SPREAD_CYCLES, edges))

    @cached_property
    def _to_middle(self) -> np.ndarray:
        """Cycles per radius of the paths to the middle of the window, along x or y, (beam, point)."""
        stack, slopes, window = self.stack, self.stack.slopes, self.window
        radius, index, distance = (part[:, None] for part in (stack.radius, stack.index, stack.distance))
        x, y = radius * slopes.x - window.centre[0], radius * slopes.y - window.centre[1]
        scale = index / np.sqrt(x * x + y * y + distance * distance)
        along = np.maximum(np.abs(slopes.along_x + x * scale), np.abs(slopes.along_y + y * scale))
        found: np.ndarray = along * (stack.radius / stack.vacuum_wavelength)[:, None]
        return found

    @cached_property
    def _rim(self) -> np.ndarray:
        """Cycles per radius of most rays at the edge, (beam,)."""
        slopes = self.stack.slopes
        found: np.ndarray = np.median(self._to_middle[:, np.hypot(slopes.x, slopes.y) > RIM], axis=1)
        return RIM_CYCLES * found

    @cached_property
    def _passband(self) -> np.ndarray:
        """Cycles per radius that the soft edge leaves unchanged, (beam,)."""
        found: np.ndarray = self._rim + self._near_cycles + EDGE_CYCLES * (self.tolerance / 0.01) ** EXPONENT
        return found

    def _pitch(self, density: np.ndarray) -> np.ndarray:
        """Return the largest spacing of sines at which a pupil has `density` samples per radius everywhere.

        The distance of two points in the pupil is at most z/cos³θ times the distance of their sines.
        """
        steepest = np.minimum(self._rims[1], 1 - 1e-12)
        found: np.ndarray = self.stack.radius * (1 - np.square(steepest)) ** 1.5 / (self.stack.distance * density)
        return found

    @cached_property
    def _ripples(self) -> tuple[np.ndarray, np.ndarray]:
        """Ripples of the soft edges of the samples and of the finer samples, which fall in steps, (beam,)."""
        share = np.minimum(2.0 ** np.floor(np.log2(self.tolerance / 0.01)), 1.0) ** RIPPLE_EXPONENT
        return RIPPLES[0] * share, RIPPLES[1] * share

    @cached_property
    def _edges(self) -> list[SoftAperture]:
        if self.derivatives is not None:
            return self._narrow(self._density, CARRIED_RIPPLES[0])
        return self._wide(self._passband, self._ripples[0])

    @cached_property
    def _finer_edges(self) -> list[SoftAperture]:
        """Soft apertures that are as sharp as the finer samples allow."""
        if self.derivatives is not None:
            return self._narrow(FINER * self._density, CARRIED_RIPPLES[1])
        stopband = FINER * self._density - self._near_cycles - self._rim
        passband = np.maximum(stopband - _transitions(self._ripples[1]), self._passband)
        return self._wide(np.minimum(passband, SHARPER * self._passband), self._ripples[1])

    def _wide(self, passband: np.ndarray, ripples: np.ndarray) -> list[SoftAperture]:
        """Return soft apertures that leave frequencies up to `passband` unchanged, and are as wide as possible."""
        passband = 2.0 ** (np.ceil(EDGES * np.log2(passband) - 1e-9) / EDGES)
        return self._soft(passband, passband + _transitions(ripples), ripples)

    def _narrow(self, density: np.ndarray, ripple: float) -> list[SoftAperture]:
        """Return soft apertures that are as narrow as a density of samples allows."""
        stopband = np.maximum(density - self._window_cycles / 2, density / 2)
        stopband = 2.0 ** (np.floor(EDGES * np.log2(stopband)) / EDGES)
        return self._soft(CARRIED_PASSBAND * stopband, stopband, np.full(len(stopband), ripple))

    def _soft(self, passband: np.ndarray, stopband: np.ndarray, ripples: np.ndarray) -> list[SoftAperture]:
        columns = (part.tolist() for part in (passband, stopband, ripples))
        beams = zip(self.stack.beams, *columns, strict=True)
        return [beam.pupil.aperture.with_edge(*edge) for beam, *edge in beams]

    @cached_property
    def _rims(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self._sines(self._edges)

    @cached_property
    def _finer_rims(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self._sines(self._finer_edges)

    def _sines(self, edges: list[SoftAperture]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        outermost = (1 + np.array([edge.reach for edge in edges])) * self.stack.radius
        return rim_sines(outermost, self.window.centre, self.stack.distance)


def _transitions(ripples: np.ndarray) -> np.ndarray:
    """Return the smallest widths of the transition from passband to stopband, in cycles per radius.

    The soft edge must not extend beyond EDGE_REACH, and its width is inversely proportional to this one.
    """
    return np.array([_transition(ripple) for ripple in ripples.tolist()])


@lru_cache(maxsize=64)
def _transition(ripple: float) -> float:
    return SoftEdge(0.0, 1.0, ripple).reach / EDGE_REACH
