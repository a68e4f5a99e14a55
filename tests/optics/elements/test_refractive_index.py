"""Cauchy's equation and the Abbe number."""

import math

import pytest

from optics import RefractiveIndex
from optics.elements.refractive_index import LINE_C, LINE_D, LINE_F


def test_constant_index():
    assert RefractiveIndex(1.5).at(400e-9) == RefractiveIndex(1.5).at(700e-9) == 1.5


@pytest.mark.parametrize(("n_d", "abbe_number"), [(1.5168, 64.17), (1.62, 36.3), (1.34, 55.0)])
def test_abbe_number_comes_back(n_d, abbe_number):
    glass = RefractiveIndex.from_abbe(n_d, abbe_number)
    assert glass.at(LINE_D) == pytest.approx(n_d, rel=1e-12)
    assert (glass.at(LINE_D) - 1) / (glass.at(LINE_F) - glass.at(LINE_C)) == pytest.approx(abbe_number, rel=1e-9)
    assert glass.at(400e-9) > glass.at(700e-9)


def test_infinite_abbe_number_is_no_dispersion():
    assert RefractiveIndex.from_abbe(1.5, math.inf) == RefractiveIndex(1.5)


def test_index_below_one_is_refused():
    with pytest.raises(ValueError, match=r"n = 0\.9"):
        RefractiveIndex(0.9)
    with pytest.raises(ValueError, match="at least 1"):
        RefractiveIndex(1.1, -1e-13).at(400e-9)


def test_square_micrometres_are_told_from_square_metres():
    with pytest.raises(
        ValueError, match=r"n = 1\.38843e\+10 at wavelength 5\.5e-07 m: must be at most 10 \(b is in m²"
    ):
        RefractiveIndex(1.5, 4.2e-3).at(550e-9)
