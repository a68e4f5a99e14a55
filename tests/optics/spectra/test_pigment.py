"""Visual pigment templates against the numbers in their paper and against other published templates."""

import numpy as np
import pytest

from optics import Pigment
from optics.spectra.pigment import pigment_absorptance

NM = np.arange(300.0, 780.0, 0.1)


def alpha_band(sensitivity, peak_nm):
    """Return the wavelengths from the long-wave end of the α band to those at which the β band becomes significant."""
    return (peak_nm * 0.93 < NM) & (sensitivity > 0.02)


def stavenga_1993(nm, peak_nm, a0, a1):
    """Return the α band, a modified lognormal function (Stavenga, Smits & Hoenders 1993, Vision Research 33:1011, eq.
    2).
    """
    x = np.log10(nm / peak_nm)
    return np.exp(-a0 * x**2 * (1 + a1 * x + 3 / 8 * (a1 * x) ** 2))


def lamb_1995(nm, peak_nm):
    """Return the template for A1 pigments of Lamb (1995), Vision Research 35:3083, eq. 2'."""
    x = peak_nm / nm
    return 1 / (np.exp(70 * (0.880 - x)) + np.exp(28.5 * (0.924 - x)) + np.exp(-14.1 * (1.104 - x)) + 0.655)


@pytest.mark.parametrize("chromophore", ["A1", "A2"])
@pytest.mark.parametrize("peak_nm", [440.0, 500.0, 560.0, 620.0])
def test_the_alpha_band_peaks_at_one_where_it_says(peak_nm, chromophore):
    sensitivity = pigment_absorptance(NM * 1e-9, peak_nm * 1e-9, chromophore)
    near = np.abs(NM - peak_nm) < 40
    assert NM[near][np.argmax(sensitivity[near])] == pytest.approx(peak_nm, abs=2)
    assert sensitivity[near].max() == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("peak_nm", [500.0, 530.0, 560.0])
def test_a1_is_lambs_template_where_both_hold(peak_nm):
    """The two templates have the same form, and differ by 2 % of the peak because their parameters were fitted to other
    data. (The parameters of A2 would give an error of 10 %.)
    """
    ours = pigment_absorptance(NM * 1e-9, peak_nm * 1e-9)
    band = alpha_band(ours, peak_nm)
    assert np.abs(ours - lamb_1995(NM, peak_nm))[band].max() < 0.02
    other = pigment_absorptance(NM * 1e-9, peak_nm * 1e-9, "A2")
    assert np.abs(other - lamb_1995(NM, peak_nm))[band].max() > 0.06


@pytest.mark.parametrize(("chromophore", "a0", "a1", "least"), [("A1", 380, 6.09, 0.02), ("A2", 263, 4.45, 0.07)])
@pytest.mark.parametrize("peak_nm", [500.0, 523.0, 560.0])
def test_alpha_bands_are_those_of_stavenga(peak_nm, chromophore, a0, a1, least):
    """An independent fit to other measurements agrees within 2 and 7 % of the peak (their Table 1; A2 is carp's
    porphyropsin, whose red foot is higher). The other chromophore's template has at least twice the error."""
    theirs = stavenga_1993(NM, peak_nm, a0, a1)
    errors = {}
    for kind in ("A1", "A2"):
        ours = pigment_absorptance(NM * 1e-9, peak_nm * 1e-9, kind)
        errors[kind] = np.abs(ours - theirs)[alpha_band(ours, peak_nm)].max()
    assert errors[chromophore] < least
    assert max(errors.values()) > 2 * errors[chromophore]


@pytest.mark.parametrize(
    ("chromophore", "height", "centre"), [("A1", 0.26, 189 + 0.315 * 560), ("A2", 0.37, 216.7 + 0.287 * 560)]
)
def test_the_beta_band_is_a_gaussian_of_the_published_height_and_place(chromophore, height, centre):
    """Far below the α band of a pigment of 560 nm, only the β band absorbs. The expected values follow from eqs. 5a and
    8a by hand.
    """
    at = pigment_absorptance(np.array([centre]) * 1e-9, 560e-9, chromophore)[0]
    alpha_foot = 0.09  # of the α band there, at most
    assert height <= at <= height + alpha_foot
    if chromophore == "A1":  # width: d = -40.5 + 0.195 λmax = 68.7 nm
        ratio = pigment_absorptance(np.array([centre - 68.7]) * 1e-9, 560e-9)[0] / at
        assert ratio == pytest.approx(np.exp(-1), abs=0.06)


def test_a2_is_broader_and_sees_further_into_the_red():
    a1, a2 = (pigment_absorptance(NM * 1e-9, 560e-9, kind) for kind in ("A1", "A2"))
    assert NM[(a2 > 0.5) & (NM > 560)].max() > NM[(a1 > 0.5) & (NM > 560)].max() + 3


def test_two_values_worked_out_by_hand():
    """λmax = 500 nm at 600 nm, x = 5/6.

    A1: a = 0.8795 + 0.0459 e^(-40000/11940) = 0.8811; e^(69.7 · 0.04777) = 27.93, e^(28 · 0.08867) = 11.97,
        e^(-14.9 · 0.27067) = 0.0177: 1/40.60; β: 346.5 nm, 57 nm wide: e^(-19.8), nothing.
    A2: A = 62.7 + 1.834 e^(-125/54.2) = 62.883, a = 0.875 + 0.0268 e^(-165/40.7) = 0.87547;
        e^(62.883 · 0.04213) = 14.14, e^(20.85 · 0.07677) = 4.956, e^(-10.37 · 0.27897) = 0.0554: 1/19.69.
    """
    at = np.array([600e-9])
    assert pigment_absorptance(at, 500e-9)[0] == pytest.approx(1 / 40.60, rel=2e-3)
    assert pigment_absorptance(at, 500e-9, "A2")[0] == pytest.approx(1 / 19.69, rel=2e-3)


def test_bad_pigments_are_named():
    with pytest.raises(ValueError, match=r"lambda_max_nm = 900: must lie in \[330, 700\]"):
        Pigment(900)
    with pytest.raises(ValueError, match=r"chromophore = 'a2': must be one of 'A1', 'A2'; did you mean 'A2'"):
        Pigment(500, "a2")


def test_nanometres_where_metres_are_wanted_are_named():
    with pytest.raises(ValueError, match=r"wavelength = 530\.0: .* in m \(550 nm is 550e-9\)"):
        Pigment(530).at(530)
