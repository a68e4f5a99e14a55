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


def test_acuity_in_closed_form():
    assert sampling_acuity(0.25) == pytest.approx(4 / math.sqrt(3))
    assert sampling_acuity(0.25, "square") == 2.0
    assert eye_parameter(30e-6, 0.5) == pytest.approx(30e-6 * math.radians(0.5))
    assert eye_parameter(30e-6, 180.0) == pytest.approx(30e-6 * math.pi)
    degrees = math.degrees(2e-6 / 1e-2)  # between neighbours at a distance of 2 µm
    assert anatomical_acuity(1 / 4e-12, 1e-2, "square") == pytest.approx(1 / (2 * degrees))
    hexagons = 2 / math.sqrt(3) / 4e-12
    assert anatomical_acuity(hexagons, 1e-2) == pytest.approx(1 / (math.sqrt(3) * degrees))
    with pytest.raises(ValueError, match=r"interommatidial_deg = 180.1"):
        eye_parameter(30e-6, 180.1)
    for call in (least_eye_parameter, lambda at, lattice: anatomical_acuity(at, 1.0, lattice)):
        with pytest.raises(ValueError, match="lattice = 'triangle'"):
            call(5e-7, "triangle")


def test_sensitivity_in_closed_form():
    u, transfer = np.array([0.0, 2.0]), np.array([1.0, 0.0])
    for area in (8.0, np.array([8.0, 0.0])):
        found = ideal_contrast_sensitivity(u, transfer, 9.0, area, 3.0)
        np.testing.assert_allclose(found, [2.0, 0.0])
    assert ideal_contrast_sensitivity(0.0, 0.5, 9.0, 8.0) == pytest.approx(3 / 0.954)
    assert ideal_contrast_sensitivity([], [], 9.0, 8.0).shape == (0,)
    for given, name in (
        (([-0.1, 2.0], [1.0, 0.0], 9.0, 8.0), "cycles_per_degree = -0.1"),
        (([0.0, 2.0], [1.0, -0.1], 9.0, 8.0), "contrast = -0.1"),
        (([0.0, 2.0], [1.01, 0.0], 9.0, 8.0), "contrast = 1.01"),
        (([0.0, 2.0], [1.0, 0.0], 9.0, -0.1), "area = -0.1"),
        (([0.0, 2.0], [1.0, 0.0], 9.0, [1.0, 2.0, 3.0]), r"contrast has shape \(2,\) and area \(3,\): must be \(2,\)"),
        (([0.0, 2.0], [1.0, 0.0], 9.0, 8.0, 0.0), "d_prime = 0"),
    ):
        with pytest.raises(ValueError, match=f"^{name}"):
            ideal_contrast_sensitivity(*given)
