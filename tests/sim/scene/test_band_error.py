"""The error of measured colours in a few bands is predicted before rendering."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import optics
import sim
from sim.scene.band_error import band_error, measured
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation
from sim.worlds.foraging import ULTRAVIOLET, petal

NOISY = 0.1  # standard deviation of the noise, so large that few rays suffice
PETALS = [petal(share) for share in ULTRAVIOLET.values()]
NM = np.arange(300.0, 781.0)
GREY = optics.Spectrum((300.0, 780.0), (0.4, 0.4))


def exact(reflectance, peak_nm, low, high):
    """Return the signal by quadrature to 1 nm over the eye's range, relative to white."""
    nm = NM[(low <= NM) & (high >= NM)]
    catch = optics.receptors_of((peak_nm,)).catch(nm)[0]
    return np.trapezoid(catch * reflectance.at(nm * 1e-9), nm) / np.trapezoid(catch, nm)


@pytest.mark.parametrize("bands", [4, 8, 16])
@pytest.mark.parametrize("peak_nm", [350.0, 410.0, 560.0])
def test_it_is_what_an_eye_gets_wrong(bands, peak_nm):
    """The predicted error equals the difference between an eye with these bands and quadrature."""
    eye = optics.Eye(resolution=(1, 1), bands=bands, receptors=(peak_nm,))
    at = eye.spectral_bands.wavelengths
    daylight = optics.illuminant("D65").at(at)
    for reflectance in PETALS:
        seen = eye.see((reflectance.at(at) * daylight)[:, None, None], 1).item()
        wrong = abs(seen - exact(reflectance, peak_nm, *eye.receptors.limits_nm))
        assert band_error([reflectance], (peak_nm,), bands) == pytest.approx(wrong, abs=2e-4)


def test_it_falls_with_the_square_of_the_bands():
    """Colours are linear between the bands' centres, which gives second order. The limits allow for edges that happen
    to fall on centres.
    """
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
    assert len(measured(world.model, world.spectra)) == 2
    grey = sim.build_world("detection")
    assert measured(grey.model, grey.spectra) == []
    bees = sim.Eyes(1, (2, 2), receptors="honeybee", noise_sigma=NOISY)
    few, many = (sim.BatchedRenderer(world, replace(bees, bands=n), 1).fidelity.levels[0] for n in (4, 16))
    assert few.predicted_error == pytest.approx(band_error(PETALS, "honeybee", 4))
    assert many.predicted_error < few.predicted_error / 5
    half = optics.Pupil(50e-6, thin_lens_focal_length=241e-6)
    behind = sim.BatchedRenderer(world, replace(bees, optics=half), 1).fidelity.levels[0].predicted_error
    assert behind == pytest.approx(few.predicted_error / 4), "the pupil transmits a quarter of the light"
    eyes = sim.Eyes(1, (2, 2), noise_sigma=NOISY)
    assert sim.BatchedRenderer(grey, eyes, 1).fidelity.levels[0].predicted_error is None


class TestLampsWithLines:
    """Grey surfaces under a fluorescent lamp have the same signals in few bands as in 64."""

    @staticmethod
    def signals(renderer, bands, receptors="rgb", **spectra):
        asked = {"wall": GREY, "floor": GREY, "light_0": "FL2", **spectra}
        world = sim.build_world("detection", spectra={name: one for name, one in asked.items() if one is not None})
        simulation = Simulation(task_of(world), 1, 3)
        state = simulation.reset()
        simulation.close()
        eyes = sim.Eyes(1, (3, 3), fov_deg=80, bands=bands, receptors=receptors, noise_sigma=0)
        if renderer == "batched":
            return sim.BatchedRenderer(world, eyes, 1, sim.Fidelity(4, eyes.bands)).signals(state)
        return sim.ReferenceRenderer(world, eyes, "direct", spp=4).signals(state)

    @pytest.mark.parametrize("renderer", ["batched", "reference"])
    def test_few_bands_catch_what_many_do(self, renderer):
        """Signals agree to 1e-4. Samples at the bands' centres would be off by a factor of two (see below)."""
        few, many = (self.signals(renderer, bands) for bands in (4, 64))
        np.testing.assert_allclose(few, many, rtol=1e-4)
        assert few.max() > 0.05

    def test_samples_at_the_centres_miss_lines(self, monkeypatch):
        monkeypatch.setattr("sim.tracing.model_scene.lights_in_bands", lambda model, spectra, *_: (spectra, []))
        few, many = (self.signals("batched", bands) for bands in (4, 64))
        assert (few > 1.9 * many)[many > 0.1].any()

    def test_daylight_by_name_is_daylight(self):
        """A lamp with the table of D65 equals the default light."""
        named, own = (self.signals("batched", 4, light_0=light) for light in ("D65", None))
        np.testing.assert_allclose(named, own, rtol=1e-4)

    def test_too_few_bands_are_told(self):
        with pytest.warns(sim.MirrorWarning, match=r"'light_0' in 4 bands: receptor type 2 catches 0.043 of it"):
            self.signals("batched", 4, "honeybee")
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            self.signals("batched", 16, "honeybee")
