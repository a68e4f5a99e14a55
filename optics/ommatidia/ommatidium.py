"""Ommatidia: a lens in front of a rhabdom, which is a waveguide, and their sensitivity to direction."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from optics.elements.beam import Beam
from optics.elements.pupil import MIDDLE, Pupil
from optics.elements.source import PointSource
from optics.numerics.arguments import in_range, of_kind, positive, reals, vacuum_wavelength
from optics.ommatidia.coupling import ModesAtPupil, modes_at_pupil
from optics.ommatidia.facet import FacetLens
from optics.ommatidia.waveguide import Mode, Waveguide

__all__ = ["Ommatidium", "snyder_acceptance"]

STEEPEST = (0.03, 0.06, 0.12, 0.25, 0.5)  # ranges of directions (sines) for which modes are prepared
ALONG = 121  # choice: directions in the search for an acceptance angle
WIDE = 6.0  # choice: range of these directions, relative to the sum of λ/D and the angle of the rhabdom


@dataclass(frozen=True, eq=False)
class Ommatidium:
    """A lens and the waveguide on its axis.

    lens: a FacetLens, or any Pupil.
    rhabdom: the waveguide.
    distance: distance [m] from the plane of the lens (the second principal plane of a FacetLens) to the end of the
        rhabdom, at 550 nm. None: the focal length of the lens at 550 nm, or 240 µm for a Pupil without a focal length.
        The position of the rhabdom is the same for all wavelengths, but a FacetLens with dispersion curves focuses each
        wavelength at its own distance.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
    """

    lens: FacetLens | Pupil
    rhabdom: Waveguide
    distance: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.lens, FacetLens):
            of_kind("lens", self.lens, Pupil, "FacetLens(25e-6, 14e-6), or a Pupil")
        of_kind("rhabdom", self.rhabdom, Waveguide, "Waveguide(2e-6)")
        if self.distance is not None:
            positive("distance", self.distance)

    @property
    def pupil(self) -> Pupil:
        """Pupil of the lens. For a FacetLens, it is the equivalent pupil at 550 nm."""
        return self.lens.pupil() if isinstance(self.lens, FacetLens) else self.lens

    def _beam(self, wavelength: float) -> Beam:
        """Return light that travels along the axis, from the lens to the near end of the rhabdom.

        wavelength: vacuum wavelength [m].

        Raises:
            ValueError: the principal plane of the lens lies behind the end of the rhabdom.
        """
        if not isinstance(self.lens, FacetLens):
            return Beam(self.lens, PointSource(), wavelength, self.rhabdom_distance)
        here, there = (self.lens.principal_planes(at)[1] for at in (MIDDLE, wavelength))
        distance = positive("distance", self.rhabdom_distance + here - there)
        return Beam(self.lens.pupil(wavelength), PointSource(), wavelength, distance)

    def modes(self, wavelength: float = 500e-9) -> tuple[Mode, ...]:
        """Return the guided modes of the rhabdom at a vacuum wavelength [m]. Errors: see `Waveguide.modes`."""
        return self.rhabdom.modes(wavelength)

    def mode_power(self, angle_x: np.ndarray, angle_y: np.ndarray, wavelength: float = 500e-9) -> np.ndarray:
        """Return the fraction of the light on the facet that enters each mode, for a distant point source, (mode, ...).

        Here ... is the shape to which the angles are broadcast.

        angle_x, angle_y: angles [rad] from the axis of the lens to the direction in which the source lies, projected
            onto the planes (x, z) and (y, z). A `PointSource` instead has the angles of the direction in which its
            light travels. The `PointSource` for angles a and b therefore has the angles -a and -b.
        wavelength: vacuum wavelength [m].

        Raises:
            ValueError: an angle has a sine above 0.5 or below -0.5, the shapes of the angles cannot be broadcast, the
                rhabdom has no modes, the pupil's relief is a `PixelRelief`, or one of the pupil's parameters carries a
                derivative. See also `Waveguide.modes`.
        """
        x, y = reals("angle_x", angle_x), reals("angle_y", angle_y)
        try:
            x, y = np.broadcast_arrays(x, y)
        except ValueError:
            raise ValueError(f"angle_x has shape {x.shape} and angle_y {y.shape}: must be equal") from None
        for name, value in (("angle_x", x), ("angle_y", y)):
            in_range(f"abs({name})", float(np.abs(value).max(initial=0.0)), 0.0, math.asin(STEEPEST[-1]))
        tx, ty = np.tan(x), np.tan(y)
        norm = np.sqrt(1 + tx * tx + ty * ty)
        sines = -tx / norm, -ty / norm
        steepest = float(np.hypot(*sines).max(initial=0.0))
        wide = next((limit for limit in STEEPEST if limit >= steepest), 1.0)
        found = coupled_modes(self, vacuum_wavelength(wavelength), wide).power(*sines)
        return found.reshape(len(found), *x.shape)

    def sensitivity(self, angle_x: np.ndarray, angle_y: np.ndarray, wavelength: float = 500e-9) -> np.ndarray:
        """Return the power that the rhabdom absorbs from a distant point source, divided by the power on the facet.

        angle_x, angle_y: see `mode_power`. The result has the shape to which both are broadcast.
        wavelength: vacuum wavelength [m].

        Raises:
            ValueError: see `mode_power`.
        """
        taken = np.array([self.rhabdom.absorbed(mode) for mode in self.modes(wavelength)])
        return np.asarray(np.tensordot(taken, self.mode_power(angle_x, angle_y, wavelength), axes=1))

    def acceptance_angle(self, wavelength: float = 500e-9, azimuth_deg: float = 0.0) -> float:
        """Return the acceptance angle Δρ [rad]: the full width at half maximum of the sensitivity.

        The direction of the source varies in a plane that contains the axis of the lens. If the sensitivity has several
        lobes, the angle is measured between the two outermost directions at half maximum.

        azimuth_deg: azimuth [degrees] of this plane, counted from x towards y, -360 to 360.

        Raises:
            ValueError: the azimuth is outside its range, or the rhabdom is so far from the focus that no peak is found.
                See also `mode_power`.
        """
        pupil = self.pupil
        turn = math.radians(in_range("azimuth_deg", azimuth_deg, -360, 360))
        expected = vacuum_wavelength(wavelength) / pupil.radius + self.rhabdom.diameter / self.rhabdom_distance
        half = min(WIDE / 2 * expected, math.asin(STEEPEST[-1]))
        at = np.linspace(-half, half, ALONG)
        seen = self.sensitivity(at * math.cos(turn), at * math.sin(turn), wavelength)
        above = np.flatnonzero(seen >= seen.max() / 2)
        first, last = int(above[0]), int(above[-1])
        if first == 0 or last == ALONG - 1:
            raise ValueError(
                f"distance = {self.rhabdom_distance:.3g} m: must be nearer to the focus, for a peak to be seen"
            )
        near = range(max(0, int(seen.argmax()) - 1), min(ALONG, int(seen.argmax()) + 2))
        peak = float(np.polynomial.Polynomial.fit(at[near], seen[near], 2)(self._top(at[near], seen[near])))
        flanks = (at[first - 1], at[first]), (at[last], at[last + 1])
        left, right = (self._half(*ends, peak, turn, wavelength) for ends in flanks)
        return right - left

    @staticmethod
    def _top(at: np.ndarray, seen: np.ndarray) -> float:
        """Return the position of the maximum of a parabola through three points.

        If the parabola has no maximum, this is the position of the middle point.
        """
        (left, middle, right), step = seen, float(at[1] - at[0])
        bend = left - 2 * middle + right
        return float(at[1]) if bend >= 0 else float(at[1]) + step * (left - right) / (2 * bend)

    def _half(self, low: float, high: float, peak: float, turn: float, wavelength: float) -> float:
        """Return the angle [rad], in the range from `low` to `high`, at which the sensitivity is half of `peak`.

        In this range, the angle is fitted by a cubic polynomial of the sensitivity.
        """
        at = np.linspace(low, high, 4)
        seen = self.sensitivity(at * math.cos(turn), at * math.sin(turn), wavelength)
        return float(np.polynomial.polynomial.polyval(peak / 2, np.polynomial.polynomial.polyfit(seen, at, 3)))

    @property
    def rhabdom_distance(self) -> float:
        """Distance [m] from the plane of the lens to the end of the rhabdom, at 550 nm.

        Raises:
            ValueError: `distance` is None, and the pupil forms no real image of parallel light.
        """
        return self.pupil.image_distance(math.inf) if self.distance is None else self.distance


@lru_cache(maxsize=32)
def coupled_modes(eye: Ommatidium, wavelength: float, steepest: float) -> ModesAtPupil:
    """Return the modes of an ommatidium's rhabdom, propagated back to its pupil; see `modes_at_pupil`.

    Raises:
        ValueError: the rhabdom guides no mode. See also `modes_at_pupil`.
    """
    modes = eye.modes(wavelength)
    if not modes:
        raise ValueError(f"rhabdom: guides nothing at {wavelength:g} m; must be wider, or of a higher index")
    return modes_at_pupil(eye._beam(wavelength), modes, steepest)


def snyder_acceptance(diameter: float, focal_length: float, rhabdom: float, wavelength: float) -> float:
    """Return the acceptance angle Δρ [rad] after Snyder (J. Comp. Physiol. 116, 161, 1977), √((λ/D)² + (d/f)²).

    The formula treats diffraction and the rhabdom's aperture as Gaussians. It does not treat the rhabdom as a
    waveguide.

    diameter, rhabdom: diameters D of the facet and d of the rhabdom [m].
    focal_length: focal length f [m] in front of the lens. It is the refractive index of the medium in front of the
        lens, divided by the power of the lens.
    wavelength: vacuum wavelength λ [m], for an eye in air. For an eye under water, divide it by the index of water.

    Raises:
        ValueError: a length is not positive, or the wavelength is above 1 m.
    """
    for name, value in (("diameter", diameter), ("focal_length", focal_length), ("rhabdom", rhabdom)):
        positive(name, value)
    vacuum_wavelength(wavelength)
    return math.hypot(wavelength / diameter, rhabdom / focal_length)
