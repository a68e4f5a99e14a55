"""Published models of human eyes: the mean MTF, and an eye with chromatic aberration and a measured wavefront."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from optics.elements.pupil import Pupil
from optics.elements.refractive_index import medium
from optics.elements.relief import BSplineRelief
from optics.elements.wavefront import UM, Zernike, mode
from optics.numerics.arguments import flag, in_range, of_kind, one_of, positive, reals

__all__ = ["HUMAN_WAVEFRONTS", "HumanEye", "mean_human_mtf"]

# Source: Autrusseau, Thibos & Shevell, Vision Research 51, 2282 (2011), table 1: Zernike coefficients [µm] for a pupil
# of 6 mm at 570 nm, in the order of OSA and ANSI. With this unit, order and sign, their figure 11 is reproduced: the
# contrast of L and M cones in tests/optics/elements/test_human_eye.py, and that of S cones in docs/concepts/eye.md.
# Piston and tilts are omitted, since they only shift an image.
HUMAN_WAVEFRONTS = {
    "standard_observer": Zernike(
        {
            (2, -2): -0.1115,
            (2, 0): 0.8638,
            (2, 2): 0.0148,
            (3, -3): -0.1116,
            (3, -1): -0.1644,
            (3, 1): 0.3053,
            (3, 3): -0.0673,
            (4, -4): -0.0273,
            (4, -2): -0.0115,
            (4, 0): 0.2394,
            (4, 2): 0.0228,
            (4, 4): 0.0784,
        },
        radius=3e-3,
    ),
}
IN_FOCUS = 570e-9  # [m]: wavelength at which the eye is in focus, after Autrusseau et al.
# [m]: radius of the reduced eye's single surface (Thibos, Ye, Zhang & Bradley, Appl. Opt. 31, 3594, 1992).
SURFACE = 5.55e-3
ASPHERIC = (2, 4, 6)  # Zernike orders of the surface's aspheric form; order 8 is below 1 nm
RIM = 64  # points on the rim for means over harmonics up to order 31, the highest of a wavefront plus 1
NODES = 24  # quadrature nodes for integrals of these orders over polynomials up to order 12
PERFECT_NM = 555.0  # wavelength for the perfect lens in `mean_human_mtf`


@dataclass(frozen=True, eq=False)
class HumanEye:
    """A reduced eye: one refracting surface between air and the medium "chromatic_eye", with an additional wavefront.

    The surface has the chromatic aberration of a human eye and no other aberration at 570 nm. `optics.medium` describes
    the medium, which is that of Thibos' reduced eye.

    aperture_radius: radius [m] of the pupil, at most the radius of the circle over which the wavefront is known.
    wavefront: additional wavefront. "standard_observer" (Autrusseau, Thibos & Shevell 2011, known up to a radius of 3
        mm), a Zernike, or None.
    centered: True to add the tilt that centres the image of a point on the axis. A wavefront known over a wider circle
        than the pupil usually contains a tilt, because coma that is cropped by the pupil shifts the image. If centered
        is False, the centroid of the standard observer's image lies 1.4 arc minutes off the axis for a pupil of 3 mm.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
    """

    aperture_radius: float = 1.5e-3
    wavefront: Zernike | str | None = "standard_observer"
    centered: bool = False

    def __post_init__(self) -> None:
        positive("aperture_radius", self.aperture_radius)
        flag("centered", self.centered)
        if isinstance(self.wavefront, str):
            one_of("wavefront", self.wavefront, HUMAN_WAVEFRONTS)
        elif self.wavefront is not None:
            of_kind("wavefront", self.wavefront, Zernike, 'Zernike({(2, 0): 0.1}), or "standard_observer"')
            if self.wavefront.asks:
                raise ValueError("wavefront requires a derivative, but none is propagated through it: use a Pupil")
        known = self._reported.radius
        if known is not None and self.aperture_radius > known * (1 + 1e-9):
            raise ValueError(
                f"aperture_radius = {self.aperture_radius:g}: must be at most {known:g} m, where the wavefront is known"
            )

    @cached_property
    def focal_length(self) -> float:
        """Distance from the pupil to the retina [m]."""
        index = medium("chromatic_eye").at(IN_FOCUS)
        return index * SURFACE / (index - 1)

    @cached_property
    def pupil(self) -> Pupil:
        """Pupil of the eye, for functions such as `optics.psf`. Set their sensor distance to `focal_length`."""
        humour = medium("chromatic_eye")
        paraboloid = BSplineRelief.paraboloid(0.0, 1 / SURFACE, self.aperture_radius)
        reported = self._reported
        radius = self.aperture_radius if reported.radius is None else reported.radius
        modes = {(n, 0): self._aspheric(n, radius) for n in ASPHERIC}
        for key, value in reported.modes.items():
            modes[key] = modes.get(key, 0.0) + value
        if self.centered:
            for m, slope in zip((1, -1), self._mean_slopes(reported, radius), strict=True):
                modes[1, m] = modes.get((1, m), 0.0) - slope * radius / 2 / UM
        return Pupil(
            self.aperture_radius,
            paraboloid,
            n=humour,
            medium_n=humour,
            object_n=1.0,
            wavefront=Zernike(modes, radius),
        )

    def frequency(self, cycles_per_degree: Any) -> np.ndarray:
        """Convert frequencies [cycles/degree], an array of any shape, to cycles per metre on the retina.

        `optics.MTF.profile` takes frequencies in cycles per metre.

        Raises:
            ValueError: a number is negative or invalid.
        """
        return _not_negative(cycles_per_degree) * (180 / math.pi) / self._nodal_distance

    def sensor_width(self, fov_deg: float) -> float:
        """Return the side [m] of the retinal square on which a square field of view is imaged: 2 tan(fov/2) f/n.

        fov is the angle `fov_deg` between opposite sides of the field, f is `focal_length`, and n is the index of the
        eye's medium. Use the result as `sensor_width` of an `optics.Eye` with this eye's pupil.

        Raises:
            ValueError: fov_deg is outside [1e-3, 170].
        """
        return 2 * self._nodal_distance * math.tan(math.radians(in_range("fov_deg", fov_deg, 1e-3, 170)) / 2)

    @property
    def _nodal_distance(self) -> float:
        return self.focal_length / medium("chromatic_eye").at(IN_FOCUS)

    @property
    def _reported(self) -> Zernike:
        if self.wavefront is None:
            return Zernike({})
        return HUMAN_WAVEFRONTS[self.wavefront] if isinstance(self.wavefront, str) else self.wavefront

    def _mean_slopes(self, wavefront: Zernike, radius: float) -> np.ndarray:
        """Return the mean slopes (x, y) of a wavefront over the pupil, which determine the centroid of the image.

        By Gauss's theorem, they are the means of 2 W (cos φ, sin φ) / a over the rim of the pupil, where W is the
        wavefront at the azimuth φ and a the pupil's radius. The mean over RIM points is exact.

        radius: radius [m] of the circle over which the Zernike modes of the wavefront are defined.
        """
        angle = 2 * np.pi * np.arange(RIM) / RIM
        normal, part = np.stack([np.cos(angle), np.sin(angle)]), self.aperture_radius / radius
        slopes: np.ndarray = 2 * np.mean(wavefront.at(*(part * normal)) * normal, axis=1) / self.aperture_radius
        return slopes

    def _aspheric(self, order: int, radius: float) -> float:
        """Return the Zernike coefficient [µm] of Z_order^0 in the path difference n (√(r² + f²) - f) - n r²/2f.

        r is the distance from the axis, f the focal length, and n the index of the eye's medium.
        """
        at, weights = np.polynomial.legendre.leggauss(NODES)
        rho = (at + 1) / 2
        r, f = radius * rho, self.focal_length
        beyond = medium("chromatic_eye").at(IN_FOCUS) * (np.hypot(r, f) - f - r * r / (2 * f))
        return float(np.sum(weights * rho * beyond * mode(order, 0, rho, np.zeros_like(rho)))) / UM


def _not_negative(cycles_per_degree: Any) -> np.ndarray:
    u = reals("cycles_per_degree", cycles_per_degree)
    if not (u >= 0).all():
        raise ValueError(f"cycles_per_degree holds {float(u.min()):g}: must be 0 or more")
    return u


def mean_human_mtf(cycles_per_degree: Any, pupil_diameter: float) -> np.ndarray:
    """Return the mean MTF of 200 healthy human eyes at their best focus in white light, averaged over orientations:

        M(u, d) = √D(u, d) (1 + (u/u₁)²)^(-0.62),   u₁ = 21.95 - 5.512 d + 0.3922 d²  [cycles per degree], d in mm

    where D is the MTF of a perfect lens at 555 nm. Source: Watson, J. Vision 13(6):18, 2013, eq. 4 and 5, without
    stray light.

    cycles_per_degree: frequencies u of 0 or more, an array of any shape. The result has the same shape.
    pupil_diameter: d [m], 2 to 6 mm.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
    """
    u = _not_negative(cycles_per_degree)
    d = in_range("pupil_diameter", pupil_diameter, 2e-3, 6e-3) * 1e3
    relative = np.minimum(u / (d * math.pi * 1e6 / (PERFECT_NM * 180)), 1)  # in units of the cut-off frequency
    perfect = 2 / math.pi * (np.arccos(relative) - relative * np.sqrt(1 - relative * relative))
    slower = 21.95 - 5.512 * d + 0.3922 * d * d
    mean: np.ndarray = np.sqrt(perfect) * (1 + (u / slower) ** 2) ** -0.62
    return mean
