"""PSFs with arbitrary arguments, from an evolution or a user, are finite within their predicted error, or raise a named
error."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import optics
from optics import AccuracyError, BSplineRelief, Eye, Pupil
from tests.slow_part import sweep
from validation.reference import relative_l2

ODD = st.sampled_from([0.0, -1e-6, math.nan, math.inf, 1e-300, 1e-12, 1e-3, 1e6])


def lengths(low, high):
    """Return a strategy that usually draws sensible lengths [m], and sometimes odd ones."""
    return st.one_of(st.floats(low, high), st.floats(low, high), st.floats(low, high), ODD)


def only_one_line(error):
    assert str(error)
    assert "\n" not in str(error)


@sweep(20)
@given(
    a=st.floats(0.03, 1),
    n=st.floats(1, 2),
    fov_deg=st.floats(8, 100),
    width=st.integers(1, 20),
    genes=st.lists(st.floats(0, 1), min_size=16, max_size=16),
)
@example(a=1.0, n=2.0, fov_deg=100.0, width=15, genes=[0, 1] * 8)
@example(a=1.0, n=1.0, fov_deg=45.0, width=15, genes=[0] * 16)
def test_any_genotype_has_a_kernel_or_a_reason(a, n, fov_deg, width, genes):
    relief = BSplineRelief(np.reshape(genes, (4, 4)) * 60e-6)
    eye = Eye(Pupil(a * 100e-6, relief, n=n), resolution=(width, width), fov_deg=fov_deg, bands=1)
    try:
        kernel = eye.kernel(2)
    except AccuracyError as error:
        only_one_line(error)
        return
    assert kernel.dtype == np.float32
    assert kernel.shape[1] == kernel.shape[2] <= 2049
    assert kernel.shape[1] % 2 == 1
    assert np.isfinite(kernel).all()
    assert (kernel >= 0).all()
    assert kernel.sum() < 1.005


@sweep(20)
@given(
    radius=lengths(1e-6, 5e-5),
    distance=lengths(1e-5, 2e-3),
    wavelength=lengths(3e-7, 1e-6),
    dx=lengths(1e-7, 1e-5),
    n=st.floats(0.9, 3),
    sizes=st.tuples(st.integers(-1, 30), st.integers(1, 30)),
)
def test_any_argument_gives_a_finite_psf_or_a_named_error(radius, distance, wavelength, dx, n, sizes):
    try:
        result = optics.psf(Pupil(radius, n=n), [wavelength], distance, dx=dx, shape=sizes, tolerance=1e-2)
    except ValueError as error:
        only_one_line(error)
        return
    assert np.isfinite(result.psf).all()
    assert (result.psf >= 0).all()
    assert 0 < result.plan.predicted_error <= 1e-2


@sweep(20)
@given(
    radius=st.floats(0.5e-6, 8e-6),
    z=st.floats(20e-6, 2e-3),
    n=st.floats(1, 2),
    field_of_view=st.floats(0.05, 0.8),
    height=st.floats(0, 20e-6),
    seed=st.integers(0, 1000),
)
def test_predicted_error_holds(radius, z, n, field_of_view, height, seed):
    relief = np.random.default_rng(seed).random((4, 4)) * height
    pupil, window = Pupil(radius, BSplineRelief(relief), n=n), {"dx": field_of_view * z / 8, "shape": (17, 15)}
    try:
        result = optics.psf(pupil, [550e-9], z, **window, tolerance=3e-3)
    except AccuracyError as error:
        only_one_line(error)
        return
    exact = optics.psf(pupil, [550e-9], z, **window, tolerance=1e-6, method="rayleigh_sommerfeld", dtype="float64")
    assert relative_l2(result.psf, exact.psf) <= result.plan.predicted_error


@pytest.mark.parametrize("radius", [1e-9, 1e-7])
def test_pupils_smaller_than_the_wavelength(radius):
    """For ka ≪ 1, a pinhole radiates with the factor cos²θ of Rayleigh and Sommerfeld's integral: PSF = πa² z² /
    (λρ²)².
    """
    result = optics.psf(Pupil(radius), [550e-9], 1e-3, dx=1e-4, shape=(11, 11), tolerance=1e-2)
    rho2 = result.x**2 + result.y[:, None] ** 2 + 1e-6
    assert relative_l2(result.psf[0], math.pi * radius**2 * 1e-6 / (550e-9 * rho2) ** 2) < 0.02 + (radius / 2e-7) ** 2
