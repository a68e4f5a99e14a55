"""Node counts are sufficient, and one node fewer is not."""

import numpy as np
import pytest
from scipy.special import jv, roots_legendre

from optics.numerics import quadrature
from optics.numerics.bessel import bessel_j
from optics.numerics.quadrature import gauss_legendre, gauss_legendre_count, harmonics, stepped_up


@pytest.mark.parametrize("digits", [1, 3, 8, 12])
def test_harmonics_are_the_fewest(digits):
    z = np.concatenate([[0, 1e-6, 1e-2], np.geomspace(0.1, 3000, 60)])
    m = harmonics(z, digits)
    assert (2 * np.abs(jv(m, z)) <= 10.0**-digits).all()
    below = m > np.floor(z) + 1  # the search starts at z
    assert below.sum() > 40
    assert (2 * np.abs(jv(m - 1, z)) > 10.0**-digits)[below].all()


@pytest.mark.parametrize("digits", [3, 8, 12])
def test_two_bessel_functions_find_most_harmonics(digits, monkeypatch):
    """The planner asks for thousands of numbers. Bisection needs six to eleven Bessel functions for each."""
    calls = []
    monkeypatch.setattr(quadrature, "bessel_j", lambda m, z: calls.append(m) or bessel_j(m, z))
    arguments = np.geomspace(10, 3000, 40)
    for z in arguments:
        harmonics(z, digits)
    assert len(calls) < 2.5 * len(arguments)


@pytest.mark.parametrize("digits", [3, 6, 9, 12])
@pytest.mark.parametrize("cycles", [0.1, 1.0, 7.0, 60.0])
def test_gauss_legendre_count(cycles, digits):
    def error(n):
        x, weight = gauss_legendre(n)
        f = np.linspace(0, cycles, 100)
        return np.abs(np.exp(2j * np.pi * np.outer(f, x - 0.5)) @ weight - np.sinc(f)).max()

    n = gauss_legendre_count(cycles, digits)
    assert error(n) < 10.0**-digits
    assert error(int(0.8 * n)) > 10.0**-digits


def test_steps_up_are_few_small_and_never_down():
    cycles = np.geomspace(0.01, 100, 2000)
    stepped = np.array([stepped_up(each) for each in cycles])
    assert (stepped >= (1 - 1e-9) * cycles).all()
    assert (stepped < 1.05 * cycles).all()
    assert len(set(stepped)) < 220  # 13.3 octaves of 16 steps, for 2000 requested values
    assert all(stepped_up(each) == pytest.approx(each, rel=1e-9) for each in set(stepped))
    assert stepped_up(0.0) == 0.0


@pytest.mark.parametrize("n", [1, 2, 3, 10, 51, 300, 3000])
def test_gauss_legendre_is_exact(n):
    """Nodes agree with SciPy's; polynomials of degree 2n - 1 are integrated exactly, and polynomials of degree 2n are
    not."""
    x, weight = gauss_legendre(n)
    np.testing.assert_allclose(x, (roots_legendre(n)[0] + 1) / 2, atol=4e-16)
    for degree in {0, 1, min(n, 40), 2 * n - 1}:
        assert weight @ x**degree == pytest.approx(1 / (degree + 1), rel=1e-12)
    if n <= 10:
        assert weight @ x ** (2 * n) != pytest.approx(1 / (2 * n + 1), rel=1e-12)
