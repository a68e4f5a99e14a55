"""Tables of spectra: frozen values against colour-science, interpolation, bad tables."""

import numpy as np
import pytest

from optics import Spectrum, illuminant, reflectance
from optics.spectra.spectrum import ILLUMINANTS, REFLECTANCES, cie_1931, cone_fundamentals, daylight
from validation.optics import freeze_spectra

VISIBLE = np.arange(380.0, 781.0, 5.0)


@pytest.fixture(scope="module")
def colour():
    return pytest.importorskip("colour")


def at(distribution, nm):
    """Return the values of a table of colour-science at wavelengths that it contains."""
    return np.array([distribution[float(x)] for x in nm])


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", [n for n in ILLUMINANTS if n != "E"])
def test_illuminants_are_those_of_colour_science(colour, name):
    theirs = colour.SDS_ILLUMINANTS[name]
    nm = np.array([x for x in np.arange(300.0, 781.0, 5.0) if theirs.shape.start <= x <= theirs.shape.end])
    expected = at(theirs, nm)
    np.testing.assert_allclose(illuminant(name).at(nm * 1e-9), expected / theirs[560.0], rtol=2e-5, atol=1e-9)
    dark = np.arange(300.0, nm[0], 5.0)
    assert not illuminant(name).at(dark * 1e-9).any()


@pytest.mark.filterwarnings("ignore")
def test_reflectances_are_those_of_colour_science(colour):
    chart = colour.SDS_COLOURCHECKERS["ColorChecker N Ohta"]
    theirs = {name.split(" (")[0].replace(" 9.5", "").replace("black 2", "black"): sd for name, sd in chart.items()}
    assert set(theirs) == set(REFLECTANCES)
    for name in REFLECTANCES:
        np.testing.assert_allclose(reflectance(name).at(VISIBLE * 1e-9), at(theirs[name], VISIBLE), atol=1e-9)


@pytest.mark.filterwarnings("ignore")
def test_cone_fundamentals_are_those_of_colour_science(colour):
    """The tables of colour-science refer to energy. Divided by λ, and scaled to a peak of 1, they refer to photons."""
    theirs = colour.MSDS_CMFS["Stockman & Sharpe 2 Degree Cone Fundamentals"]
    nm = np.arange(390.0, 781.0, 5.0)
    energy = np.array([theirs[float(x)] for x in nm])
    fine = np.arange(390.0, 781.0)
    for kind, column, peak in zip(cone_fundamentals(), energy.T, (566, 541, 441), strict=True):
        quantal = column / nm
        np.testing.assert_allclose(kind.at(nm * 1e-9), quantal / quantal.max(), rtol=1e-6, atol=1e-12)
        assert abs(kind.peak_nm - peak) < 4  # published peaks, up to the table's 5 nm
        assert not kind.at(np.array([350e-9]))
    # Linear interpolation between entries has an error of h²/8 of the curvature: σ is some 40 nm, so 2e-3.
    exact = np.array([theirs[float(x)] for x in fine])[:, 0] / fine
    np.testing.assert_allclose(cone_fundamentals()[0].at(fine * 1e-9), exact / (exact.max()), atol=3e-3)


@pytest.mark.usefixtures("colour")
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", freeze_spectra.TABLES)
def test_tables_are_what_the_script_makes(name):
    """Files agree byte for byte, with the original version of colour-science or one with the same numbers."""
    assert freeze_spectra.text(freeze_spectra.TABLES[name]()) == (freeze_spectra.DATA / name).read_text()


def test_daylight_reaches_into_the_ultraviolet():
    """CIE 15's table of D65: 0.0341 at 300 nm and 44.9117 at 350 nm, relative to 100 at 560 nm."""
    np.testing.assert_allclose(daylight(np.array([300e-9, 350e-9, 560e-9])), [3.41e-4, 0.449117, 1.0], rtol=1e-6)
    assert not cie_1931(np.array([300e-9, 340e-9])).any()


def test_a_spectrum_is_linear_inside_and_constant_outside():
    spectrum = Spectrum((400, 500), (0.2, 0.6))
    np.testing.assert_allclose(spectrum.at(np.array([300, 400, 425, 500, 700]) * 1e-9), [0.2, 0.2, 0.3, 0.6, 0.6])
    assert spectrum == Spectrum(np.array([400.0, 500.0]), [0.2, 0.6])
    assert hash(spectrum) == hash(Spectrum((400, 500), (0.2, 0.6)))


@pytest.mark.parametrize(
    ("nm", "values", "named"),
    [
        ((500, 400), (1, 1), "wavelengths_nm: must rise from one entry to the next, from 1 nm on"),
        ((400, 500), (1, 1, 1), "values: 3 for 2 wavelengths_nm"),
        ((400e-9, 500e-9), (1, 1), "wavelengths_nm: must rise .* from 1 nm on"),
        ((400, 500), (1, -1), "values hold -1"),
        ((400, 500), (1, np.nan), "values: must be a row of finite numbers"),
        ((), (), "wavelengths_nm: must be a row"),
        ((400, 500), "ab", "values: must be a row"),
    ],
)
def test_bad_tables_are_named(nm, values, named):
    with pytest.raises(ValueError, match=named):
        Spectrum(nm, values)


def test_unknown_names_come_with_the_nearest():
    with pytest.raises(ValueError, match=r"illuminant = 'D66'.*did you mean 'D.5'"):
        illuminant("D66")
    with pytest.raises(ValueError, match=r"reflectance = 'folage'.*did you mean 'foliage'"):
        reflectance("folage")
