"""Apposition eyes: arrays of ommatidia, each with its own direction."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.numerics.arguments import finite, in_range, of_kind, positive, reals, shown, vacuum_wavelength, whole
from optics.numerics.read_only import read_only
from optics.ommatidia.acceptance import acceptance_function
from optics.ommatidia.ommatidium import Ommatidium

__all__ = ["AppositionEye", "hexagonal_directions"]

MOST_RINGS = 60
EVERY = 2  # choice: every second sample of the acceptance function is used, which leaves four per λ/D
LOST = 0.01  # choice: fraction of the accepted light that a field may lose, because its tails are wide
MOST = 2**22  # choice: largest number of directions at which a radiance is evaluated at once


def hexagonal_directions(rings: int, interommatidial_deg: float) -> np.ndarray:
    """Return the viewing directions (n, 2) of ommatidia in hexagonal rings about the axis: angles [rad] along x and y.

    The angle between neighbours is Δφ, and rows run along x. The number of directions is n = 1 + 3N(N + 1), where N is
    the number of `rings`.

    interommatidial_deg: Δφ [degrees].

    Raises:
        ValueError: rings is not a whole number from 0 to 60, or the angle is not positive.
    """
    whole("rings", rings, 0, MOST_RINGS)
    apart = math.radians(positive("interommatidial_deg", interommatidial_deg, "degrees"))
    steps = np.arange(-rings, rings + 1)
    q, r = (axis.ravel() for axis in np.meshgrid(steps, steps))
    kept = np.abs(q + r) <= rings
    q, r = q[kept], r[kept]
    return apart * np.column_stack([q + r / 2, math.sqrt(3) / 2 * r])


@dataclass(frozen=True, eq=False)
class AppositionEye:
    """Identical ommatidia with hexagonally arranged viewing directions.

    ommatidium: the ommatidium that all directions share.
    rings: number of rings around the ommatidium on the axis.
    interommatidial_deg: Δφ [degrees] between neighbours, 1e-3 to 30.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
    """

    ommatidium: Ommatidium
    rings: int
    interommatidial_deg: float

    def __post_init__(self) -> None:
        of_kind("ommatidium", self.ommatidium, Ommatidium, "Ommatidium(FacetLens(25e-6, 14e-6), Waveguide(2e-6))")
        in_range("interommatidial_deg", self.interommatidial_deg, 1e-3, 30.0)
        hexagonal_directions(self.rings, self.interommatidial_deg)

    @cached_property
    def directions(self) -> np.ndarray:
        """Viewing directions (ommatidium, 2): angles [rad] along x and y."""
        return read_only(hexagonal_directions(self.rings, self.interommatidial_deg))

    def field(self, wavelength: float = 500e-9) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return directions x, y [rad] relative to the ommatidium's axis, flat, and their weights, which sum to 1.

        The directions form a grid: along each axis, every second direction of the grid of `acceptance_function`. Their
        sines along each axis do not exceed ±0.5. They contain at least 99 % of the light that the ommatidium accepts,
        unless more than 1 % comes from beyond this limit.

        wavelength: vacuum wavelength [m].

        Raises:
            ValueError: see `acceptance_function`.
        """
        accepted = acceptance_function(self.ommatidium, np.array([vacuum_wavelength(wavelength)]), LOST)
        samples = slice(len(accepted.sines) // 2 % EVERY, None, EVERY)  # contains the axis
        powers = (accepted.values[0] * accepted.solid_angles)[samples, samples].ravel()
        x, y = (axis.ravel()[powers > 0] for axis in np.meshgrid(accepted.sines[samples], accepted.sines[samples]))
        cosine = np.sqrt(1 - x * x - y * y)
        return np.arctan(x / cosine), np.arctan(y / cosine), powers[powers > 0] / powers.sum()

    def see(self, radiance: Callable[[np.ndarray, np.ndarray], np.ndarray], wavelength: float = 500e-9) -> np.ndarray:
        """Return the signals (ommatidium,) for a scene. A uniform radiance of 1 gives signals of 1.

        radiance: function that returns the radiance for arrays of angles x, y [rad], (n, direction). It is called once
            for each group of n ommatidia.

        Raises:
            ValueError: radiance is not a function, its values are not finite real numbers, or their shape differs from
                that of the angles. See also `field`.
        """
        if not callable(radiance):
            raise ValueError(f"radiance = {shown(radiance)}: must be a function of angles x and y [rad]")
        x, y, weights = self.field(wavelength)
        found = []
        for own in np.array_split(self.directions, -(-len(self.directions) * len(x) // MOST)):
            scene = reals("radiance", radiance(own[:, :1] + x, own[:, 1:] + y))
            if scene.shape != (len(own), len(x)) or not np.isfinite(scene).all():
                raise ValueError(f"radiance gives shape {scene.shape}: must be finite, of the shape of the angles")
            found.append(scene @ weights)
        return np.concatenate(found)

    def contrast(self, cycles_per_degree: float, wavelength: float = 500e-9, azimuth_deg: float = 0.0) -> float:
        """Return the contrast of a sine grating in an ommatidium's signal, for a grating of contrast 1.

        This contrast is the modulus of the Fourier transform of the angular sensitivity, whose integral is normalised
        to 1. The contrast usually falls as the grating becomes finer. It is 0 beyond 2R n/λ cycles per radian, where R
        is the radius of the pupil and n the refractive index in front of the pupil. The spacing of the ommatidia is a
        separate limit: their array resolves gratings up to 1/(√3 Δφ), with the interommatidial angle Δφ.

        azimuth_deg: direction [degrees] along which the grating varies, from x towards y.

        Raises:
            ValueError: a frequency is outside [0, 1e9], or the azimuth is not finite. See also `field`.
        """
        in_range("cycles_per_degree", cycles_per_degree, 0.0, 1e9)
        turn = math.radians(finite("azimuth_deg", azimuth_deg))
        per_radian = math.degrees(cycles_per_degree)
        pupil, at = self.ommatidium.pupil, vacuum_wavelength(wavelength)
        if per_radian >= 2 * pupil.radius * pupil.index_before(at) / at:
            return 0.0
        x, y, weights = self.field(wavelength)
        phase = 2 * np.pi * np.degrees(x * math.cos(turn) + y * math.sin(turn)) * cycles_per_degree
        return float(np.abs(np.sum(weights * np.exp(1j * phase))))
