"""Soft edges of several pupils at coarse tolerances, and the numbers of samples that pupils with these edges need.

Samples are evenly spaced in sines, the x and y components of the unit vector from the window's centre to a sample. If
the spacing is Δs, the computed light repeats in the window's plane with the period λ/Δs. Nearly all light arrives in a
circle around the middle of the window. The period must be at least the radius of this circle plus half the width of the
window. Light diffracted at the edge of the pupil spreads further. A soft edge keeps it out of the window. Softening
changes light only far from the places where geometrical rays through the edge arrive. Little light is so far away.

The edge is softened by convolution with a kernel. For a disk or a ring, a strongly curved wave can be convolved with
this kernel, too (`curved_disk`), if most of its light misses the window. This removes light far from the window. The
number of samples is then almost independent of the directions of the rays at the edge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial

import numpy as np

from optics.apertures.aperture import EDGE_REACH, SoftAperture
from optics.apertures.circular import Annulus, Circle
from optics.apertures.soft_edge import SoftEdge
from optics.elements.light_stack import LightStack, StackSlopes
from optics.elements.wavefront import Zernike
from optics.methods.window_bands import EDGES, Bands, in_steps, medians
from optics.methods.window_geometry import WindowGeometry
from optics.methods.window_rank import Derivatives

__all__ = ["FINER", "WindowEdges"]

# Choices for the soft edge: ripple of its spectrum, of the samples and of the finer samples of the check.
RIPPLES, RIPPLE_EXPONENT = (0.015, 0.004), 0.5
# Choices for the passband of the soft edge, in cycles per radius: margin at a tolerance of 0.01, exponent of the
# tolerance, and the largest passband of the check, relative to that of the samples.
EDGE_CYCLES, EXPONENT, SHARPER = 3.0, -0.6, 2.0
NEGLECTED = 3e-4  # choice: light that is neglected, as a share of all light, at a tolerance of 0.01
# Choices: cycles around the middle of the window up to which light from the edge matters, and cycles by which
# diffraction spreads the light of a ray.
NEAR_CYCLES, SPREAD_CYCLES = 6.5, 2.0
# Choices: the same spread for light behind maps, whose fine detail diffracts light away from its rays. Cycles at a
# tolerance of 0.01, the same relative to those of the rays at the edge, and exponent of the tolerance.
MAPPED_CYCLES, MAPPED_RIM_CYCLES, MAPPED_EXPONENT = 4.0, 3.0, -0.4
RIM_CYCLES = 1.2  # choice: cycles of most of the rays of the edge, relative to their median
# Choices for polynomials of high order: share of the points on the rim whose rays may be steeper than assumed, at a
# tolerance of 0.01, and exponent of the tolerance.
RIM_MISSED, MISSED_EXPONENT = 0.1, 0.6
# Choices for PSFs that carry derivatives, to which points near the edge contribute as much as others. The soft edge is
# then narrow: ripples as above, passband relative to the stopband; cycles per radius at a tolerance of 0.01, the same
# relative to those of the rays at the edge, exponent of the tolerance, and cycles per cell between knots.
CARRIED_RIPPLES, CARRIED_PASSBAND = (0.03, 0.002), 0.35
CARRIED_CYCLES, CARRIED_RIM_CYCLES, CARRIED_EXPONENT, CELL_CYCLES = 7.6, 5.7, -0.4, 0.375
CARRIED_STEPS = 6  # choice: densities of such samples per octave; equal ones share all arrays
SMOOTHED_RIPPLE = 0.1  # choice: ripple for smoothed waves, whose brightest light it affects, relative to others
# Choices: step of the curvature in cycles per radius, so that pupils share tables, and the least useful curvature.
CURVATURE_STEP, LEAST_CURVATURE = 1.0, 3.0
WORTH = 0.9  # choice: ratio of numbers of samples along an axis below which a smoothed wave saves time
FINER = 2.0 ** (1 / 3)  # choice: density of the finer samples of the check, relative to that of the samples


@dataclass(frozen=True, eq=False)
class WindowEdges:
    """Soft edges of several pupils for one window.

    tolerance: tolerances of the PSFs, (beam,).
    derivatives: requested derivatives, which need narrower edges and more samples, or None.
    smoothed: True if strongly curved light may be convolved with the kernel of the edge. No effect with `derivatives`.
    """

    stack: LightStack
    geometry: WindowGeometry
    tolerance: np.ndarray
    derivatives: Derivatives | None = None
    smoothed: bool = False

    @cached_property
    def curvature(self) -> np.ndarray:
        """Curvature of each beam whose light is convolved with the kernel of the soft edge, 0 for others, (beam,).

        The curvature is the spatial frequency of the light at the rim in cycles per radius.
        """
        return self._choice[0]

    @property
    def density(self) -> np.ndarray:
        """Numbers of samples per radius, (beam,). They are also the period of the spectrum in cycles per radius."""
        return self._choice[1].density

    @property
    def stepped(self) -> np.ndarray:
        """True for beams whose numbers of samples per radius are rounded up by `in_steps` to a few values, (beam,)."""
        return self.stack.mapped | (self.stack.rim_slopes is not None)

    @cached_property
    def edges(self) -> list[SoftAperture]:
        """Aperture of each pupil with a soft edge, used to compute the samples of the pupil, (beam,)."""
        wide = partial(self._wide, self._choice[1].passband, self._ripples(self.curvature)[0])
        return self._unless_mapped(wide, partial(self._narrow, self.density, CARRIED_RIPPLES[0]))

    @cached_property
    def finer_edges(self) -> list[SoftAperture]:
        """Apertures whose edges are sharper than in `edges`, for the finer samples used to check the PSFs, (beam,)."""
        return self._unless_mapped(self._finer_wide, partial(self._narrow, FINER * self.density, CARRIED_RIPPLES[1]))

    def _finer_wide(self) -> list[SoftAperture]:
        bands, ripple = self._choice[1], self._ripples(self.curvature)[1]
        passband = np.maximum(FINER * self.density - bands.around - _transitions(ripple), bands.passband)
        return self._wide(np.minimum(passband, SHARPER * bands.passband), ripple)

    def _unless_mapped(
        self, wide: Callable[[], list[SoftAperture]], narrow: Callable[[], list[SoftAperture]]
    ) -> list[SoftAperture]:
        """Return a soft aperture for each beam, with a narrow or a wide edge.

        The edge is narrow if derivatives are requested, or if a relief or wavefront is a map, whose fine detail sends
        light from the edge in all directions. The functions `wide` and `narrow` compute the apertures of all beams.
        """
        mapped = self.stack.mapped
        if self.derivatives is not None or mapped.all():
            return narrow()
        if not mapped.any():
            return wide()
        return [one if is_map else other for is_map, one, other in zip(mapped.tolist(), narrow(), wide(), strict=True)]

    @cached_property
    def _choice(self) -> tuple[np.ndarray, Bands]:
        """Array `curvature`, and the frequency bands that determine the samples and the soft edges of the pupils."""
        none = np.zeros(len(self.tolerance))
        flat = self._bands(none)
        if not self.smoothed or self.derivatives is not None:
            return none, flat
        able = [isinstance(beam.pupil.aperture, Circle | Annulus) for beam in self.stack.beams] & ~self.stack.mapped
        curvature = np.where(able & (np.abs(self._rim_curvature) >= LEAST_CURVATURE), self._rim_curvature, 0)
        if not curvature.any():
            return none, flat
        curved = self._bands(curvature)
        chosen = (curvature != 0) & (curved.density < WORTH * flat.density)
        return np.where(chosen, curvature, 0), curved.where(chosen, flat)

    @cached_property
    def _rim_curvature(self) -> np.ndarray:
        """Curvatures c of the light at the rims of the pupils, relative to waves that converge to the window, (beam,).

        Near the rim, the light resembles such a wave times e^{iπcr²}, with r in pupil radii. c is a frequency at r = 1
        [cycles per radius], rounded to multiples of CURVATURE_STEP, and positive if the light diverges.
        """
        slopes, (along_x, along_y) = self.stack.slopes, self._to_middle
        r2 = np.square(slopes.x) + np.square(slopes.y)
        rim = self.geometry.to_middle(slopes.across).rim
        outward = ((along_x * slopes.x + along_y * slopes.y)[:, rim] / r2[rim]).mean(axis=1)
        return np.asarray(np.rint(outward / CURVATURE_STEP) * CURVATURE_STEP)

    def _bands(self, curvature: np.ndarray) -> Bands:
        """Return the bands of frequencies that determine, for each pupil, its number of samples and its soft edge.

        curvature: frequency at the rim if the light is convolved with the kernel of the soft edge, else 0, (beam,).
        """
        slopes, bend, cycles, mapped = self.stack.slopes, curvature[:, None], self.geometry.cycles, self.stack.mapped
        along, curved = self._along, bool(curvature.any())
        rest = _unbent(self._to_middle, slopes, curvature) if curved else along
        at_rim = medians(rest[:, rim := self.geometry.to_middle(slopes.across).rim])
        if self.derivatives is not None:
            return self._carried(at_rim, cycles + self._reach(along))
        # Light from the edge matters near the middle of the window, and other light in the whole window.
        steep = np.maximum(RIM_CYCLES * at_rim, self._steepest(curvature))
        near = np.where(curvature != 0, cycles, np.minimum(cycles, NEAR_CYCLES)) + steep
        passband = near + EDGE_CYCLES * (self.tolerance / 0.01) ** EXPONENT
        if curved:
            bent = np.abs(bend) * np.hypot(slopes.x, slopes.y)
            passband = np.maximum(passband, np.where(along <= (cycles + SPREAD_CYCLES)[:, None], bent, 0).max(axis=1))
        stopband = passband + _transitions(self._ripples(curvature)[0])
        reach = self._reach(np.where(bent > stopband[:, None], 0, along) if curved else along)
        spread: np.ndarray | float = SPREAD_CYCLES
        if mapped.any():
            detail = MAPPED_CYCLES + MAPPED_RIM_CYCLES * medians(along[:, rim])
            spread = np.where(mapped, detail * (self.tolerance / 0.01) ** MAPPED_EXPONENT, SPREAD_CYCLES)
        density = self._masks + np.maximum(cycles + reach + spread, near + stopband)
        if mapped.any():
            density = np.maximum(density, np.where(mapped, self._widest, 0))
        return Bands(density, passband, near).stepped(self.stepped)

    def _carried(self, rim: np.ndarray, direct: np.ndarray) -> Bands:
        """Return the frequency bands [cycles per radius] for PSFs with derivatives, which need sharper edges.

        rim: median frequencies of the rays at the edge, (beam,).
        direct: numbers of samples per radius that would be enough without diffraction at the edge, (beam,).
        """
        # High modes grow outside the circle, so that their derivatives need a sharper edge.
        fronts = [beam.pupil.wavefront for beam in self.stack.beams]
        orders = np.array([front.order if isinstance(front, Zernike) else 0 for front in fronts])
        cells = 0 if self.derivatives is None else self.derivatives.cells
        sharp = CARRIED_CYCLES + CARRIED_RIM_CYCLES * rim + orders + cells * CELL_CYCLES
        sharp = sharp * (self.tolerance / 0.01) ** CARRIED_EXPONENT
        density = np.maximum(direct + sharp + self._masks, self._widest)
        density = in_steps(density, CARRIED_STEPS)
        return Bands(density, np.zeros_like(density), np.zeros_like(density))

    @property
    def _widest(self) -> np.ndarray:
        """Least samples per radius, (beam,). Fewer need a soft edge wider than the limit EDGE_REACH [radii]."""
        widest = _transition(CARRIED_RIPPLES[1]) / (1 - CARRIED_PASSBAND) * 2.0 ** (1 / EDGES)
        return np.asarray(widest + self.geometry.cycles / 2)

    @cached_property
    def _masks(self) -> np.ndarray:
        """Cycles per radius above which masks change amplitudes by less than min(tolerance, 0.1), (beam,)."""
        return self.stack.mask_cycles(np.minimum(self.tolerance, 0.1))

    def _reach(self, along: np.ndarray) -> np.ndarray:
        """Return the frequency [cycles per radius] that only a negligible share of a beam's rays exceeds, (beam,).

        along: frequencies of the rays [cycles per radius], (beam, ray).
        """
        share = NEGLECTED * np.minimum(self.tolerance / 0.01, 1.0) ** 2
        last = np.maximum(0, np.ceil(along.shape[1] * (1 - share)).astype(int) - 1)
        ordered = np.partition(along, sorted({*last.tolist()}), axis=1)
        return np.asarray(ordered[np.arange(len(last)), last])

    @cached_property
    def _along(self) -> np.ndarray:
        """Larger of the absolute frequencies along x and y at each ray [cycles/radius], see `_paths`, (beam, ray)."""
        return np.asarray(np.maximum(*map(np.abs, self._to_middle)))

    def _steepest(self, curvature: np.ndarray) -> np.ndarray | float:
        """Return a bound for the frequency of the light at the rim [cycles/radius], which few points exceed, (beam,).

        Polynomials of high order are steepest at the rim. The bound is 0 if no relief or wavefront is one, and for
        maps. The frequency of a curved wave, which is `curvature` at the rim, is first subtracted (see `_unbent`).
        """
        slopes = self.stack.rim_slopes
        if slopes is None:
            return 0.0
        ordered = np.sort(_unbent(self._paths(slopes), slopes, curvature), axis=1)
        missed = np.minimum(RIM_MISSED * (self.tolerance / 0.01) ** MISSED_EXPONENT, 1.0)
        place = np.ceil((1 - missed) * (ordered.shape[1] - 1)).astype(int)
        return np.where(self.stack.mapped, 0.0, ordered[np.arange(len(place)), place])

    @cached_property
    def _to_middle(self) -> tuple[np.ndarray, np.ndarray]:
        return self._paths(self.stack.slopes)

    def _paths(self, slopes: StackSlopes) -> tuple[np.ndarray, np.ndarray]:
        """Return frequencies at rays along x and y [cycles/radius], 0 for light to the window's middle, (beam, ray)."""
        path = self.geometry.to_middle(slopes.across)
        return (slopes.along_x + path.along_x) * path.cycles, (slopes.along_y + path.along_y) * path.cycles

    def _ripples(self, curvature: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the allowed error of the apertures' spectra, for `edges` and for `finer_edges`, (beam,) each."""
        share = self._ripple_share
        if curvature.any():
            share = np.where(curvature != 0, SMOOTHED_RIPPLE, 1.0) * share
        return RIPPLES[0] * share, RIPPLES[1] * share

    @cached_property
    def _ripple_share(self) -> np.ndarray:
        """Allowed errors of the apertures' spectra, relative to those at a PSF tolerance of 0.01, (beam,)."""
        share = np.minimum(2.0 ** np.floor(np.log2(self.tolerance / 0.01)), 1.0)
        return np.asarray(share**RIPPLE_EXPONENT)

    def _wide(self, passband: np.ndarray, ripples: np.ndarray) -> list[SoftAperture]:
        """Return apertures with the widest soft edges that leave their spectra up to `passband` unchanged."""
        passband = in_steps(passband)
        return self._soft(passband, passband + _transitions(ripples), ripples)

    def _narrow(self, density: np.ndarray, ripple: float) -> list[SoftAperture]:
        """Return soft apertures with the narrowest edges that samples of this density [1/radius] can represent."""
        stopband = np.maximum(density - self.geometry.cycles / 2, density / 2)
        stopband = 2.0 ** (np.floor(EDGES * np.log2(stopband)) / EDGES)
        return self._soft(CARRIED_PASSBAND * stopband, stopband, np.full(len(stopband), ripple))

    def _soft(self, passband: np.ndarray, stopband: np.ndarray, ripples: np.ndarray) -> list[SoftAperture]:
        columns = (part.tolist() for part in (passband, stopband, ripples))
        beams = zip(self.stack.beams, *columns, strict=True)
        return [beam.pupil.aperture.with_edge(*edge) for beam, *edge in beams]


def _unbent(paths: tuple[np.ndarray, np.ndarray], slopes: StackSlopes, curvature: np.ndarray) -> np.ndarray:
    """Return the frequency of each ray minus the frequency of a curved wave at the same point, (beam, ray).

    Frequencies [cycles per radius] are subtracted along x and along y, and the larger absolute value is returned.

    paths: frequencies of the rays along x and along y.
    curvature: the wave's frequency at the rim, (beam,). The frequency is proportional to the distance from the axis.
    """
    parts = zip(paths, (slopes.x, slopes.y), strict=True)
    return np.asarray(np.maximum(*(np.abs(part - curvature[:, None] * at) for part, at in parts)))


def _transitions(ripples: np.ndarray) -> np.ndarray:
    """Return the smallest allowed differences between passband and stopband of soft apertures [cycles per radius].

    A smaller difference needs a wider soft edge, and the soft edge must not extend beyond EDGE_REACH.
    """
    return np.array([_transition(ripple) for ripple in ripples.tolist()])


@lru_cache(maxsize=64)
def _transition(ripple: float) -> float:
    return SoftEdge(0.0, 1.0, ripple).reach / EDGE_REACH
