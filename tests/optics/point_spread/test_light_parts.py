"""Arriving light, contrasts of lenses, and light of several pupils, from given numbers."""

import math
from types import SimpleNamespace

import drjit as dr
import numpy as np
import pytest

import optics
from optics.numerics.precision import precision
from optics.point_spread import arriving, batch, lens_mtf
from optics.point_spread.light_batch import LightBatch
from optics.point_spread.window_loss import ErrorCauses
from tests.optics.point_spread.test_psf_result import result

TYPES = precision("float64")
LENS = optics.Pupil(30e-6, thin_lens_focal_length=3e-4)


@pytest.mark.parametrize(
    ("given", "good"),
    [
        (1.0, True),
        (1.001, False),
        (0.0, False),
        (0.69, True),
        (0.68, False),
        ([1, 1, 0.8], True),
        ([1, 1, 0.68], False),
    ],
)
def test_known_light_is_at_least_that_of_the_window(monkeypatch, given, good):
    """The window holds at most 0.695 of the light. A sum may exceed the known light by 0.01."""
    monkeypatch.setattr(type(result()), "power", np.array([0.1, 0.2, 0.695]))
    if good:
        light, unsure = arriving.arriving_light(result(), given)
        np.testing.assert_array_equal(light.numpy(), np.broadcast_to(given, 3))
        np.testing.assert_array_equal(unsure, np.zeros(3))
        return
    with pytest.raises(ValueError, match=r"arriving = .*: must be in \(0, 1\] and at least the window's"):
        arriving.arriving_light(result(), given)
    with pytest.raises(ValueError, match=r"arriving has shape \(2,\): must be a number, or one per wavelength \(3,\)"):
        arriving.arriving_light(result(), [0.5, 0.5])


def test_light_is_lost_at_the_edge():
    """The fraction λP/(2π²A) of the light is evanescent, here λ/(π² n R)."""
    found, unsure = arriving._not_evanescent(result(requests=()))
    lost = np.array([0.4e-6, 0.5e-6, 0.7e-6]) / (1.33 * np.pi**2 * 1e-3)
    np.testing.assert_allclose(found.numpy(), 1 - lost, rtol=1e-9)
    np.testing.assert_allclose(1 - found.numpy(), lost, rtol=1e-5)
    np.testing.assert_allclose(unsure, lost**2, rtol=1e-5)


def test_light_lost_at_the_edge_is_that_of_the_mask():
    mask = optics.GaussianMask(1e-3)
    pupil = optics.Pupil(1e-3, mask=mask)
    found, _ = arriving._not_evanescent(result(requests=(), pupil=pupil))
    rim, light = math.exp(-2.0), pupil.transmission
    light = light if isinstance(light, float) else float(TYPES.Float(light).numpy()[0])
    lost = np.array([0.4e-6, 0.5e-6, 0.7e-6]) / (np.pi**2 * 1e-3) * rim / light
    np.testing.assert_allclose(1 - found.numpy() / light, lost, rtol=1e-4)


@pytest.mark.parametrize("sine", [(0.6, 0.0), (0.0, 0.5), (0.3, -0.4)])
def test_oblique_rays_lose_more_at_the_edge(sine):
    """Rays of a parallel beam cross the rim of a circle at all angles."""
    light = optics.Pupil(30e-6)
    (asked,) = optics.psf(
        light,
        [5e-7],
        3e-4,
        source_angle=tuple(map(math.asin, sine)),
        dx=1e-6,
        shape=(3, 3),
        centre=(*(3e-4 * s / math.sqrt(1 - sine[0] ** 2 - sine[1] ** 2) for s in sine),),
        tolerance=0.1,
    ).requests
    found = float(arriving._at_edge(asked).numpy()[0])
    tangents = asked.beam.source.angle
    steep = [math.tan(angle) / math.hypot(1, *map(math.tan, tangents)) for angle in tangents]
    square = steep[0] ** 2 + steep[1] ** 2
    phi = (np.arange(4000) + 0.5) / 4000 * 2 * np.pi
    normal = (steep[0] * np.cos(phi) + steep[1] * np.sin(phi)) ** 2
    assert found == pytest.approx(np.mean(np.sqrt(normal + 1 - square) / (1 - square)), rel=1e-3)


def test_sums_of_waves():
    rng = np.random.default_rng(0)
    x, y, a, b = rng.random((4, 7)) * 3
    fx, fy = rng.random((2, 4)) * 2
    re, im = arriving._sums((TYPES.Float64(fx), TYPES.Float64(fy)), [TYPES.Float64(part) for part in (x, y, a, b)])
    expected = ((a + 1j * b) * np.exp(-2j * np.pi * (np.outer(fx, x) + np.outer(fy, y)))).sum(axis=1)
    np.testing.assert_allclose(re.numpy() + 1j * im.numpy(), expected, rtol=1e-12)
    re, im = arriving._turned(*(TYPES.Float64(part) for part in (a, b, x)))
    np.testing.assert_allclose(re.numpy() + 1j * im.numpy(), (a + 1j * b) * np.exp(2j * np.pi * x), rtol=1e-12)


def test_windows_of_lens_contrasts(monkeypatch):
    """Two samples per cycle at the cutoff, and 65 plus those that the spot covers."""
    pupil = optics.Pupil(1e-3, medium_n=1.5)
    one = SimpleNamespace(pupil=pupil, distance=2e-3, spot_radius=1e-5)
    asked = []

    def psf(pupil, waves, distance, tolerance, dx, shape):
        asked.append((waves, distance, tolerance, dx, shape))
        return waves[0]

    def mtf(seen, tolerance):
        assert tolerance == 0.05
        return SimpleNamespace(otf=lambda fx, fy: [seen * 1e6 * (fx + 1j * fy)], predicted_error=[seen * 1e3])

    monkeypatch.setattr(lens_mtf, "psf", psf)
    monkeypatch.setattr(lens_mtf, "mtf", mtf)
    f, waves = np.array([[1.0, 3.0], [2.0, 4.0]]), np.array([4e-7, 5e-7, 6e-7])
    found, error = lens_mtf._otf((one, one, one), waves, np.array([0.25, 0.0, 0.75]), f, 0.05)
    mean = 0.25 * 0.4 + 0.75 * 0.6
    np.testing.assert_allclose(found, mean * np.array([1 + 2j, 3 + 4j]))
    assert error == pytest.approx(mean * 1e-3)
    cutoff = 2 / math.sqrt(5) * 1.5 / 4e-7
    side = 65 + 2 * math.ceil(1.2 * 1e-5 * cutoff / 0.5)
    assert asked[0] == ([4e-7], 2e-3, pytest.approx(0.005), pytest.approx(0.5 / cutoff), (side, side))
    assert len(asked) == 2
    lowest = 2 / math.sqrt(5) * 1.5 / 6e-7
    for scale in (0.999, 1.001):
        high = np.array([[0.6], [0.8]]) * lowest * scale
        if scale < 1:
            lens_mtf._otf((one,), waves[2:], np.ones(1), high, 0.05)
        else:
            with pytest.raises(ValueError, match="is beyond the cutoff of the lens at 6e-07 m"):
                lens_mtf._otf((one,), waves[2:], np.ones(1), high, 0.05)


def test_light_of_several_pupils():
    """Without rows there is one distance for each pupil."""
    others = [optics.Pupil(20e-6), optics.Pupil(40e-6, medium_n=1.33)]
    light = LightBatch.from_arguments(others, 2e-4, [1.0, 2.0], (0.1, 0.2))
    assert [(member[1], member[2]) for member in light.members] == [(2e-4, 1.0), (2e-4, 2.0)] * 2
    single = LightBatch.from_arguments(others[0], 2e-4, math.inf, (0.1, 0.2))
    assert (single.pupils, single.distances, single.angle) == ((others[0],), ((2e-4, math.inf),), (0.1, 0.2))
    waves = np.array([5e-7, 4e-7])
    assert light.cutoff(waves) == pytest.approx(
        2 * 40e-6 / math.hypot(40e-6, 2e-4) * others[1].index_behind(4e-7) / 4e-7
    )
    with pytest.raises(ValueError, match="sensor_distance has 2 entries and source_distance 1"):
        LightBatch.from_arguments(others, [1e-4, 2e-4], [1.0], (0.0, 0.0))
    for empty in ({"pupil": []}, {"sensor_distance": []}, {"source_distance": []}):
        given = {"pupil": others, "sensor_distance": 1e-4, "source_distance": 1.0, **empty}
        with pytest.raises(ValueError, match=rf"{next(iter(empty))}"):
            LightBatch.from_arguments(*given.values(), (0.0, 0.0))


def test_causes_of_the_first_wavelengths():
    causes = ErrorCauses(np.array([0.1, 0.2]), np.array([0.3, 0.4]), np.array([0.5, 0.6]))
    np.testing.assert_allclose(causes.total, [0.6, 0.8])
    first = causes.first(1)
    assert (first.lost, first.light, first.rest) == ([0.1], [0.3], [0.5])


def test_psfs_that_are_planned_apart_are_joined_in_order():
    for count in (1, 2, 3):
        given = {k: (np.full((1, 2), float(k)), f"plan {k}") for k in range(0, count, 2)}
        rest = {k: (TYPES.Float([k, k]), f"plan {k}") for k in range(1, count, 2)}
        flat, plans = batch._joined(given, rest, TYPES)
        np.testing.assert_array_equal(flat.numpy(), np.repeat(np.arange(count), 2))
        assert plans == [f"plan {k}" for k in range(count)]
    flat, _ = batch._joined({}, {k: (TYPES.Float([k, k]), "") for k in range(2)}, TYPES)
    assert flat.numpy().tolist() == [0, 0, 1, 1]


def test_wavelengths_of_batches_carry_no_derivatives():
    wave = TYPES.Float64(5e-7)
    dr.enable_grad(wave)
    with pytest.raises(ValueError, match="wavelengths"):
        optics.psf_batch([LENS], [wave])
