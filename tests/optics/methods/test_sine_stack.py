"""Samples of several pupils: equal to those of single pupils, and paths interpolated from a few points."""

import math
from dataclasses import replace

import numpy as np
import pytest

import optics
from optics import Grid, PointSource
from optics.elements.beam import Beam
from optics.elements.light_stack import LightStack
from optics.methods import axis_kernel as axis_kernel_module
from optics.methods import sine_stack
from optics.methods.axis_kernel import axis_kernel, window_kernel
from optics.methods.remaining_factor import RemainingFactor
from optics.methods.slow_factor import Path, cross_term
from optics.methods.window_images import window_images
from optics.methods.window_plan import WindowPlan
from optics.numerics.grid import sample_positions

Z, WAVE = 240e-6, 550e-9


def stack_of(*radii, aperture=None, **options):
    rng = np.random.default_rng(1)
    pupils = [
        optics.Pupil(
            r, optics.BSplineRelief(1e-6 * rng.random((4, 4))), aperture=aperture or optics.Circle(), **options
        )
        for r in radii
    ]
    return LightStack(tuple(Beam(pupil, PointSource(3e-3), WAVE, Z) for pupil in pupils))


def planned(stack, window, tolerance=1e-2):
    plan = WindowPlan(stack, window, np.full(len(stack.beams), tolerance))
    return plan.samples(np.array([0]))[0], plan


@pytest.mark.parametrize("centre", [(0.0, 0.0), (9e-6, -5e-6)])
@pytest.mark.parametrize("aperture", [optics.Annulus(0.4), optics.Polygon.regular(5)])
def test_the_contribution_of_a_sample_is_the_diffraction_kernel_times_its_light(centre, aperture):
    """The kernel is z/(λD²) (1/(kD) - i) e^{ik(D - ρ)}. The area of a sample is (z/cos²θ)² ds dt."""
    stack = stack_of(20e-6, aperture=aperture)
    samples, _ = planned(stack, Grid((33, 33), 0.5e-6, centre))
    x, y = samples.points
    far, rho = np.sqrt((x - centre[0]) ** 2 + (y - centre[1]) ** 2 + Z**2), math.hypot(*centre, Z)
    k = 2 * np.pi / WAVE
    soft = sine_stack._transmittance(samples.edges[0], x / 20e-6, y / 20e-6)
    area = (far**2 / Z * samples.pitch[0]) ** 2
    kernel = Z / (WAVE * far**2) * (1 / (k * far) - 1j) * np.exp(1j * k * (far - rho))
    light = stack.beams[0].waves(x[0], y[0])[None]
    expected = soft * area * kernel * np.exp(2j * np.pi * light)
    found = samples.arriving(stack, "float64")
    found *= np.vdot(found, expected) / abs(np.vdot(found, expected))
    assert np.linalg.norm(found - expected) < 3e-4 * np.linalg.norm(expected)
    light = soft * area * np.exp(2j * np.pi * light) * samples.to_middle(WAVE, "float64")
    light *= np.vdot(light, expected) / abs(np.vdot(light, expected))
    np.testing.assert_allclose(light, expected, atol=1e-9 * np.abs(expected).max())


def test_interpolated_paths_and_kernels_are_exact(monkeypatch):
    stack, window = stack_of(45e-6), Grid((65, 65), 0.25e-6)
    samples, _ = planned(stack, window)
    path = Path(stack.wavelength, stack.distance, window)
    np.testing.assert_allclose(samples._waves(stack), samples._paths(stack, *samples.points), atol=3e-5)
    place = sample_positions(65, window.dx)[None]
    exact = axis_kernel(path, samples, 0, place, "float64")
    np.testing.assert_allclose(window_kernel(path, samples, 0, "float64"), exact, atol=1e-6)
    monkeypatch.setattr(axis_kernel_module, "SMOOTH", 3)
    assert np.abs(window_kernel(path, samples, 0, "float64") - exact).max() > 1e-4


def test_the_whole_kernel_is_the_product_of_its_factors():
    """The kernels along both axes and the remaining factor, relative to the middle of the window."""
    stack, window = stack_of(45e-6), Grid((9, 9), 2e-6, (3e-6, -2e-6))
    samples, _ = planned(stack, window)
    path, (u, v) = Path(stack.wavelength, stack.distance, window), (5e-6, -7e-6)
    at = samples.at[0, 5::9]
    s, t = at[None, None, :], at[None, :, None]
    x, y = samples.points_at(s, t)

    def kernel(u, v):
        far = np.sqrt((x - u - 3e-6) ** 2 + (y - v + 2e-6) ** 2 + Z**2)
        rho = math.hypot(u + 3e-6, v - 2e-6, Z)
        return (Z / far) ** 2 * (1 + 1j * WAVE / (2 * np.pi * far)) * np.exp(2j * np.pi / WAVE * (far - rho))

    across, down = (
        axis_kernel(path, samples, axis, np.array([[at]]), "float64")[:, 0, 5::9] for axis, at in enumerate((u, v))
    )
    place = np.full((1, 1, 1), u), np.full((1, 1, 1), v)
    remaining = RemainingFactor(path, samples, (s, t)).at(place)
    found = across[:, None, :] * down[:, :, None] * remaining
    np.testing.assert_allclose(found, kernel(u, v) / kernel(0, 0), atol=1e-9)


def test_the_cross_term_is_most_of_the_remaining_factor():
    stack, window = stack_of(55e-6), Grid((65, 65), 0.25e-6)
    samples, plan = planned(stack, window)
    assert plan.crossed[0]
    assert plan.ranks[0] == 1
    rng = np.random.default_rng(0)
    s, t = rng.uniform(-0.15, 0.15, (2, 1, 500))
    place = rng.uniform(-8e-6, 8e-6, (2, 1, 500))
    path = Path(stack.wavelength, stack.distance, window)
    remaining = RemainingFactor(path, samples, (s, t)).at(tuple(place))
    a, b = cross_term(path, samples, (s, t), tuple(place))
    apart, without = (remaining * np.exp(-1j * np.angle(remaining.mean())) - at for at in (1 + a * b, 1))
    assert np.linalg.norm(apart) < 0.6 * np.linalg.norm(without)
    with_it, bare, fine = (
        window_images(stack, samples, rank, crossed, window, "float64")
        for rank, crossed in ((1, True), (1, False), (5, False))
    )
    errors = [np.linalg.norm(image - fine) / np.linalg.norm(fine) for image in (with_it, bare)]
    assert errors[0] < 0.6 * errors[1] < 2e-2


def test_pupils_with_different_edges_share_a_stack():
    stack, window = stack_of(15e-6, 16e-6, 40e-6), Grid((33, 33), 0.4e-6)
    plan = WindowPlan(stack, window, np.full(3, 1e-2))
    alone = [planned(stack.part([k]), window)[0] for k in range(3)]
    for k in range(3):
        [samples, _] = plan.samples(np.array([k]))
        np.testing.assert_allclose(
            samples.arriving(stack.part([k]), "float64"), alone[k].arriving(stack.part([k]), "float64")
        )


def test_the_edge_of_a_distant_pupil_is_sharp_in_float32():
    """The radii of samples do not follow from squared cosines, which float32 rounds to 1 within a few digits."""
    stack = stack_of(20e-6, aperture=optics.Annulus(0.4))
    [beam] = stack.beams
    stack = LightStack((replace(beam, distance=10e-3),))
    samples, _ = planned(stack, Grid((33, 33), 10e-6), 1e-3)
    single, double = (samples._sizes(dtype) for dtype in ("float32", "float64"))
    np.testing.assert_allclose(single, double, atol=3e-4 * double.max())
