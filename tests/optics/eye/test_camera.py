"""Images of a camera: electrons, noise, saturation, digital numbers, colour filters, depth, and derivatives."""

import math
from dataclasses import replace

import numpy as np
import pytest

import optics
from optics import Eye, PhotonBudget, Pupil, Sensor, camera_eye, camera_image

PUPIL = Pupil(0.25e-3, thin_lens_focal_length=5e-3)
SENSOR = Sensor((6, 8), 4e-6, bits=None, bands=4)
WIDE = (6 + 24, 8 + 24, 3)  # an sRGB scene with a margin for the blur
WHITE = np.ones(WIDE)


def middle(picture):
    return np.asarray(picture)[0, 2:4, 3:5].astype(float)


def test_electrons_of_white_are_those_of_its_irradiance():
    """The image of a white Lambertian surface has the spectral irradiance π/4 (D/f)² L, where L is the radiance of
    white in daylight.
    """
    electrons = middle(camera_image(WHITE, PUPIL, SENSOR))
    etendue = math.pi / 4 * SENSOR.pitch**2 * (0.5e-3 / 5e-3) ** 2
    bands = camera_eye(PUPIL, SENSOR).spectral_bands
    red, green, blue = PhotonBudget(1e4, 1e-3).photons(bands, etendue)
    np.testing.assert_allclose(electrons, [[green, red], [blue, green]], rtol=0.02)


def test_noise_is_that_of_photons_and_reading():
    sensor, rng = replace(SENSOR, read_noise=15.0), np.random.default_rng(0)
    many = np.stack([middle(camera_image(WHITE, PUPIL, sensor, rng=rng)) for _ in range(150)])
    mean = middle(camera_image(WHITE, PUPIL, sensor))
    np.testing.assert_allclose(many.mean(axis=0), mean, atol=5 * np.sqrt((mean + 225).max() / 150))
    assert (many.var(axis=0) / (mean + 225)).mean() == pytest.approx(1, abs=0.15)


def test_digital_numbers_are_rounded_and_saturate():
    electrons = np.asarray(camera_image(WHITE, PUPIL, SENSOR))
    full = float(electrons.max()) / 1.5
    numbers = camera_image(WHITE, PUPIL, replace(SENSOR, bits=8, full_well=full))
    assert numbers.dtype == np.uint16
    np.testing.assert_array_equal(numbers, np.minimum(np.rint(electrons / full * 255), 255))
    assert numbers.max() == 255 > numbers.min()
    assert camera_image(0 * WHITE, PUPIL, replace(SENSOR, bits=8), rng=np.random.default_rng(0)).min() == 0


def test_colours_reach_their_pixels():
    white, red = middle(camera_image(WHITE, PUPIL, SENSOR)), middle(camera_image(WHITE * [1.0, 0, 0], PUPIL, SENSOR))
    (red_pixel, green_pixel), (_, blue_pixel) = (red / white)[:, ::-1]
    assert red_pixel > 2 * green_pixel > 2 * blue_pixel
    every = camera_image(WHITE, PUPIL, replace(SENSOR, filters="rgb"))
    assert every.shape == (3, 6, 8)
    np.testing.assert_allclose(every[0, 2, 4], white[0, 1], rtol=1e-5)


def test_an_srgb_scene_is_a_spectral_scene():
    """The radiance is reflectance times daylight, in the bands of the sensor. Display values of 0.5 are 0.214 in linear
    light.
    """
    eye = camera_eye(PUPIL, SENSOR)
    daylight = optics.illuminant("D65")
    colours = [eye.in_bands(lambda at, ink=ink: ink.at(at) * daylight.at(at)) for ink in optics.srgb_basis()]
    spectrum = colours[0] + 0.21404 * colours[1]
    radiance = np.broadcast_to(spectrum[:, None, None], (4, *WIDE[:2]))
    np.testing.assert_allclose(
        camera_image(WHITE * [1, 0.5, 0], PUPIL, SENSOR), camera_image(radiance, PUPIL, SENSOR), rtol=1e-4, atol=1e-3
    )


def test_a_near_surface_hides_the_one_behind():
    """A dark plate is in front of a bright wall and out of focus. Next to its edge, it only removes light."""
    scene, depth = np.ones(WIDE), np.full(WIDE[:2], 2.0)
    scene[:, :16], depth[:, :16] = 0.0, 0.04
    seen = np.asarray(camera_image(scene, PUPIL, replace(SENSOR, filters=(530,)), depth=depth))[0]
    white = np.asarray(camera_image(WHITE, PUPIL, replace(SENSOR, filters=(530,)), depth=2.0))[0]
    passing = (seen / white).mean(axis=0)
    assert (np.diff(passing) > 0).all()
    radius = 0.25e-3 * 5e-3 * (1 / 0.04 - 1 / 2) / 4e-6  # blur of the plate in pixels
    x = (np.arange(8) - 3.5) / radius
    disk = 0.5 + (x * np.sqrt(1 - np.minimum(x * x, 1)) + np.arcsin(np.clip(x, -1, 1))) / math.pi
    np.testing.assert_allclose(passing, disk, atol=0.03)


def test_an_eye_is_a_camera():
    eye = Eye(Pupil(20e-6, thin_lens_focal_length=150e-6), (4, 4), 60.0, bands=4)
    radiance = np.random.default_rng(0).random((4, 8, 8))
    np.testing.assert_array_equal(
        camera_image(radiance, eye, samples_per_pixel=2, depth=0.01, rng=np.random.default_rng(1)),
        eye.see(radiance, 2, np.random.default_rng(1), z=0.01),
    )


@pytest.mark.parametrize("noisy", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_gradients_pass_from_electrons_to_the_pupil(noisy):
    torch = pytest.importorskip("torch")
    import optics.torch

    rng = np.random.default_rng(0)
    scene, depth, weights = rng.random((12, 12, 3)), np.full((12, 12), 2.0), torch.tensor(rng.random((1, 6, 6)))
    depth[:, :6] = 0.1
    sensor = Sensor((6, 6), 8e-6, filters=(530,), bits=None, bands=1)

    def loss(heights, focal):
        lens = Pupil(0.15e-3, optics.BSplineRelief(heights), thin_lens_focal_length=focal)
        view = {"depth": depth, "samples_per_pixel": 2, "sensor_distance": 5.05e-3, "tolerance": 5e-3}
        noise = np.random.default_rng(5) if noisy else None
        return (optics.torch.camera_image(scene, lens, sensor, rng=noise, **view) * weights).sum()

    heights = torch.tensor(rng.normal(size=(4, 4)) * 3e-8, requires_grad=True)
    focal = torch.tensor(5e-3, dtype=torch.float64, requires_grad=True)
    loss(heights, focal).backward()
    if noisy:
        assert heights.grad.abs().sum() > 0
        return
    way = torch.tensor(rng.normal(size=(4, 4)) * 1e-8)
    with torch.no_grad():
        along = (loss(heights + way, focal) - loss(heights - way, focal)) / 2
        farther = (loss(heights, focal + 4e-6) - loss(heights, focal - 4e-6)) / 8e-6
    assert float((heights.grad * way).sum()) == pytest.approx(float(along), rel=0.03)
    assert float(focal.grad) == pytest.approx(float(farther), rel=0.03)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"depth": np.full(WIDE[:2], np.nan)}, r"^depth holds NaN: must be distances greater than 0"),
        ({"depth": np.full(WIDE[:2], -1.0)}, r"^depth = -1\.0: must be greater than 0"),
        ({"depth": np.ones((3, 4))}, r"^depth has shape \(3, 4\): must be one distance, or one per cell .*\(30, 32\)"),
        ({"scene": 255 * WHITE}, r"^scene holds values outside \[0, 1\]: must be .*divide bytes by 255"),
        ({"scene": WHITE * np.nan}, r"^scene holds NaN or infinity: must be finite"),
        ({"scene": np.ones((5, 6, 8))}, r"^scene has shape \(5, 6, 8\): must be .* with 4 bands"),
        ({"scene": np.ones((7, 8, 3))}, r"^scene has 7 x 8 cells: must have 6 x 8 .*even numbers"),
        ({"samples_per_pixel": 5}, r"^scene has 30 x 32 cells: must have 30 x 40"),
        ({"sensor": None}, r"^sensor = None: must be a kind of Sensor"),
        ({"lens": Eye()}, r"^lens is an Eye, and sensor or sensor_distance is given: must be None"),
        ({"lens": 3.0}, r"^lens = 3\.0: must be"),
        ({"rng": 3}, r"^rng = 3: must be"),
    ],
)
def test_bad_images(given, message):
    with pytest.raises(ValueError, match=message) as refused:
        camera_image(**{"scene": WHITE, "lens": PUPIL, "sensor": SENSOR, **given})
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"pixels": (0, 4)}, "pixels"),
        ({"pitch": 0}, "pitch = 0: must be greater than 0"),
        ({"filters": "beyer"}, "receptors = 'beyer': must be"),
        ({"full_well": 0}, r"full_well = 0: must"),
        ({"read_noise": -1}, r"read_noise = -1: must"),
        ({"bits": 0}, r"bits = 0: must be a whole number in \[1, 16\]"),
        ({"bands": 65}, r"bands = 65: must"),
        ({"photon_budget": 3}, "photon_budget = 3: must be"),
    ],
)
def test_bad_sensors(given, message):
    with pytest.raises(ValueError, match=message):
        Sensor(**{"pixels": (2, 2), "pitch": 4e-6, **given})


def test_derivatives_need_electrons():
    import drjit as dr
    from drjit.auto.ad import Float64

    radius = Float64(0.25e-3)
    dr.enable_grad(radius)
    with pytest.raises(ValueError, match="bits = 12 and the pupil carries derivatives: must be None"):
        camera_image(WHITE, Pupil(radius, thin_lens_focal_length=5e-3), replace(SENSOR, bits=12))


def test_kernels_of_a_camera_are_computed_once():
    first = camera_image(WHITE, PUPIL, SENSOR)
    assert camera_eye(PUPIL, SENSOR) is camera_eye(PUPIL, replace(SENSOR))
    assert camera_eye(PUPIL, SENSOR) is not camera_eye(PUPIL, SENSOR, tolerance=2e-2)
    np.testing.assert_array_equal(camera_image(WHITE, PUPIL, SENSOR), first)


def test_filters_of_sensors():
    """The default has rows of red, green and of green, blue, whose peaks are at 600, 520 and 460 nm."""
    sensor = Sensor((4, 4), 1e-6)
    assert sensor.filters.mosaic == ((0, 1), (1, 2))
    assert [kind.peak_nm for kind in sensor.filters.types] == [600, 520, 460]
    plain = Sensor((4, 4), 1e-6, "rgb")
    assert plain.filters == optics.receptors_of("rgb")
    assert plain.filters.mosaic is None
    given = optics.receptors_of((440, 560))
    assert Sensor((4, 4), 1e-6, given).filters == given


@pytest.mark.parametrize(
    ("name", "limits"),
    [("full_well", (1, 1e9)), ("read_noise", (0, 1e6)), ("bits", (1, 16)), ("bands", (1, 64))],
)
def test_limits_of_sensors(name, limits):
    for limit, beyond in zip(limits, (limits[0] - 1, limits[1] * 1.5), strict=True):
        assert getattr(Sensor((4, 4), 1e-6, **{name: limit}), name) == limit
        with pytest.raises(ValueError, match=rf"^{name} = "):
            Sensor((4, 4), 1e-6, **{name: int(beyond) if name.startswith("b") else beyond})
