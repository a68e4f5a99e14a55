"""Limits of acuity: Snyder's eye parameter, lattices of receptors, and an ideal observer against random draws."""

import math

import numpy as np
import pytest

import optics
from optics import (
    anatomical_acuity,
    eye_parameter,
    ideal_contrast_sensitivity,
    least_eye_parameter,
    mean_human_mtf,
    sampling_acuity,
)


def test_the_least_eye_parameter_is_snyders():
    """The least eye parameter is D Δφ = 0.58 λ (Snyder, J. Comp. Physiol. 116, 161, 1977)."""
    assert least_eye_parameter(500e-9) == pytest.approx(0.58 * 500e-9, rel=5e-3)
    assert least_eye_parameter(500e-9, "square") == 250e-9


@pytest.mark.parametrize("lattice", ["hexagon", "square"])
def test_at_the_least_parameter_lattice_and_facet_stop_at_the_same_grating(lattice):
    diameter = 30e-6
    spacing = math.degrees(least_eye_parameter(500e-9, lattice) / diameter)
    assert eye_parameter(diameter, spacing) == pytest.approx(least_eye_parameter(500e-9, lattice))
    cutoff = math.radians(diameter / 500e-9)  # D/λ, in cycles per degree
    assert sampling_acuity(spacing, lattice) == pytest.approx(cutoff)


def test_a_hexagonal_lattice_resolves_finer_gratings_than_a_square_one_of_equal_density():
    """The ratio is (4/3)^¼ = 1.075, because the reciprocal lattice of a hexagonal one is hexagonal."""
    ratio = anatomical_acuity(1e11, 16.7e-3) / anatomical_acuity(1e11, 16.7e-3, "square")
    assert ratio == pytest.approx((4 / 3) ** 0.25)


def test_a_lattice_of_points_aliases_beyond_its_acuity():
    """Along the normal of the lattice's rows, the sum of exp(2πi k·x) over the lattice has its first peak at twice the
    acuity.
    """
    points = optics.hexagonal_directions(12, 1.0)
    finest = sampling_acuity(1.0)
    frequencies = np.linspace(0.5, 2.2, 341) * finest
    sums = np.abs(np.exp(2j * np.pi * np.outer(frequencies, np.degrees(points[:, 1]))).mean(axis=1))
    assert frequencies[sums.argmax()] == pytest.approx(2 * finest, rel=0.01)


def test_an_ideal_observer_detects_at_the_predicted_threshold():
    """An observer who compares the likelihoods of random photon counts picks the right one of two intervals in 75 % of
    the trials at the threshold.
    """
    rng = np.random.default_rng(3)
    x = np.arange(64) / 64 * 4 * 2 * np.pi
    grating, mean = np.tile(np.sin(x), (16, 1)), 40.0
    photons, area, transfer = mean * grating.size, 1.0, 0.6
    threshold = 1 / float(ideal_contrast_sensitivity(4.0, transfer, photons, area))
    signal = mean * (1 + threshold * transfer * grating)
    weights = np.log(signal / mean)
    with_grating = (rng.poisson(signal, (4000, *signal.shape)) * weights).sum(axis=(1, 2))
    without = (rng.poisson(np.full_like(signal, mean), (4000, *signal.shape)) * weights).sum(axis=(1, 2))
    assert np.mean(with_grating > without) == pytest.approx(0.75, abs=0.02)


def test_the_sensitivity_grows_with_the_root_of_light_and_falls_with_the_contrast():
    u = np.array([5.0, 20.0])
    dim = ideal_contrast_sensitivity(u, mean_human_mtf(u, 2e-3), 1e6, (7.5 / u) ** 2)
    bright = ideal_contrast_sensitivity(u, mean_human_mtf(u, 2e-3), 1e8, (7.5 / u) ** 2)
    np.testing.assert_allclose(bright, 10 * dim)
    ratio = mean_human_mtf(u, 2e-3)[0] / mean_human_mtf(u, 2e-3)[1] * 4
    assert dim[0] / dim[1] == pytest.approx(ratio)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: eye_parameter(-1e-6, 1.0), "diameter"),
        (lambda: eye_parameter(1e-6, 200.0), "interommatidial_deg"),
        (lambda: sampling_acuity(0.0), "spacing_deg"),
        (lambda: sampling_acuity(1.0, "triangle"), "lattice"),
        (lambda: anatomical_acuity(0.0, 1e-3), "density"),
        (lambda: anatomical_acuity(1e11, -1e-3), "nodal_distance"),
        (lambda: ideal_contrast_sensitivity([1.0, 2.0], [0.5], 1e6, 1.0), "contrast"),
        (lambda: ideal_contrast_sensitivity([1.0], [1.5], 1e6, 1.0), "contrast"),
        (lambda: ideal_contrast_sensitivity([1.0], [0.5], 0.0, 1.0), "photons"),
        (lambda: ideal_contrast_sensitivity([-1.0], [0.5], 1e6, 1.0), "cycles_per_degree"),
    ],
)
def test_invalid_arguments_raise(call, message):
    with pytest.raises(ValueError, match=message):
        call()
