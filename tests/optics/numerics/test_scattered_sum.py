"""Fourier sums over scattered points, against the sums themselves."""

import drjit as dr
import numpy as np
import pytest

from optics.numerics.interpolation import chebyshev_basis, chebyshev_points
from optics.numerics.scattered_sum import ScatteredSum, sums_at
from tests.optics.device_types import Float64


@pytest.mark.parametrize("shape", [(31, 34), (64, 20), (1, 5)])
@pytest.mark.parametrize("span", [0.2, 0.9, 3.0])
def test_sums_are_those_of_the_points(shape, span):
    """The points lie in a part of the period, in nearly all of it, or wrap around it. The error is below the requested
    one, but not much below.
    """
    rng = np.random.default_rng(0)
    p, q = (rng.random((2, 200)) - 0.4) * span
    u = rng.normal(size=(2, 200)) + 1j * rng.normal(size=(2, 200))
    ky, kx = (np.arange(n) - n // 2 for n in shape)
    exact = np.einsum("sj,jy,jx->syx", u, np.exp(2j * np.pi * np.outer(q, ky)), np.exp(2j * np.pi * np.outer(p, kx)))
    errors = []
    for digits in (3, 6, 9):
        found = ScatteredSum(p, q, shape, digits).evaluate(u)
        errors.append(np.abs(found - exact).max() / np.abs(u).sum(axis=1).max())
    assert all(error < 2 * 10.0**-digits for error, digits in zip(errors, (3, 6, 9), strict=True))
    assert errors[0] > 100 * errors[1] > 1e4 * errors[2]


@pytest.mark.parametrize("shape", [(31, 34), (1, 5)])
@pytest.mark.parametrize("span", [0.2, 3.0])
def test_sums_at_points_are_those_of_the_samples(shape, span):
    rng = np.random.default_rng(1)
    p, q = (rng.random((2, 60)) - 0.4) * span
    samples = rng.normal(size=(2, *shape))
    ky, kx = (np.arange(n) - n // 2 for n in shape)
    exact = np.einsum("syx,jy,jx->sj", samples, *(np.exp(2j * np.pi * np.outer(a, k)) for a, k in ((q, ky), (p, kx))))
    errors = []
    for digits in (3, 6, 9):
        found = ScatteredSum(p, q, shape, digits).at(samples)
        errors.append(np.abs(found - exact).max() / np.abs(samples).sum(axis=(1, 2)).max())
    assert all(error < 2 * 10.0**-digits for error, digits in zip(errors, (3, 6, 9), strict=True))
    assert errors[0] > 100 * errors[1] > 1e4 * errors[2]


def test_sums_at_points_carry_derivatives_both_ways():
    """The sum is linear: its forward derivative is the sum itself, and its backward derivative the transpose."""
    rng = np.random.default_rng(2)
    sums = ScatteredSum(rng.random(7), rng.random(7), (4, 5), 12)
    samples, along, weight = Float64(rng.normal(size=40)), rng.normal(size=40), rng.normal(size=(2, 14))
    dr.enable_grad(samples)
    re, im = sums_at(sums, samples)
    dr.backward(dr.sum(re * Float64(weight[0]) + im * Float64(weight[1])))
    expected = sums.at(along.reshape(2, 4, 5)).ravel()
    total = np.dot(weight[0], expected.real) + np.dot(weight[1], expected.imag)
    assert np.dot(samples.grad.numpy(), along) == pytest.approx(total, rel=1e-9)
    dr.set_grad(samples, Float64(along))
    re, im = sums_at(sums, samples)
    dr.forward_to(re, im)
    np.testing.assert_allclose(re.grad.numpy() + 1j * im.grad.numpy(), expected, rtol=1e-9)


def test_chebyshev_basis_is_exact_for_polynomials_and_at_its_own_points():
    x = np.append(np.linspace(-1, 1, 17), chebyshev_points(6))
    polynomial = np.polynomial.Polynomial([1, -2, 0.5, 3, 0, -1])
    np.testing.assert_allclose(chebyshev_basis(x, 6) @ polynomial(chebyshev_points(6)), polynomial(x), atol=1e-13)
