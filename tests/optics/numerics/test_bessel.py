"""Bessel functions against SciPy's."""

import numpy as np
import pytest
from scipy.special import j0, jv

from optics.numerics import bessel
from optics.numerics.bessel import bessel_j, bessel_j0
from optics.numerics.precision import precision


# Rounding of the phase grows with x in float64 too: 2π x 1000 cycles have an ulp of 1e-12.
@pytest.mark.parametrize(
    ("dtype", "exactly", "bound"), [("float32", True, 1e-6), ("float64", True, 3e-15), ("float64", False, 1e-12)]
)
def test_error_is_as_promised(dtype, exactly, bound):
    """The range covers 20 cycles and includes x = 8, at which one series replaces the other."""
    types = precision(dtype)
    waves = np.linspace(0, 20, 20_001)
    found = bessel_j0(types.Float64(waves), types, exactly).numpy()
    assert np.abs(found - j0(2 * np.pi * waves)).max() < bound


def test_what_is_not_exact_is_cheaper_for_a_reason():
    """The shorter series gives other values, so both series are needed."""
    types, waves = precision("float64"), np.linspace(0, 2, 1001)
    exact, near = (bessel_j0(types.Float64(waves), types, exactly).numpy() for exactly in (True, False))
    assert np.abs(exact - near).max() > 1e-15


@pytest.mark.parametrize("few", [bessel.FEW, 0])
def test_whole_orders(few, monkeypatch):
    """Integer orders are computed by sums of cosines, or by SciPy if there are many values."""
    monkeypatch.setattr(bessel, "FEW", few)
    x = np.concatenate([[0.0, 1e-9], np.linspace(0.1, 150, 400)])
    for order in (0, 1, 2, 17, 180):
        assert np.abs(bessel_j(order, x) - jv(order, x)).max() < 5e-15
    orders = np.arange(402.0) // 3
    assert np.abs(bessel_j(orders, x) - jv(orders, x)).max() < 5e-15
