"""Land's sensitivity: published values, the photons of a budget, and its two forms of absorption."""

import math

import numpy as np
import pytest

import optics
from optics import PhotonBudget, light_level, optical_sensitivity
from optics.spectra.bands import SpectralBands, cie_1931, daylight

BEE = {"diameter": 20e-6, "focal_length": 66e-6, "receptor": 66e-6 * math.radians(1.75), "length": 320e-6}


def test_the_sensitivity_of_a_honeybee_is_the_published_one():
    """The published value is 0.11 µm² sr (Somanathan et al., J. Exp. Biol. 212, 2448, 2009, table 1)."""
    assert optical_sensitivity(**BEE) * 1e12 == pytest.approx(0.11, abs=0.005)


def test_without_a_length_it_is_the_etendue_of_a_round_receptor():
    """The étendue is the area of the pupil times the solid angle of the receptor, π/4 D² · π/4 (d/f)²."""
    area, angle = math.pi / 4 * 20e-6**2, math.pi / 4 * math.radians(1.75) ** 2
    assert optical_sensitivity(20e-6, 66e-6, BEE["receptor"]) == pytest.approx(area * angle)


def test_a_short_receptor_absorbs_in_proportion_to_its_length():
    per_length = optical_sensitivity(1e-3, 1e-3, 1e-6) * 6.7e3
    assert optical_sensitivity(1e-3, 1e-3, 1e-6, 1e-9, light="peak") == pytest.approx(1e-9 * per_length, rel=1e-4)
    assert optical_sensitivity(1e-3, 1e-3, 1e-6, 1e-9) == pytest.approx(1e-9 * per_length / 2.3, rel=1e-4)


def test_a_budget_counts_the_photons_of_this_sensitivity():
    """Photons at one wavelength are S · radiance · Δt, with Geisler's conversion of candelas to photons at 555 nm.

    Geisler, J. Opt. Soc. Am. A 1, 775, 1984: a receptor of 1 min² behind 1 mm² of pupil receives 347.8 photons per
    second and cd/m². With K_m = 683 lm/W it is 346.1.
    """
    narrow = optics.Spectrum((554.0, 555.0, 556.0), (0.0, 1.0, 0.0))
    bands = SpectralBands.uniform(1, optics.Receptors((narrow,), range_nm=(550.0, 560.0)))
    budget = PhotonBudget(math.pi, integration_time=1.0, quantum_efficiency=1.0)
    # The budget's light of 1 cd/m² is daylight. Its luminance per nm at 555 nm replaces Geisler's single line.
    nm = np.arange(360, 781, 5)
    white = daylight(nm * 1e-9)
    share = daylight(555e-9) * cie_1931(555e-9)[1] / (5 * np.sum(white * cie_1931(nm * 1e-9)[:, 1]))
    minute = math.radians(1 / 60) ** 2
    assert budget.photons(bands, 1e-6 * minute)[0] == pytest.approx(347.8 * share, rel=6e-3)


def test_light_levels_rise_from_starlight_to_sunlight():
    levels = [light_level(name) for name in ("starlight", "quarter moon", "full moon", "civil dusk", "sunset")]
    assert levels == sorted(levels)
    assert levels[0] == 2e-3
    for name in ("starlight", "sunlight"):
        PhotonBudget(light_level(name))


@pytest.mark.parametrize(
    "change", [{"diameter": 0.0}, {"focal_length": -1.0}, {"receptor": math.nan}, {"length": 0.0}, {"light": "green"}]
)
def test_invalid_arguments_raise(change):
    with pytest.raises(ValueError, match=next(iter(change))):
        optical_sensitivity(**{**BEE, **change})


def test_unknown_levels_suggest_known_ones():
    with pytest.raises(ValueError, match="starlight"):
        light_level("starligth")
