"""Number of photons that a receptor absorbs from a white surface, whose signal is 1, computed from the light level."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from optics.numerics.arguments import in_range, of_kind, one_of, positive
from optics.spectra.bands import SpectralBands
from optics.spectra.spectrum import cie_1931, daylight

__all__ = ["PhotonBudget", "light_level"]

PLANCK, LIGHT_SPEED = 6.62607015e-34, 299792458.0  # [J s], [m/s], exact in the SI
LUMENS_PER_WATT = 683.0  # K_m of CIE 018, accurate to 0.002 %
# Illuminance [lx] of horizontal ground. Source: Schlyter, Radiometry and photometry in astronomy, 2017, by the table in
# Wikipedia's "Orders of magnitude (illuminance)". The values vary with weather and season by factors of 2 and more.
LIGHT_LEVELS = {
    "starlight": 2e-3,
    "quarter moon": 1e-2,
    "full moon": 0.25,
    "civil dusk": 3.4,
    "sunset": 400.0,
    "overcast": 1e4,
    "sunlight": 1.1e5,
}


@dataclass(frozen=True)
class PhotonBudget:
    """Illuminance of the scene, with integration time and quantum efficiency of the receptors.

    illuminance: illuminance E_v [lx] of the scene by daylight (CIE D65): 1e5 in the sun, 1e4 under an overcast sky, 10
        at dusk.
    integration_time: integration time Δt [s] of a receptor. It is typically 10 to 50 ms in insects and vertebrates in
        bright light.
    quantum_efficiency: fraction η of the photons, at the peak wavelength of a receptor's pigment, that the pigment
        absorbs. Photons that are lost in front of the receptor count as not absorbed.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
    """

    illuminance: float = 1e4
    integration_time: float = 0.02
    quantum_efficiency: float = 0.5

    def __post_init__(self) -> None:
        in_range("illuminance", self.illuminance, 1e-6, 1e6)
        in_range("integration_time", self.integration_time, 1e-6, 1e3)
        in_range("quantum_efficiency", self.quantum_efficiency, 1e-6, 1)

    @property
    def spectral_irradiance(self) -> float:
        """Spectral irradiance E_560 of daylight on the scene at 560 nm [W/m³].

        It follows from E_v = K_m E_560 ∫ daylight(λ) ȳ(λ) dλ with K_m = 683 lm/W and the CIE 1931 function ȳ.
        """
        wavelengths = np.arange(360, 781, 5) * 1e-9
        visible = daylight(wavelengths) * cie_1931(wavelengths)[:, 1]
        return self.illuminance / (LUMENS_PER_WATT * float(visible.sum()) * 5e-9)

    def photons(self, bands: SpectralBands, etendue: float) -> np.ndarray:
        """Return the number of absorbed photons per integration time for a white Lambertian surface, (channel,):

            N_c = η Δt G ∫ E_λ/π · λ/(hc) · S_c(λ) dλ

        η is the quantum efficiency, Δt the integration time, E_λ the spectral irradiance, S_c the sensitivity of
        channel c, h Planck's constant, and c in hc the speed of light.

        etendue: G [m² sr], the pupil's area times the solid angle from which a receptor receives light: Land's
            sensitivity (`optical_sensitivity`; Warrant & Nilsson 1998, Vision Research 38:195, eq. 1), or (π/4) D²
            (d/f)² for square receptors of side d behind a pupil of diameter D, at the focal length f. The spectrum of
            daylight replaces the single wavelength of Land's formula.

        Raises:
            ValueError: an argument is outside its valid range, which the message states.
        """
        of_kind("bands", bands, SpectralBands, "SpectralBands.uniform(4)")
        positive("etendue", etendue, "m² sr")
        radiance = self.spectral_irradiance / math.pi
        factor = self.quantum_efficiency * self.integration_time * etendue
        return factor * radiance / (PLANCK * LIGHT_SPEED) * bands.white_catch


def light_level(name: str) -> float:
    """Return a typical illuminance [lx] in the open, for `PhotonBudget`.

    The light has the spectrum of daylight, as moonlight approximately does. Starlight is redder.

    name: "starlight" (clear sky without moon, with airglow), "quarter moon", "full moon", "civil dusk" (the dark limit
        of civil twilight), "sunset" (clear sky), "overcast" (midday) or "sunlight".

    Raises:
        ValueError: the name is unknown.
    """
    return LIGHT_LEVELS[one_of("light level", name, LIGHT_LEVELS)]
