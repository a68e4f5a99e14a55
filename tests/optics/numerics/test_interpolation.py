"""Interpolation in a table: accurate to the tolerance, of sixth order, constant beyond the ends, differentiable."""

import numpy as np
import pytest
from scipy.special import erf

import optics.numerics.interpolation
from optics.numerics.interpolation import Interpolant
from optics.numerics.precision import precision

TYPES = precision("float64")
PLACES = np.linspace(-1.2, 1.2, 4001)


def step(x):
    return erf(12 * x)


def values(table):
    return table.at(TYPES.Float64(PLACES), TYPES).numpy()


@pytest.mark.parametrize("error", [1e-3, 1e-6, 1e-9])
def test_as_exact_as_asked(error):
    table = Interpolant.from_function(lambda x: np.asarray(step(x)), (-1.0, 1.0), 24.0, error)
    assert np.abs(values(table) - step(PLACES)).max() < error


def test_sixth_order():
    def error(n):
        h = 2 / (n - 1)
        samples = step(
            -1 + h * np.arange(-optics.numerics.interpolation.MARGIN, n + optics.numerics.interpolation.MARGIN)
        )
        return np.abs(values(Interpolant(-1.0, h, samples)) - step(PLACES)).max()

    assert np.log2(error(101) / error(201)) == pytest.approx(6, abs=0.3)


def test_slope():
    import drjit as dr

    table = Interpolant.from_function(lambda x: np.asarray(step(x)), (-1.0, 1.0), 24.0, 1e-9)
    x = TYPES.Float64(PLACES)
    dr.enable_grad(x)
    dr.backward(dr.sum(table.at(x, TYPES)))
    slope = 12 * 2 / np.sqrt(np.pi) * np.exp(-((12 * PLACES) ** 2))
    assert np.abs(dr.grad(x).numpy() - slope).max() < 1e-6 * slope.max()
