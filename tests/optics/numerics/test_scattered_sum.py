"""Fourier sums over scattered points, against the sums themselves."""

import numpy as np
import pytest

from optics.numerics.interpolation import chebyshev_basis, chebyshev_points
from optics.numerics.scattered_sum import ScatteredSum


@pytest.mark.parametrize("shape", [(31, 34), (64, 20), (1, 5)])
@pytest.mark.parametrize("span", [0.2, 0.9, 3.0])
def test_sums_are_those_of_the_points(shape, span):
    """Within a part of the period, nearly all of it, and wrapped around it; digits as asked, and not by luck more."""
    rng = np.random.default_rng(0)
    p, q = (rng.random((2, 200)) - 0.4) * span
    u = rng.normal(size=(2, 200)) + 1j * rng.normal(size=(2, 200))
    ky, kx = (np.arange(n) - n // 2 for n in shape)
    exact = np.einsum("sj,jy,jx->syx", u, np.exp(2j * np.pi * np.outer(q, ky)), np.exp(2j * np.pi * np.outer(p, kx)))
    errors = []
    for digits in (3, 6, 9):
        found = ScatteredSum(p, q, shape, digits).of(u)
        errors.append(np.abs(found - exact).max() / np.abs(u).sum(axis=1).max())
    assert all(error < 2 * 10.0**-digits for error, digits in zip(errors, (3, 6, 9), strict=True))
    assert errors[0] > 100 * errors[1] > 1e4 * errors[2]


def test_chebyshev_basis_is_exact_for_polynomials_and_at_its_own_points():
    x = np.append(np.linspace(-1, 1, 17), chebyshev_points(6))
    polynomial = np.polynomial.Polynomial([1, -2, 0.5, 3, 0, -1])
    np.testing.assert_allclose(chebyshev_basis(x, 6) @ polynomial(chebyshev_points(6)), polynomial(x), atol=1e-13)
