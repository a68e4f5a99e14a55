"""Water and air that absorb and scatter light on its way to an eye.

Along a path of length d through a uniform medium, a radiance L becomes L exp(-c d) + V (1 - exp(-c d)). The first term
is the law of Beer and Lambert. The second term is veiling light, which the medium scatters into the path; an object at
a large distance has the radiance V. Scattered light of the object itself, which blurs it, is neglected.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.elements.refractive_index import Dispersion, medium
from optics.numerics.arguments import in_range, of_kind, one_of
from optics.numerics.read_only import ReadOnlyArrays
from optics.spectra.bands import SpectralBands
from optics.spectra.receptors import receptors_of
from optics.spectra.spectrum import (
    LIMITS_NM,
    Spectrum,
    daylight,
    phytoplankton_absorption,
    water_absorption,
)

__all__ = ["AIR", "MEDIA_OF_WORLDS", "BandMedium", "TurbidMedium", "fog", "medium_of", "sea_water", "turbid_medium"]

# Contrast at which a black object is just visible in front of the horizon; it defines the visibility (Koschmieder 1924,
# Beitraege zur Physik der freien Atmosphaere 12:33).
JUST_VISIBLE = 0.02
# Mean radiance over all directions, relative to a white surface. Under water, light comes from above, so half of all
# directions are bright. In fog, all directions are bright.
FROM_ABOVE, FROM_EVERYWHERE = 0.5, 1.0
STEP_NM = 5.0
# Shortest and longest distance at which errors are computed: in units of 1/c, with the largest c for the shortest
# distance and the mean c for the longest.
SHORTEST, LONGEST = 1e-2, 1e2


@dataclass(frozen=True, eq=False)
class BandMedium(ReadOnlyArrays):
    """A medium in the spectral bands of an eye.

    attenuation: coefficient c [1/m], (band,)
    veil: radiance V of a path of infinite length, in units of a white surface's radiance in daylight at 560 nm, (band,)
    """

    attenuation: np.ndarray
    veil: np.ndarray

    def through(self, radiance: np.ndarray, distance: np.ndarray) -> np.ndarray:
        """Return the radiance (..., band) of a surface that is seen through the medium.

        radiance: radiance of the surface, (..., band)
        distance: length of the path [m], (...), finite and not negative
        """
        passed = np.exp(-self.attenuation * np.asarray(distance)[..., None])
        return np.asarray(self.veil + passed * (radiance - self.veil))


@dataclass(frozen=True)
class TurbidMedium:
    """A uniform medium that fills a world.

    attenuation: beam attenuation coefficient c, the sum of absorption and scattering [1/m]
    veil: radiance of the veiling light along a path of infinite length. At each wavelength, it is relative to the
        radiance of a white surface in daylight. It does not depend on direction or depth
    refractive_index: refractive index of the medium, such as `optics.medium("water")`; None: air

    Raises:
        ValueError: an argument has the wrong type.
    """

    attenuation: Spectrum
    veil: Spectrum
    refractive_index: Dispersion | None = None

    def __post_init__(self) -> None:
        for name in ("attenuation", "veil"):
            of_kind(f"TurbidMedium: {name}", getattr(self, name), Spectrum, "Spectrum((400, 700), (0.1, 0.1))")
        if self.refractive_index is not None:
            of_kind("refractive_index", self.refractive_index, Dispersion, "optics.medium('water'), or None")

    def in_bands(self, bands: SpectralBands, receptors: Any) -> BandMedium:
        """Return the medium in spectral bands.

        The coefficient of a band is a mean, weighted by the receptors' quantum catch in daylight. As the distance to a
        white surface grows from 0, the signal of every receptor therefore changes at the correct rate per metre. This
        requires at least as many bands as receptor types. At longer distances, the true transmission of a band is not
        an exponential function, and `band_error` returns the error.

        bands: the bands of an eye
        receptors: the receptors for which these bands were made

        Raises:
            ValueError: receptors is None, an unknown name, or invalid.
        """
        white = daylight(bands.wavelengths)
        c = bands.band_values(_in_daylight(self.attenuation), receptors, nonnegative=True) / white
        return BandMedium(c, bands.band_values(_in_daylight(self.veil), receptors, nonnegative=True))

    def band_error(self, bands: int, receptors: Any) -> float:
        """Return the largest error that this number of bands causes, relative to a white surface's signal in daylight.

        The maximum is taken over receptor types, black and white surfaces, and distances up to 100 attenuation lengths.
        The reference is the integral over the spectrum in steps of 1 nm. Without attenuation the error is 0.

        receptors: `Receptors`, or a name or peak wavelengths for `optics.receptors_of`

        Raises:
            ValueError: bands is outside 1 to 64, or the receptors are unknown.
        """
        kinds = receptors_of(receptors)
        few = SpectralBands.uniform(bands, kinds)
        nm = np.arange(kinds.limits_nm[0], kinds.limits_nm[1] + 0.5)
        catch = kinds.catch(nm)
        catch[:, [0, -1]] /= 2  # trapezoid rule
        catch /= catch.sum(axis=1, keepdims=True)
        fine, coarse = BandMedium(self.attenuation.at(nm * 1e-9), self.veil.at(nm * 1e-9)), self.in_bands(few, kinds)
        if not fine.attenuation.any():
            return 0.0
        distances = np.geomspace(SHORTEST / fine.attenuation.max(), LONGEST / fine.attenuation.mean(), 81)
        worst = 0.0
        for surface in (0.0, 1.0):
            right = fine.through(np.full(len(nm), surface), distances) @ catch.T
            found = coarse.through(surface * daylight(few.wavelengths), distances) @ few.weights.T
            worst = max(worst, float(np.abs(found - right).max()))
        return worst


def sea_water(chlorophyll: float) -> TurbidMedium:
    """Return sea water with the concentration C of chlorophyll [mg/m³], in [0, 30].

    Absorption and scattering follow the classic model of case 1 waters, with λ in nm. Absorption is a = a_w + a_p + 0.2
    a_p(440) exp(-0.014 (λ - 440)), where pure water absorbs a_w, and phytoplankton absorbs a_p = 0.06 A(λ) C^0.65 with
    the relative absorption A. Scattering is b = b_w + 0.30 C^0.62 (550/λ). Pure sea water scatters b_w = 16.06 ·
    4.72e-4 (400/λ)^4.32. The veiling light is ½ b/(a + b): the water scatters light that arrives with equal radiance
    from all directions of the upper hemisphere, and with none from below. The attenuation is c = a + b.

    Sources: Gordon & Morel (1983), Remote Assessment of Ocean Color; Morel (1974); Mobley (1994), Light and Water,
    equations 3.27 and 3.40. The sources of the absorption are in `water_absorption` and `phytoplankton_absorption`.
    Below 400 nm, A is assumed to be constant, which is uncertain. With 0.15 and 1 mg/m³, c at 514 nm is 0.15 and 0.40
    per metre, as Petzold (1972) measured in clear ocean water and in coastal water.

    Raises:
        ValueError: the concentration is outside its range.
    """
    chlorophyll = in_range("chlorophyll", chlorophyll, 0.0, 30.0)
    nm = np.arange(LIMITS_NM[0], LIMITS_NM[1] + 1, STEP_NM)
    particles, at_440 = 0.06 * chlorophyll**0.65 * phytoplankton_absorption().at(nm * 1e-9), 0.06 * chlorophyll**0.65
    absorption = water_absorption().at(nm * 1e-9) + particles + 0.2 * at_440 * np.exp(-0.014 * (nm - 440))
    scattering = 16.06 * 4.72e-4 * (400 / nm) ** 4.32 + 0.30 * chlorophyll**0.62 * (550 / nm)
    c = absorption + scattering
    return TurbidMedium(_table(nm, c), _table(nm, FROM_ABOVE * scattering / c), medium("water"))


def fog(visibility: float) -> TurbidMedium:
    """Return fog of this meteorological visibility [m], in [1, 1e6].

    The beam attenuation coefficient c = ln(50) / visibility is the same at all wavelengths, because droplets are large
    compared with wavelengths. At the distance `visibility`, a black object has a contrast of 2 % with the horizon
    (Koschmieder 1924). Droplets absorb almost no light, so the veiling light is as bright as a white surface in
    daylight.

    Raises:
        ValueError: the visibility is outside its range.
    """
    c = -math.log(JUST_VISIBLE) / in_range("visibility", visibility, 1.0, 1e6)
    return TurbidMedium(Spectrum(LIMITS_NM, (c, c)), Spectrum(LIMITS_NM, (FROM_EVERYWHERE,) * 2))


AIR = "air"
# Media by name; the concentrations of chlorophyll are those for which c at 514 nm agrees with Petzold's waters.
MEDIA_OF_WORLDS = (AIR, "clear_ocean", "coastal_water", "fog")


def turbid_medium(name: str) -> TurbidMedium | None:
    """Return a medium that fills a world, by its name; None for clear air.

    name: "air", "clear_ocean" (`sea_water(0.15)`), "coastal_water" (`sea_water(1)`) or "fog" (`fog(50)`)

    Raises:
        ValueError: the name is unknown.
    """
    one_of("medium", name, MEDIA_OF_WORLDS)
    made = {"clear_ocean": lambda: sea_water(0.15), "coastal_water": lambda: sea_water(1.0), "fog": lambda: fog(50.0)}
    return made[name]() if name in made else None


def medium_of(name: str, value: Any) -> TurbidMedium | None:
    """Return the medium for an argument: a medium, the name of one, or None for clear air.

    name: name of the argument, for the error message

    Raises:
        ValueError: the argument is of another kind, or the name is unknown.
    """
    if value is None or isinstance(value, str):
        return None if value is None else turbid_medium(one_of(name, value, MEDIA_OF_WORLDS))
    of_kind(name, value, TurbidMedium, "optics.sea_water(1), a name such as 'fog', or None for clear air")
    return value


def _table(nm: np.ndarray, values: np.ndarray) -> Spectrum:
    return Spectrum(tuple(nm.tolist()), tuple(values.tolist()))


def _in_daylight(spectrum: Spectrum) -> Any:
    return lambda wavelengths: spectrum.at(wavelengths) * daylight(wavelengths)
