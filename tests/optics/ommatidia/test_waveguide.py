"""Modes of a cylinder: against a grid solution of their equation, published cut-offs, and quadrature."""

import math

import numpy as np
import pytest
from scipy.linalg import eigh_tridiagonal

from optics import RefractiveIndex, Waveguide

WAVE = 500e-9


def guide(v, diameter=2e-6):
    """Return a waveguide that has this V at 500 nm."""
    clad = 1.34
    return Waveguide(diameter, math.hypot(clad, v * WAVE / (math.pi * diameter)), clad)


def on_a_grid(l, v, n=6000, end=9.0):
    """Return U of all bound modes by finite differences of √r ψ. They satisfy -ψ'' - ψ'/r + l²ψ/r² + V² ψ = U² ψ, where
    the term V² ψ exists only outside the core.
    """
    h = end / n
    r = (np.arange(n) + 0.5) * h
    outside = np.clip((r + h / 2 - 1) / h, 0, 1)  # share of a cell beyond the edge
    between = (r[:-1] + r[1:]) / 2
    diagonal = 2 / h**2 + l**2 / r**2 + v**2 * outside
    below = -between / (h**2 * np.sqrt(r[:-1] * r[1:]))
    square = eigh_tridiagonal(diagonal, below, eigvals_only=True, select="v", select_range=(0, v**2 * 0.999))
    return np.sqrt(square)


@pytest.mark.parametrize("v", [1.8, 3.0, 5.5, 9.0])
def test_modes_are_those_of_the_wave_equation(v):
    modes = [mode for mode in guide(v).modes(WAVE) if not mode.sine]
    for l in range(max(mode.l for mode in modes) + 2):
        mine = [mode.u for mode in modes if mode.l == l and mode.u < 0.97 * v]
        theirs = [u for u in on_a_grid(l, v) if u < 0.97 * v]
        assert len(mine) == len(theirs), l
        np.testing.assert_allclose(mine, theirs, rtol=1e-3)


def test_cut_offs_are_zeros_of_bessel_functions():
    """The cut-offs are 2.405 for LP11, 3.832 for LP21 and LP02, 5.136 for LP31, and 5.520 for LP12 (Gloge 1971). (Just
    above its cut-off, LP02 is too wide to be detected.)
    """
    names = {"11": 2.4048, "21": 3.8317, "02": 3.8317, "31": 5.1356, "12": 5.5201}
    for name, v in names.items():
        below, above = ({f"{m.l}{m.m}" for m in guide(at).modes(WAVE)} for at in (v - 0.003, v + 0.1))
        assert name in above - below
    assert len(guide(0.5).modes(WAVE)) == 1
    assert [mode.sine for mode in guide(3.0).modes(WAVE)] == [False, False, True]


def test_modes_are_orthonormal_and_their_core_share_is_what_lies_in_it():
    modes = guide(6.0).modes(WAVE)
    x, w = np.polynomial.legendre.leggauss(120)
    parts = [((high - low) * (x + 1) / 2 + low, (high - low) * w / 2) for low, high in ((0, 1e-6), (1e-6, 2e-5))]
    r, weight = (np.concatenate(column) for column in zip(*parts, strict=True))
    phi = 2 * np.pi * np.arange(32) / 32
    fields = np.array([mode.field(np.outer(r, np.cos(phi)), np.outer(r, np.sin(phi))).ravel() for mode in modes])
    area = np.repeat(weight * r * 2 * np.pi / 32, 32)
    np.testing.assert_allclose(fields * area @ fields.T, np.eye(len(modes)), atol=2e-5)
    core = np.repeat(r <= 1e-6, 32)
    np.testing.assert_allclose((fields**2 * area * core).sum(axis=1), [m.core_share for m in modes], atol=2e-5)


def test_fields_go_smoothly_through_the_edge():
    edge, step = 1e-6, 1e-11
    for mode in guide(4.5).modes(WAVE):
        if not mode.sine:
            before, here, after = mode.field(edge + step * np.arange(-1, 2), 0.0)
            assert abs(before - 2 * here + after) < 1e-4 * abs(after - before)


def test_the_fundamental_mode_is_nearly_gaussian():
    """The overlap with a Gaussian of width w/b = 0.65 + 1.619 V^-1.5 + 2.879 V^-6 (Marcuse 1977) is above 0.99."""
    v = 2.4
    [mode] = guide(v).modes(WAVE)
    waist = 1e-6 * (0.65 + 1.619 * v**-1.5 + 2.879 * v**-6)
    r = np.linspace(0, 8e-6, 4000)
    gauss = math.sqrt(2 / math.pi) / waist * np.exp(-((r / waist) ** 2))
    assert np.trapezoid(mode.field(r, 0.0) * gauss * 2 * np.pi * r, r) ** 2 > 0.99


def test_absorption_goes_with_the_share_in_the_core():
    long = Waveguide(2e-6, length=200e-6, absorption=5e3)
    mode = long.modes(WAVE)[0]
    assert long.absorbed(mode) == pytest.approx(1 - math.exp(-1.0 * mode.core_share))
    assert Waveguide(2e-6).absorbed(mode) == 1


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Waveguide(0), "diameter = 0"),
        (lambda: Waveguide(2e-6, n_core=0.9), "n_core = 0.9"),
        (lambda: Waveguide(2e-6, 1.33, 1.34).modes(WAVE), "n_core = 1.33 at 5e-07 m"),
        (lambda: Waveguide(2e-3).modes(WAVE), "for a diameter in m"),
        (lambda: Waveguide(2e-6).modes(500), "wavelength = 500"),
        (lambda: Waveguide(2e-6, length=-1), "length = -1"),
        (lambda: Waveguide(2e-6, absorption=math.nan), "absorption = nan"),
        (lambda: Waveguide(2e-6, n_core="glass"), "n_core = 'glass'"),
    ],
)
def test_bad_input_names_itself(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_indices_may_disperse():
    core = RefractiveIndex(1.35, 3e-15)
    assert Waveguide(2e-6, core, 1.34).v_number(400e-9) == pytest.approx(
        math.pi * 2e-6 / 400e-9 * math.sqrt((1.35 + 3e-15 / 400e-9**2) ** 2 - 1.34**2)
    )
