"""The diffraction kernel, and PSFs at coarse tolerances in windows within a few wavelengths of the pupil."""

import math

import numpy as np
import pytest

import optics
from optics import Grid, PointSource
from optics.elements.beam import Beam
from optics.elements.light_stack import LightStack
from optics.methods import slow_factor
from optics.methods.axis_kernel import axis_kernel
from optics.methods.diffraction_kernel import FAR, diffraction_kernel, near_field
from optics.methods.remaining_factor import RemainingFactor
from optics.methods.slow_factor import Path
from optics.methods.window_images import window_image_errors, window_images
from optics.methods.window_plan import WindowPlan
from validation.reference import relative_l2

WAVE = 550e-9


@pytest.mark.parametrize("distance", [0.1e-6, 3e-6, 40e-6, 1.0])
def test_the_kernel_follows_its_definition(distance):
    rng = np.random.default_rng(0)
    xi, eta, x, y = distance * rng.uniform(-1, 1, (4, 50))
    far, rho = np.sqrt((x - xi) ** 2 + (y - eta) ** 2 + distance**2), np.sqrt(x * x + y * y + distance**2)
    k = 2 * math.pi / WAVE
    exact = distance / (WAVE * far**2) * (1 / (k * far) - 1j) * np.exp(1j * k * (far - rho))
    size, waves = diffraction_kernel(WAVE, distance, (xi, eta), (x, y))
    np.testing.assert_allclose(-1j * size * np.exp(2j * np.pi * waves), exact, rtol=1e-5)


def test_the_near_field_is_continuous_where_its_formula_changes():
    ends = [near_field(WAVE, np.array([WAVE / (2 * np.pi * FAR) * side])) for side in (1 - 1e-9, 1 + 1e-9)]
    (size, waves), (far_size, far_waves) = ends
    assert abs(size[0] - far_size) < 6e-6
    assert waves[0] == pytest.approx(far_waves[0], rel=1e-5)


def annulus(z=0.2585e-6, radius=0.0998e-6, height=3.7e-6, inner=0.13, seed=0):
    """A pupil narrower than the wavelength, with the lens and the relief of a random case."""
    relief = optics.BSplineRelief(height * np.random.default_rng(seed).random((4, 4)))
    return optics.Pupil(radius, relief, n=1.65, aperture=optics.Annulus(inner), thin_lens_focal_length=z), z


CASES = [
    ((219, 31), 2.83e-9, 1.3e-2, {}),
    ((31, 219), 2.83e-9, 3e-3, {"seed": 1}),
    ((129, 21), 20e-9, 1e-2, {"z": 2e-6, "radius": 1.5e-6, "seed": 2}),
    ((33, 65), 50e-9, 3e-3, {"z": 4e-6, "radius": 1e-6, "height": 1e-6, "inner": 0.6, "seed": 3}),
]


@pytest.mark.parametrize(("shape", "dx", "tolerance", "pupil"), CASES)
def test_windows_within_a_few_wavelengths(shape, dx, tolerance, pupil):
    """The near field changes over such windows. The direct sum contains it."""
    pupil, z = annulus(**pupil)
    view = {"dx": dx, "shape": shape}
    exact = optics.psf(pupil, [WAVE], z, **view, tolerance=1e-6, method="rayleigh_sommerfeld", dtype="float64").psf[0]
    alone = optics.psf(pupil, [WAVE], z, **view, tolerance=tolerance, method="low_rank")
    batch = optics.psf_batch([pupil], [WAVE], z, **view, tolerance=tolerance)
    assert alone.plan.method == "low_rank"
    for image, plan in ((alone.psf[0], alone.plan), (batch.psf[0, 0, 0], batch.plan)):
        assert relative_l2(image, exact) <= plan.predicted_error <= tolerance


def geometry(shape, dx, tolerance, pupil):
    pupil, z = annulus(**pupil)
    window, stack = Grid(shape, dx), LightStack((Beam(pupil, PointSource(), WAVE, z),))
    return stack, window, WindowPlan(stack, window, np.array([tolerance]))


def test_the_factors_of_the_sums_are_the_whole_kernel():
    """The Fourier kernels, both axis factors and the remaining factor, relative to the middle of the window."""
    stack, window, plan = geometry(*CASES[0])
    samples, _ = plan.samples(np.array([0]))
    path, u, v = Path(stack.wavelength, stack.distance, window), 30e-9, -250e-9
    across, down = (
        axis_kernel(path, samples, axis, np.array([[at]]), "float64") for axis, at in enumerate((u, v))
    )  # (stack, place, sample)
    s, t = samples.at[:, None, :], samples.at[:, :, None]
    place = np.full((1, 1, 1), u), np.full((1, 1, 1), v)
    found = across * down.swapaxes(1, 2) * RemainingFactor(path, samples, (s, t)).at(place)
    parts = [diffraction_kernel(WAVE, stack.distance[0], samples.points_at(s, t), at) for at in (place, (0.0, 0.0))]
    exact, middle = (size * np.exp(2j * np.pi * waves) for size, waves in parts)
    np.testing.assert_allclose(found, exact / middle, rtol=1e-9)


@pytest.mark.parametrize("case", CASES[:2])
def test_the_check_finds_a_missing_near_field(monkeypatch, case):
    """The check follows from the kernel itself, not from the factors of the sums that it judges."""
    (shape, dx, tolerance, _), (stack, window, plan) = case, geometry(*case)
    monkeypatch.setattr(slow_factor, "near_field", lambda wavelength, distance: (1.0, np.zeros_like(distance)))
    samples, finer = plan.samples(np.array([0]))
    image = window_images(stack, samples, int(plan.ranks[0]), bool(plan.crossed[0]), window, "float64")
    [predicted] = window_image_errors(stack, finer, image, window, tolerance)
    pupil, z = stack.beams[0].pupil, float(stack.distance[0])
    exact = optics.psf(pupil, [WAVE], z, dx=dx, shape=shape, tolerance=1e-4, method="rayleigh_sommerfeld").psf[0]
    assert predicted >= relative_l2(image[0] / pupil.area, exact) > tolerance
