"""Scenes, distances and digital numbers of a camera, from given numbers."""

import math
from dataclasses import replace
from types import SimpleNamespace

import drjit as dr
import numpy as np
import pytest

import optics
from optics import Eye, Pupil, Sensor, camera_eye
from optics.eye import camera
from optics.eye.camera import _distances, _radiance, _read
from tests.optics.device_types import Float64, TensorXf64

PER_SIGNAL = np.array([10.0, 20.0])[:, None, None]
SIGNALS = np.array([[[0.5, -0.1, 3.0]], [[0.5, 1.0, 3.0]]])
MEAN = np.array([[[5.0, 0, 30]], [[10, 20, 60]]])
SENSOR = Sensor((1, 3), 1e-6, "rgb", full_well=40.0, read_noise=3.0, bits=None)
PIXELS = SimpleNamespace(receptor_photons=PER_SIGNAL)


def test_electrons_saturate_before_they_are_read():
    found = _read(SIGNALS, SENSOR, PIXELS, None)
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, np.minimum(MEAN, 40))
    noisy = _read(SIGNALS, SENSOR, PIXELS, np.random.default_rng(4))
    rng = np.random.default_rng(4)
    counted = rng.poisson(MEAN)
    np.testing.assert_allclose(noisy, np.minimum(counted, 40) + 3 * rng.standard_normal(MEAN.shape), rtol=1e-6)
    assert counted.max() > 40


def test_digital_numbers_of_electrons():
    """The full well of 40 electrons is the number 15. Negative sums become 0."""
    sensor = replace(SENSOR, bits=4)
    found = _read(SIGNALS, sensor, PIXELS, None)
    assert found.dtype == np.uint16
    np.testing.assert_array_equal(found, [[[2, 0, 11]], [[4, 8, 15]]])
    loud = _read(SIGNALS, replace(sensor, read_noise=1e3), PIXELS, np.random.default_rng(0))
    assert set(loud.ravel()) == {0, 15}
    assert _read(SIGNALS, replace(SENSOR, bits=16), PIXELS, None).max() == 65535


def test_electrons_with_derivatives():
    signals = TensorXf64(SIGNALS)
    found = _read(signals, SENSOR, PIXELS, np.random.default_rng(4))
    assert isinstance(found, TensorXf64)
    np.testing.assert_allclose(found.numpy(), _read(SIGNALS, SENSOR, PIXELS, np.random.default_rng(4)), rtol=1e-6)
    np.testing.assert_allclose(_read(signals, SENSOR, PIXELS, None).numpy(), np.minimum(MEAN, 40))
    with pytest.raises(ValueError, match=r"^bits = 4 and the pupil carries derivatives: must be None"):
        _read(signals, replace(SENSOR, bits=4), PIXELS, None)


EYE = Eye(None, (2, 4), bands=4)


def test_srgb_scenes_become_spectral():
    """Display values are decoded, and the inks' radiances are added up."""
    scene = np.random.default_rng(0).random((4, 6, 3))
    scene[0, 0], scene[1, 1] = 0.0, 1.0
    linear = np.where(scene <= 0.04045, scene / 12.92, ((scene + 0.055) / 1.055) ** 2.4)
    inks = optics.spectra.srgb.ink_radiance(EYE.spectral_bands, EYE.receptors)
    expected = sum(inks[:, c, None, None] * linear[None, ..., c] for c in range(3))
    np.testing.assert_allclose(_radiance(scene, EYE, 1), expected)
    for wrong in (-0.001, 1.001):
        scene[2, 3, 1] = wrong
        with pytest.raises(ValueError, match=r"^scene holds values outside \[0, 1\]"):
            _radiance(scene, EYE, 1)


def test_spectral_scenes_stay_as_they_are():
    scene = 3 * np.random.default_rng(0).random((4, 6, 8)) - 1
    np.testing.assert_array_equal(_radiance(scene, EYE, 2), scene)
    for shape in ((3, 6, 8), (4, 6), (1, 4, 6, 8)):
        with pytest.raises(ValueError, match=r"^scene has shape .* with 4 bands"):
            _radiance(np.ones(shape), EYE, 2)
    scene[0, 0, 0] = np.inf
    with pytest.raises(ValueError, match=r"^scene holds NaN or infinity"):
        _radiance(scene, EYE, 2)


@pytest.mark.parametrize(("samples", "shape"), [(1, (2, 4)), (1, (4, 6)), (2, (4, 8)), (2, (8, 10)), (64, (128, 256))])
def test_scenes_that_surround_the_sensor(samples, shape):
    assert _radiance(np.ones((4, *shape)), EYE, samples).shape == (4, *shape)
    for change in ((1, 0), (0, 1), (-2, 0), (0, -2)) if shape == (2 * samples, 4 * samples) else ((1, 0), (0, 1)):
        wrong = tuple(n + more for n, more in zip(shape, change, strict=True))
        if wrong[0] == 0:
            continue
        message = rf"^scene has {wrong[0]} x {wrong[1]} cells: must have {2 * samples} x {4 * samples} \(pixels"
        with pytest.raises(ValueError, match=message):
            _radiance(np.ones((4, *wrong)), EYE, samples)


def test_samples_per_pixel():
    for wrong in (0, 65, 1.5):
        with pytest.raises(ValueError, match=r"^samples_per_pixel = "):
            _radiance(np.ones((4, 2, 4)), EYE, wrong)


def test_distances_of_scenes():
    assert _distances(3, (2, 3)) == 3
    assert _distances(math.inf, (2, 3)) == math.inf
    z = Float64(2.0)
    dr.enable_grad(z)
    assert _distances(z, (2, 3)) is z
    depth = np.array([[1.0, 2, math.inf], [4, 5, 6]])
    np.testing.assert_array_equal(_distances(depth, (2, 3)), depth)
    for wrong in (0.0, -1.0, Float64(-1.0), np.full((2, 3), -1.0)):
        with pytest.raises(ValueError, match=r"^depth = "):
            _distances(wrong, (2, 3))
    with pytest.raises(ValueError, match=r"^depth has shape \(2, 3\): .* \(3, 2\)"):
        _distances(depth, (3, 2))


@pytest.mark.parametrize("between", [{}, {"medium_n": 1.5, "object_n": 1.2}])
def test_the_eye_of_a_camera(between):
    pupil = Pupil(0.25e-3, thin_lens_focal_length=5e-3, **between)
    budget = optics.PhotonBudget(50.0)
    sensor = Sensor((6, 8), 4e-6, "rgb", photon_budget=budget, bands=5)
    eye = camera_eye(pupil, sensor, 6e-3, 3e-3)
    assert (eye.pupil, eye.resolution, eye.bands, eye.receptors) == (pupil, (6, 8), 5, sensor.filters)
    assert eye.sensor_width == pytest.approx(8 * 4e-6)
    assert eye.retina_distance == pytest.approx(6e-3)
    assert eye.receptor_size == pytest.approx((4e-6, 4e-6))
    assert eye.full_aperture == pytest.approx(0.5e-3)
    assert (eye.noise_sigma, eye.tolerance, eye.most_seconds, eye.dtype) == (0.0, 3e-3, 60.0, "float32")
    assert eye.photon_budget is budget
    assert camera_eye(pupil, sensor).tolerance == 1e-2
    for wrong in (1e-7, 0.6):
        with pytest.raises(ValueError, match=r"^tolerance = "):
            camera_eye(pupil, sensor, 6e-3, wrong)
    with pytest.raises(ValueError, match=r"^sensor_distance = 0"):
        camera_eye(pupil, sensor, 0)


def test_an_eye_with_derivatives_has_double_precision():
    radius = Float64(0.25e-3)
    pupil = Pupil(radius, thin_lens_focal_length=5e-3)
    eye = camera_eye(pupil, Sensor((6, 8), 4e-6), 5e-3)
    assert eye.dtype == "float64"
    assert eye.pupil is pupil
    assert camera_eye(pupil, Sensor((6, 8), 4e-6), 5e-3) is not eye


@pytest.mark.parametrize("zones", [1, 3, "auto"])
def test_field_zones_of_images(monkeypatch, zones):
    """Several zones have a sight of their own. A sensor's noise is added to electrons, and not to signals."""
    asked = []
    eye = Eye(None, (2, 4), bands=4)
    monkeypatch.setattr(Eye, "sight", lambda self, *given: asked.append(given) or "sight")
    monkeypatch.setattr(Eye, "see", lambda self, *given: asked.append(given) or np.ones((1, 2, 4)))
    scene, rng = np.ones((4, 4, 8)), np.random.default_rng(0)
    optics.camera_image(scene, eye, depth=3.0, samples_per_pixel=2, field_zones=zones, rng=rng)
    if zones != 1:
        assert asked.pop(0) == (2, 3.0, "auto", zones)
    [(radiance, samples, noise, z, sight)] = asked
    np.testing.assert_array_equal(radiance, scene)
    assert (samples, noise, z, sight) == (2, rng, 3.0, None if zones == 1 else "sight")
    for given in ({"sensor": SENSOR}, {"sensor_distance": 1.0}):
        with pytest.raises(ValueError, match=r"^lens is an Eye, and sensor or sensor_distance is given"):
            optics.camera_image(scene, eye, **given)
    asked.clear()
    optics.camera_image(scene[:, 1:3, 2:6], eye)
    assert asked[0][1:] == (1, None, math.inf, None)
    sensor = Sensor((2, 4), 1e-6, bands=4)
    optics.camera_image(scene, Pupil(1e-3, thin_lens_focal_length=5e-3), sensor, samples_per_pixel=2, rng=rng)
    assert asked[-1][2] is None
    tolerances = []
    monkeypatch.setattr(
        camera, "camera_eye", lambda lens, sensor, distance, tolerance: tolerances.append(tolerance) or eye
    )
    monkeypatch.setattr(camera, "_read", lambda *given: "numbers")
    assert optics.camera_image(scene[:, 1:3, 2:6], "lens", sensor) == "numbers"
    assert tolerances == [1e-2]
