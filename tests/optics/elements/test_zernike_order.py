"""Numberings of Zernike polynomials against the published tables, written out as polynomials."""

import math

import drjit as dr
import numpy as np
import pytest

import optics
from optics.elements.zernike_order import fringe_mode, noll_mode, osa_mode
from tests.optics.device_types import Float64
from validation.reference import noll_index

# R. J. Noll, J. Opt. Soc. Am. 66, 207 (1976), table I: polynomials in polar coordinates, by number.
NOLL = {
    1: lambda r, a: r**0,
    2: lambda r, a: 2 * r * np.cos(a),
    3: lambda r, a: 2 * r * np.sin(a),
    4: lambda r, a: math.sqrt(3) * (2 * r**2 - 1),
    5: lambda r, a: math.sqrt(6) * r**2 * np.sin(2 * a),
    6: lambda r, a: math.sqrt(6) * r**2 * np.cos(2 * a),
    7: lambda r, a: math.sqrt(8) * (3 * r**3 - 2 * r) * np.sin(a),
    8: lambda r, a: math.sqrt(8) * (3 * r**3 - 2 * r) * np.cos(a),
    9: lambda r, a: math.sqrt(8) * r**3 * np.sin(3 * a),
    10: lambda r, a: math.sqrt(8) * r**3 * np.cos(3 * a),
    11: lambda r, a: math.sqrt(5) * (6 * r**4 - 6 * r**2 + 1),
    12: lambda r, a: math.sqrt(10) * (4 * r**4 - 3 * r**2) * np.cos(2 * a),
    13: lambda r, a: math.sqrt(10) * (4 * r**4 - 3 * r**2) * np.sin(2 * a),
    14: lambda r, a: math.sqrt(10) * r**4 * np.cos(4 * a),
    15: lambda r, a: math.sqrt(10) * r**4 * np.sin(4 * a),
    16: lambda r, a: math.sqrt(12) * (10 * r**5 - 12 * r**3 + 3 * r) * np.cos(a),
    17: lambda r, a: math.sqrt(12) * (10 * r**5 - 12 * r**3 + 3 * r) * np.sin(a),
    18: lambda r, a: math.sqrt(12) * (5 * r**5 - 4 * r**3) * np.cos(3 * a),
    19: lambda r, a: math.sqrt(12) * (5 * r**5 - 4 * r**3) * np.sin(3 * a),
    20: lambda r, a: math.sqrt(12) * r**5 * np.cos(5 * a),
    21: lambda r, a: math.sqrt(12) * r**5 * np.sin(5 * a),
    22: lambda r, a: math.sqrt(7) * (20 * r**6 - 30 * r**4 + 12 * r**2 - 1),
}
# J. C. Wyant & K. Creath, Applied Optics and Optical Engineering XI, table IV: the polynomials of the Fringe set. Wyant
# counts from 0, which is the piston, number 1 of the Fringe set.
FRINGE = {
    1: lambda r, a: r**0,
    2: lambda r, a: r * np.cos(a),
    3: lambda r, a: r * np.sin(a),
    4: lambda r, a: 2 * r**2 - 1,
    5: lambda r, a: r**2 * np.cos(2 * a),
    6: lambda r, a: r**2 * np.sin(2 * a),
    7: lambda r, a: (3 * r**2 - 2) * r * np.cos(a),
    8: lambda r, a: (3 * r**2 - 2) * r * np.sin(a),
    9: lambda r, a: 6 * r**4 - 6 * r**2 + 1,
    10: lambda r, a: r**3 * np.cos(3 * a),
    11: lambda r, a: r**3 * np.sin(3 * a),
    12: lambda r, a: (4 * r**2 - 3) * r**2 * np.cos(2 * a),
    13: lambda r, a: (4 * r**2 - 3) * r**2 * np.sin(2 * a),
    14: lambda r, a: (10 * r**4 - 12 * r**2 + 3) * r * np.cos(a),
    15: lambda r, a: (10 * r**4 - 12 * r**2 + 3) * r * np.sin(a),
    16: lambda r, a: 20 * r**6 - 30 * r**4 + 12 * r**2 - 1,
    17: lambda r, a: r**4 * np.cos(4 * a),
    18: lambda r, a: r**4 * np.sin(4 * a),
    19: lambda r, a: (5 * r**2 - 4) * r**3 * np.cos(3 * a),
    20: lambda r, a: (5 * r**2 - 4) * r**3 * np.sin(3 * a),
    21: lambda r, a: (15 * r**4 - 20 * r**2 + 6) * r**2 * np.cos(2 * a),
    22: lambda r, a: (15 * r**4 - 20 * r**2 + 6) * r**2 * np.sin(2 * a),
    23: lambda r, a: (35 * r**6 - 60 * r**4 + 30 * r**2 - 4) * r * np.cos(a),
    24: lambda r, a: (35 * r**6 - 60 * r**4 + 30 * r**2 - 4) * r * np.sin(a),
    25: lambda r, a: 70 * r**8 - 140 * r**6 + 90 * r**4 - 20 * r**2 + 1,
    26: lambda r, a: r**5 * np.cos(5 * a),
    27: lambda r, a: r**5 * np.sin(5 * a),
    28: lambda r, a: (6 * r**2 - 5) * r**4 * np.cos(4 * a),
    29: lambda r, a: (6 * r**2 - 5) * r**4 * np.sin(4 * a),
    36: lambda r, a: 252 * r**10 - 630 * r**8 + 560 * r**6 - 210 * r**4 + 30 * r**2 - 1,
}
RNG = np.random.default_rng(7)
R, ANGLE = np.sqrt(RNG.random(200)), RNG.uniform(-np.pi, np.pi, 200)
X, Y = R * np.cos(ANGLE), R * np.sin(ANGLE)


@pytest.mark.parametrize(
    ("table", "make"),
    [(NOLL, optics.Zernike.from_noll), (FRINGE, optics.Zernike.from_fringe)],
    ids=["noll", "fringe"],
)
def test_polynomials_are_the_published_ones(table, make):
    """Only rounding is allowed for. Polynomials of order 10 have coefficients of up to 630, so they lose three of
    sixteen digits.
    """
    for j, polynomial in table.items():
        np.testing.assert_allclose(make({j: 1.0}).at(X, Y), 1e-6 * polynomial(R, ANGLE), atol=1e-18)
    numbers = RNG.choice(list(table), 5, replace=False).tolist()
    some = dict(zip(numbers, RNG.normal(size=5).tolist(), strict=True))
    right = 1e-6 * sum(value * table[j](R, ANGLE) for j, value in some.items())
    np.testing.assert_allclose(make(some, 2e-3).at(X, Y), right, atol=1e-17)
    row = np.array([some.get(j, 0.0) for j in range(1, max(some) + 1)])
    np.testing.assert_array_equal(make(row, 2e-3).at(X, Y), make(dict(sorted(some.items())), 2e-3).at(X, Y))
    assert make(some, 2e-3).radius == 2e-3


def test_numbers_and_modes_are_one_to_one():
    noll = [noll_mode(j) for j in range(1, 497)]
    assert noll == [noll_index(j) for j in range(1, 497)]
    assert set(noll) == {osa_mode(j) for j in range(496)}
    assert [osa_mode((n * (n + 2) + m) // 2) for n, m in noll] == noll
    fringe = [fringe_mode(j) for j in range(1, 37)]
    # The formula of the Fringe set (Zemax and others), with the sign of 0 counted as positive.
    assert [(1 + (n + abs(m)) // 2) ** 2 - 2 * abs(m) + (m < 0) for n, m in fringe] == list(range(1, 37))


def test_the_orders_differ():
    """The same coefficients in another numbering describe another wavefront. The order must therefore be named."""
    row = [0, 0, 0, 0, 0.1, 0.2]
    kinds = [make(row).modes for make in (optics.Zernike, optics.Zernike.from_noll, optics.Zernike.from_fringe)]
    kept = [{mode: value for mode, value in modes.items() if value} for modes in kinds]
    assert kept[0] == {(2, 2): 0.2, (2, 0): 0.1}
    assert kept[1] == {(2, -2): 0.1, (2, 2): 0.2}
    assert kept[2] == pytest.approx({(2, 2): 0.1 / math.sqrt(6), (2, -2): 0.2 / math.sqrt(6)})


@pytest.mark.parametrize(
    ("make", "given", "says"),
    [
        ("from_noll", {0: 0.1}, r"Noll number = 0: must be a whole number in \[1, 496\]"),
        ("from_noll", {1.5: 0.1}, r"Noll number = 1.5: must be"),
        ("from_fringe", {37: 0.1}, r"Fringe number = 37: must be a whole number in \[1, 36\]"),
        ("from_fringe", np.zeros(37), r"Fringe number = 37: must be"),
        ("from_fringe", {4: math.nan}, r"coefficients_um\[4\] = nan: must be finite"),
        ("from_noll", {(2, 0): 0.1}, r"Noll number = \(2, 0\): must be"),
        ("from_noll", 0.3, r"coefficients_um = 0.3: must be {number: µm}, or a row"),
        ("from_noll", {4: "a"}, r"coefficients_um\[4\] = 'a': must be a number"),
    ],
)
def test_bad_numbers_are_refused(make, given, says):
    with pytest.raises(ValueError, match=says):
        getattr(optics.Zernike, make)(given)


@pytest.mark.parametrize("make", ["from_noll", "from_fringe"])
def test_coefficients_carry_derivatives(make):
    coefficient = Float64(0.1)
    dr.enable_grad(coefficient)
    wavefront = getattr(optics.Zernike, make)({4: coefficient})
    pupil = optics.Pupil(25e-6, thin_lens_focal_length=240e-6, wavefront=wavefront)
    result = optics.psf(pupil, dx=1e-6, shape=(1, 1))
    dr.backward(dr.sum(result.tensor.array))

    def peak(value):
        given = getattr(optics.Zernike, make)({4: value})
        lens = optics.Pupil(25e-6, thin_lens_focal_length=240e-6, wavefront=given)
        return optics.psf(lens, dx=1e-6, shape=(1, 1), dtype="float64", tolerance=1e-8).psf[0, 0, 0]

    # The PSF may be wrong by its tolerance of 1e-3, and its derivative by a few times this.
    assert coefficient.grad[0] == pytest.approx((peak(0.101) - peak(0.099)) / 0.002, rel=1e-2)
