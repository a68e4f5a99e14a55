"""Ray density and pinhole: shadows, power, order, and their limits."""

import math

import numpy as np
import pytest

import optics
from optics import BSplineRelief, Polygon, Pupil
from optics.methods import geometric
from tests.optics.device_types import Float64
from tests.optics.methods.approximations import predicted_and_actual, random_case
from validation.reference import order_of_convergence, relative_l2

WAVELENGTH = 550e-9


@pytest.mark.parametrize("aperture", [optics.Circle(), optics.Annulus(0.5), Polygon.regular(6)])
def test_a_flat_pupil_throws_its_shadow(aperture):
    """The PSF is 1/area if a straight line back hits the opening and 0 otherwise, except for the two cells that a splat
    covers."""
    pupil, z, angle = Pupil(30e-6, aperture=aperture), 50e-6, 0.3
    found = optics.psf(pupil, [WAVELENGTH], z, source_angle=(angle, 0.0), dx=1e-6, shape=(121, 121), method="geometric")
    x, y = np.meshgrid((found.x - z * math.tan(angle)) / 30e-6, found.y / 30e-6)
    near = [aperture.contains(x + i / 30, y + j / 30) for i in range(-2, 3) for j in range(-2, 3)]
    inside, outside = np.all(near, axis=0), ~np.any(near, axis=0)
    assert inside.sum() > 500
    np.testing.assert_allclose(found.psf[0][inside] * pupil.area, 1, atol=0.02)
    assert np.all(found.psf[0][outside] == 0)


def test_power_is_conserved_to_rounding():
    pupil = Pupil(20e-6, BSplineRelief(10e-6 * np.random.default_rng(1).random((4, 4))))
    settings = {"dx": 1.7e-6, "shape": (201, 203), "dtype": "float64"}
    found = optics.psf(pupil, [WAVELENGTH], 100e-6, **settings, method="geometric")
    assert found.power[0] == pytest.approx(1, abs=1e-12)
    shifted = optics.psf(pupil, [WAVELENGTH], 100e-6, **settings, source_angle=(0.4, 0.3), method="geometric")
    assert shifted.power[0] == pytest.approx(1, abs=1e-12)


def test_rays_follow_the_exact_angle_not_the_paraxial_one():
    """A prism that deflects light to the sine 0.6 shifts the image by z tan θ = 0.75 z."""
    sine, radius = 0.6, 10e-6
    ramp = np.broadcast_to(sine / 0.5 * (2 * np.arange(4) - 3) * radius, (4, 4))
    found = optics.psf(
        Pupil(radius, BSplineRelief(ramp)), [WAVELENGTH], 100e-6, dx=2e-6, shape=(101, 101), method="geometric"
    )
    assert np.sum(found.psf[0] * found.x) * 4e-12 == pytest.approx(75e-6, rel=1e-4)


def test_evanescent_rays_do_not_arrive():
    ramp = np.broadcast_to(1.2 / 0.5 * (2 * np.arange(4) - 3) * 10e-6, (4, 4))
    found = optics.psf(Pupil(10e-6, BSplineRelief(ramp)), [WAVELENGTH], 100e-6, method="geometric")
    assert found.psf.max() == 0
    assert found.plan.predicted_error >= 1


def test_error_falls_with_the_fourth_root_of_the_fresnel_number():
    """Fringes along the rim of the shadow are as wide as a Fresnel zone, √(λz). Cells are a tenth as wide."""
    distances = np.array([20e-6, 80e-6, 320e-6])
    errors = []
    for z in distances:
        zone = math.sqrt(WAVELENGTH * z)
        settings = {"dx": zone / 10, "shape": (2 * round(700e-6 / zone) + 1, 1), "tolerance": 1e-2}
        ray, wave = (
            optics.psf(Pupil(50e-6), [WAVELENGTH], z, **settings, method=method).psf[0]
            for method in ("geometric", "exact")
        )
        errors.append(relative_l2(ray, wave))
    assert order_of_convergence(distances, errors) == pytest.approx(0.25, abs=0.08)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("method", ["geometric", "pinhole"])
def test_predicted_error_bounds_the_actual_one(method):
    """For 120 random pupils, the actual error was at most 1.2 times the predicted one, and the predicted error at most
    30 times the actual one.
    """
    rng = np.random.default_rng(4)
    planned, actual, seen = np.array([predicted_and_actual(random_case(rng), method) for _ in range(20)]).T
    assert np.mean(planned >= actual) >= 0.9
    assert np.all(planned >= actual / 1.5)
    assert np.all(planned < 30 * actual)
    assert np.all(seen >= actual / 3)


@pytest.mark.slow
def test_auto_takes_rays_only_within_the_tolerance():
    wide = {"dx": 40e-6, "shape": (129, 129)}
    coarse = optics.plan(Pupil(2e-3), WAVELENGTH, 2e-3, **wide, tolerance=0.5)
    assert coarse.method == "geometric"
    assert coarse.predicted_error <= 0.5
    assert optics.plan(Pupil(2e-3), WAVELENGTH, 2e-3, **wide, tolerance=1e-2).method == "hankel"
    hexagon = Pupil(2e-3, aperture=optics.Polygon.regular(6))
    with pytest.raises(optics.AccuracyError):  # no method can, and none with a larger error is chosen
        optics.plan(hexagon, WAVELENGTH, 2e-3, **wide, tolerance=1e-2)


@pytest.mark.slow
def test_rays_have_no_derivatives_on_a_gpu(monkeypatch):
    """A request for rays is refused with a reason on a simulated GPU, and "auto" chooses waves."""
    import drjit as dr

    monkeypatch.setattr(geometric, "device", lambda: "cuda")
    radius = Float64(2e-3)
    dr.enable_grad(radius)
    asked = {"wavelengths": [WAVELENGTH], "sensor_distance": 2e-3, "dx": 40e-6, "shape": (9, 9), "tolerance": 0.5}
    with pytest.raises(ValueError, match="has no derivatives on a GPU; use 'exact'"):
        optics.psf(Pupil(radius), **asked, method="geometric")
    found = optics.psf(Pupil(radius), **asked)
    assert found.plan.method == "hankel"
    dr.backward(dr.sum(found.tensor.array))
    assert radius.grad[0] != 0
    assert optics.psf(Pupil(2e-3), **asked).plan.method == "geometric"


class TestPinhole:
    def test_all_light_is_in_the_cell_of_the_image_point(self):
        found = optics.psf(
            Pupil(20e-6), [WAVELENGTH], 240e-6, source_angle=(0.1, -0.05), dx=2e-6, shape=(33, 41), method="pinhole"
        )
        row, column = np.argwhere(found.psf[0])[0]
        assert found.psf[0, row, column] * 4e-12 == pytest.approx(1)
        assert np.count_nonzero(found.psf) == 1
        assert found.x[column] == pytest.approx(240e-6 * math.tan(0.1), abs=1e-6)
        assert found.y[row] == pytest.approx(-240e-6 * math.tan(0.05), abs=1e-6)

    def test_auto_never_takes_it(self):
        plan = optics.plan(Pupil(20e-6, thin_lens_focal_length=240e-6), dx=1e-3, shape=(5, 5), tolerance=0.5)
        assert plan.method != "pinhole"

    def test_derivatives_are_refused(self):
        from optics.numerics.precision import precision

        distance = precision("float64").Float64(240e-6)
        import drjit as dr

        dr.enable_grad(distance)
        with pytest.raises(ValueError, match=r"pinhole.*has no derivatives"):
            optics.psf(Pupil(20e-6), [WAVELENGTH], distance, source_angle=(0.1, 0.0), method="pinhole")

    def test_a_masks_derivative_is_refused_as_well(self):
        """A mask changes the amount of light in each cell, although it does not change the cells that rays hit."""
        import drjit as dr

        waist = Float64(10e-6)
        pupil = Pupil(20e-6, mask=optics.GaussianMask(waist))
        found = optics.psf(pupil, [WAVELENGTH], 240e-6, dx=2e-6, shape=(9, 9), method="pinhole")
        assert found.power[0] == pytest.approx(pupil.transmission, rel=1e-6)
        dr.enable_grad(waist)
        with pytest.raises(ValueError, match=r"pinhole.*has no derivatives"):
            optics.psf(pupil, [WAVELENGTH], 240e-6, dx=2e-6, shape=(9, 9), method="pinhole")
