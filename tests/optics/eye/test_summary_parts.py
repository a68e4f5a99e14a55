"""Rows of the table of an eye's limits, and widths of sensitivities, from given numbers."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import erf

from optics.eye import summary
from optics.eye.summary import Description
from optics.numerics.accuracy import Plan

PLAN = Plan("angular_spectrum", (64, 32), "float32", 2e-3, "why")
TABLE = Description(
    relative_aperture=0.5,
    throughput=0.25,
    f_number=4.0,
    wavelength=5.5e-7,
    diffraction_cpd=3.0,
    sampling_cpd=2.0,
    noise_cpd=1.5,
    strehl_ratio=0.9,
    image_quality=0.4,
    noise=0.013,
    photons=None,
    acceptance_angle_deg=0.3,
    interommatidial_angle_deg=0.25,
    interommatidial_vertical_deg=0.25,
    plan=PLAN,
    white_signal=0.2,
)


def rows(table):
    return {line[:20].strip(): line[20:] for line in str(table).splitlines()}


def test_rows_of_the_table():
    assert rows(TABLE) == {
        "aperture": "a = 0.5, f/4, throughput 0.25",
        "image": "Strehl ratio 0.9, quality 0.4",
        "noise": "0.013 of 0.2 for white",
        "limit: diffraction": "3 cycles/degree",
        "limit: sampling": "2 cycles/degree",
        "limit: noise": "1.5 cycles/degree  <- binding",
        "acuity": "1.5 cycles/degree, noise binds",
        "acceptance": "0.3°, 1.2 of the angle between receptors",
        "receptors": "0.25° apart",
        "PSF": "angular_spectrum, 64 x 32 samples, float32, predicted error 2.0e-03",
    }


def test_optional_rows_of_the_table():
    changed = replace(
        TABLE,
        photons=1234.0,
        interommatidial_vertical_deg=0.5,
        interommatidial_range_deg=((0.1, 0.4), (0.2, 0.8)),
        unknown=("one: a", "two: b"),
    )
    found = rows(changed)
    assert list(found)[6:11] == ["acuity", "acuity, vertical", "acceptance", "receptors", "spacing, horizontal"]
    assert found["noise"] == "0.013 of 0.2 for white, of 1.23e+03 photons per receptor"
    assert found["acuity, vertical"] == "1 cycles/degree, rows of receptors 0.5° apart"
    assert found["spacing, horizontal"] == "0.1° to 0.4° over the eye, 5 cycles/degree at the finest"
    assert found["spacing, vertical"] == "0.2° to 0.8° over the eye, 2.5 cycles/degree at the finest"
    assert found["not known (1)"] == "one: a"
    assert found["not known (2)"] == "two: b"
    assert "acuity, vertical" not in rows(replace(TABLE, interommatidial_vertical_deg=0.25 * (1 + 5e-10)))
    assert "acuity, vertical" in rows(replace(TABLE, interommatidial_vertical_deg=0.25 * (1 + 2e-9)))


def test_the_lowest_known_limit_binds():
    assert (TABLE.binding, TABLE.acuity_cpd) == ("noise", 1.5)
    assert (TABLE.sampling_vertical_cpd, TABLE.acuity_vertical_cpd) == (2.0, 1.5)
    high = replace(TABLE, interommatidial_vertical_deg=0.5)
    assert (high.acuity_cpd, high.sampling_vertical_cpd, high.acuity_vertical_cpd) == (1.5, 1.0, 1.0)
    loud = replace(high, noise_cpd=math.nan)
    assert loud.binding == "sampling"
    assert math.isnan(loud.acuity_cpd)
    assert math.isnan(loud.acuity_vertical_cpd)
    assert rows(loud)["acuity"] == "at most 2 cycles/degree, sampling binds"
    assert rows(loud)["acuity, vertical"] == "at most 1 cycles/degree, rows of receptors 0.5° apart"
    assert "limit: noise" not in rows(loud)
    assert Description.__dataclass_fields__["white_signal"].default is math.nan


@pytest.mark.parametrize("half", [0.5, 1.0, 2.5])
def test_integrals_around_places(half):
    """A spline through samples of 3 + 2x is exact. Nothing lies beyond the first and the last sample."""
    x = np.arange(-4.0, 7.0)
    image = np.stack([3 + 2 * x, x**2], axis=1)
    at = np.array([-4.0, 0.25, 3.0, 6.0])
    low, high = np.maximum(at - half, -4), np.minimum(at + half, 6)
    expected = np.stack([3 * (high - low) + high**2 - low**2, (high**3 - low**3) / 3], axis=1)
    np.testing.assert_allclose(summary._within(x, image, at, half), expected)


def gaussian(x, middle, sigma):
    return np.exp(-(((x - middle) / sigma) ** 2) / 2)


def test_the_width_of_a_receptor_s_sensitivity():
    """A Gaussian, integrated over the receptor's width, is a difference of error functions. The brightest row counts:
    a dimmer one is narrower.
    """
    dx, sigma, middle, (height, width) = 0.5, 2.0, 1.25, (3.0, 5.0)
    x, y = dx * (np.arange(81) - 40), dx * (np.arange(101) - 50)
    image = gaussian(y, 6.0, 2.0)[:, None] * gaussian(x, middle, sigma)
    image += 0.9 * gaussian(y, -8.0, 2.0)[:, None] * gaussian(x, middle, sigma / 2)
    white = SimpleNamespace(x=x, y=y, dx=dx, psf=image[None])
    eye = SimpleNamespace(pupil=1, waveguide=None, receptor_size=(height, width), receptor_pitch=7.0)

    def sensitivity(u):
        return erf((u + width / 2) / sigma / math.sqrt(2)) - erf((u - width / 2) / sigma / math.sqrt(2))

    half = brentq(lambda u: sensitivity(u) - sensitivity(0) / 2, 0, 20)
    assert summary._acceptance(eye, white, None) == pytest.approx(2 * half, rel=1e-3)
    assert summary._acceptance(SimpleNamespace(pupil=None, receptor_pitch=7.0), white, None) == 7


@pytest.mark.parametrize("middle", [-17.0, 17.0])
def test_the_width_of_a_sensitivity_at_the_rim_of_the_window(middle):
    """A narrow PSF is 5 wide behind a receptor of this width, although it lies within 3 of the rim."""
    x = 0.5 * (np.arange(81) - 40)
    white = SimpleNamespace(x=x, y=x, dx=0.5, psf=gaussian(x, middle, 1.0)[None, :, None] * gaussian(x, middle, 1.0))
    eye = SimpleNamespace(pupil=1, waveguide=None, receptor_size=(5.0, 5.0), receptor_pitch=7.0)
    assert summary._acceptance(eye, white, None) == pytest.approx(5.0, rel=0.01)


@pytest.mark.parametrize(("diameter", "cells"), [(1.0, 56), (2.0, 28), (2.01, 28), (0.5, 64), (20.0, 4)])
def test_the_width_of_a_waveguide_s_sensitivity(diameter, cells):
    """The kernel has 8 cells across the waveguide, at least 4 and at most 64 across the receptor, which is 7 wide."""
    asked = []

    def kernel(count):
        asked.append(count)
        at = np.arange(40 * count // 4) / count * 7.0
        rows_ = 0.9 * gaussian(np.arange(9), 1, 0.5)[:, None] * gaussian(at, 30.0, 3.0)
        rows_ += gaussian(np.arange(9), 5, 0.5)[:, None] * gaussian(at, 31.0, 4.0)
        return np.stack([rows_, 3 * rows_])

    bands = SimpleNamespace(white_light=lambda kernels: kernels)
    eye = SimpleNamespace(
        pupil=1, waveguide=SimpleNamespace(diameter=diameter), receptor_pitch=7.0, spectral_bands=bands
    )
    width = 2 * math.sqrt(2 * math.log(2)) * 4.0
    found, length = summary._acceptance(eye, None, kernel), 10 * cells
    assert found == pytest.approx(width, abs=2 * 7.0 / cells / 15)
    step = (length - 1) / (16 * length - 1) * 7.0 / cells  # 16 points for each cell
    assert found / step == pytest.approx(round(found / step), abs=1e-6)
    assert asked == [cells]


def test_noise_of_photons_and_receptors():
    """N photons for a signal of 1 add the noise √(T/N) at the signal T."""
    eye = SimpleNamespace(noise_sigma=0.3, photons=np.array([50.0, 150.0]), photon_budget=1, dynamics=None)
    assert summary._photons_of(eye) == 100
    assert summary.noise_of(eye, 0.25) == pytest.approx(math.hypot(0.3, math.sqrt(0.25 / 100)))
    for dark in ({"photons": None}, {"photon_budget": None}):
        without = SimpleNamespace(**(vars(eye) | dark))
        assert summary._photons_of(without) is None
        assert summary.noise_of(without, 0.25) == 0.3
    slow = SimpleNamespace(
        **(vars(eye) | {"dynamics": SimpleNamespace(integration_ms=60.0)})
        | {"photon_budget": SimpleNamespace(integration_time=0.02)}
    )
    assert summary._photons_of(slow) == pytest.approx(300)


def test_psf_of_daylight():
    """Bands are weighted by daylight and by the mean sensitivity of the channels."""
    wavelengths = np.array([450e-9, 550e-9, 650e-9])
    weights = np.array([[1.0, 0.5, 0.0], [0.0, 0.5, 3.0]])
    eye = SimpleNamespace(spectral_bands=SimpleNamespace(weights=weights, wavelengths=wavelengths))
    found = summary.daylight_psf(eye, SimpleNamespace(mean=lambda worth: worth))
    worth = np.array([0.5, 0.5, 1.5]) * summary.daylight(wavelengths)
    np.testing.assert_allclose(found, worth / worth.sum())
