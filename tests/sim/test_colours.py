"""What a few bands make of measured colours is known before anything is rendered."""

import numpy as np
import pytest

import optics
import sim
from sim.colours import band_error, measured
from sim.tasks.foraging import ULTRAVIOLET, petal

PETALS = [petal(share) for share in ULTRAVIOLET.values()]
NM = np.arange(300.0, 781.0)


def exact(reflectance, peak_nm, low, high):
    """By quadrature to 1 nm over the eye's range, white being 1."""
    nm = NM[(low <= NM) & (high >= NM)]
    catch = optics.receptors_of((peak_nm,)).catch(nm)[0]
    return np.trapezoid(catch * reflectance.at(nm * 1e-9), nm) / np.trapezoid(catch, nm)


@pytest.mark.parametrize("bands", [4, 8, 16])
@pytest.mark.parametrize("peak_nm", [350.0, 410.0, 560.0])
def test_it_is_what_an_eye_gets_wrong(bands, peak_nm):
    """An eye of so many bands that looks at the colour, against quadrature."""
    eye = optics.Eye(resolution=(1, 1), bands=bands, receptors=(peak_nm,))
    at = eye.spectral_bands.wavelengths
    daylight = optics.illuminant("D65").at(at)
    for reflectance in PETALS:
        seen = eye.see((reflectance.at(at) * daylight)[:, None, None], 1).item()
        wrong = abs(seen - exact(reflectance, peak_nm, *eye.receptors.limits_nm))
        assert band_error([reflectance], (peak_nm,), bands) == pytest.approx(wrong, abs=2e-4)


def test_it_falls_with_the_square_of_the_bands():
    """Colours are linear between the centres: second order. Rounding up, since edges fall on centres by luck."""
    errors = [band_error(PETALS, (600.0, 520.0, 460.0), bands) for bands in (4, 8, 16, 32)]
    orders = -np.diff(np.log2(errors))
    assert orders.mean() > 1.7
    assert orders.min() > 1.0


def test_grey_is_grey_by_any_number_of_bands():
    grey = optics.Spectrum((300.0, 780.0), (0.3, 0.3))
    assert band_error([grey], "rgb", 1) == pytest.approx(0.0, abs=1e-12)
    assert band_error([], "rgb", 1) == 0.0


def test_a_renderer_says_what_its_bands_are_worth():
    world = sim.build_world("foraging")
    assert len(measured(world)) == 2
    assert measured(sim.build_world("detection")) == []
    few, many = (
        sim.BatchedRenderer(world, sim.Eyes(1, (2, 2), receptors="honeybee", bands=bands), 1).fidelity.levels[0]
        for bands in (4, 16)
    )
    assert few.predicted_error == pytest.approx(band_error(PETALS, "honeybee", 4))
    assert many.predicted_error < few.predicted_error / 5
    half = optics.Pupil(50e-6, thin_lens_focal_length=241e-6)
    dim = sim.Eyes(1, (2, 2), receptors="honeybee", optics=half)
    behind = sim.BatchedRenderer(world, dim, 1).fidelity.levels[0].predicted_error
    assert behind == pytest.approx(few.predicted_error / 4), "a quarter of the light"
    grey = sim.BatchedRenderer(sim.build_world("detection"), sim.Eyes(1, (2, 2)), 1).fidelity.levels[0]
    assert grey.predicted_error is None
