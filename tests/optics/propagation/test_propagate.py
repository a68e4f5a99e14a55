"""Plane-to-plane propagation against closed forms, and cases that it must refuse."""

import numpy as np
import pytest

import optics
from validation import reference

WAVELENGTH = 500e-9


def gaussian(n: int, dx: float, waist: float) -> np.ndarray:
    x = (np.arange(n) - n // 2) * dx
    return np.exp(-(x[None, :] ** 2 + x[:, None] ** 2) / waist**2).astype(complex)


def gaussian_beam(r: np.ndarray, z: float, waist: float) -> np.ndarray:
    """Return the paraxial beam 1/(1 + iz/z_R) exp(ikz - r²/(w₀²(1 + iz/z_R))), including the carrier (Siegman, Lasers,
    §17.1).
    """
    spread = 1 + 1j * z / (np.pi * waist**2 / WAVELENGTH)
    return np.exp(2j * np.pi * z / WAVELENGTH - r**2 / (waist**2 * spread)) / spread


def radii(result: optics.PropagationResult) -> np.ndarray:
    n, m = result.u.shape[-2:]
    return np.hypot((np.arange(m) - m // 2)[None, :] * result.dx, (np.arange(n) - n // 2)[:, None] * result.dx)


@pytest.mark.parametrize(("dtype", "bound"), [("float32", 1e-5), ("float64", 1e-10)])
@pytest.mark.parametrize("distance", [50e-6, -50e-6])
def test_fresnel_is_the_gaussian_beam_in_amplitude_and_phase(dtype, bound, distance):
    u = gaussian(96, 0.5e-6, 5e-6)
    tolerance = 1e-4 if dtype == "float32" else 1e-11
    out = optics.propagate(
        u, dx=0.5e-6, wavelength=WAVELENGTH, distance=distance, tolerance=tolerance, method="fresnel", dtype=dtype
    )
    expected = gaussian_beam(radii(out), distance, 5e-6)
    assert np.linalg.norm(out.u - expected) < bound * np.linalg.norm(expected)


def test_angular_spectrum_departs_from_the_paraxial_beam_like_the_fourth_power_of_the_angle():
    """The leading term of the phase error is kzθ⁴/8. At a fixed distance, half the waist therefore gives 2⁴ times the
    error.
    """
    departures = []
    for waist in (4e-6, 2e-6):
        u = gaussian(128, waist / 8, waist)
        out = optics.propagate(u, dx=waist / 8, wavelength=WAVELENGTH, distance=10e-6, dtype="float64", tolerance=1e-9)
        expected = gaussian_beam(radii(out), 10e-6, waist)
        departures.append(np.linalg.norm(out.u - expected) / np.linalg.norm(expected))
    assert np.log2(departures[1] / departures[0]) == pytest.approx(4, abs=0.2)


def test_on_axis_intensity_behind_a_circular_aperture_where_fresnel_says_darkness():
    """For a radius of 20 µm and a distance of 40 µm, the intensity is 3.474 (Osterberg & Smith), and 0 in paraxial
    theory.
    """
    exact = reference.circular_aperture_on_axis(20e-6, 40e-6, WAVELENGTH)
    assert exact == pytest.approx(3.474, abs=5e-4)
    dx = 0.125e-6
    x = (np.arange(351) - 175) * dx
    # Area coverage of the samples by the disk: the edge's error falls with dx², 2 % here.
    disk = np.clip((20e-6 - np.hypot(x[None, :], x[:, None])) / dx + 0.5, 0, 1)
    settings = {"dx": dx, "wavelength": WAVELENGTH, "distance": 40e-6, "out_shape": (9, 9)}
    out = optics.propagate(disk, **settings)
    assert np.abs(out.u[4, 4]) ** 2 == pytest.approx(exact, rel=0.025)
    paraxial = optics.propagate(disk, **settings, method="fresnel")
    assert np.abs(paraxial.u[4, 4]) ** 2 < 0.02


def test_psf_gives_the_same_on_axis_intensity_to_its_tolerance():
    pupil = optics.Pupil(aperture_radius=20e-6)
    result = optics.psf(pupil, [WAVELENGTH], 40e-6, dx=0.25e-6, shape=(65, 65), tolerance=1e-4)
    exact = reference.circular_aperture_on_axis(20e-6, 40e-6, WAVELENGTH)
    assert result.psf[0, 32, 32] * pupil.area == pytest.approx(exact, rel=1e-3)


def random_field(n: int, cut: int, seed: int) -> np.ndarray:
    """Return a band-limited random field times a Gaussian, so that it stays inside its window."""
    rng = np.random.default_rng(seed)
    spectrum = np.zeros((n, n), complex)
    block = rng.normal(size=(2 * cut + 1, 2 * cut + 1)) + 1j * rng.normal(size=(2 * cut + 1, 2 * cut + 1))
    spectrum[n // 2 - cut : n // 2 + cut + 1, n // 2 - cut : n // 2 + cut + 1] = block
    return np.fft.ifft2(np.fft.ifftshift(spectrum)) * gaussian(n, 1 / n, 0.12)


def test_power_is_conserved_in_a_window_that_holds_the_light():
    u = random_field(96, 12, seed=1)
    out = optics.propagate(u, dx=0.5e-6, wavelength=WAVELENGTH, distance=60e-6, out_shape=(256, 256))
    assert np.sum(np.abs(out.u) ** 2) == pytest.approx(np.sum(np.abs(u) ** 2), rel=1e-5)


def test_two_steps_are_one():
    u = random_field(96, 12, seed=2)
    settings = {"dx": 0.5e-6, "wavelength": WAVELENGTH, "out_shape": (256, 256), "dtype": "float64", "tolerance": 1e-6}
    half = optics.propagate(u, distance=30e-6, **settings).u
    twice, once = (
        optics.propagate(half, distance=30e-6, **settings).u,
        optics.propagate(u, distance=60e-6, **settings).u,
    )
    assert np.linalg.norm(twice - once) < 1e-5 * np.linalg.norm(once)


def test_backwards_undoes_forwards():
    u = random_field(96, 12, seed=3)
    settings = {"dx": 0.5e-6, "wavelength": WAVELENGTH, "dtype": "float64", "tolerance": 1e-6}
    there = optics.propagate(u, distance=40e-6, out_shape=(256, 256), **settings).u
    back = optics.propagate(there, distance=-40e-6, out_shape=(96, 96), **settings).u
    assert np.linalg.norm(back - u) < 1e-5 * np.linalg.norm(u)


def test_tilted_light_walks_to_the_side_it_is_tilted_to():
    """A field exp(+2πi fx x) moves towards +x by z tan θ, where sin θ = λ fx. The test fails for a wrong sign or axis,
    and for the sine instead of the tangent.
    """
    n, dx, sine = 128, 0.25e-6, 0.6
    x = (np.arange(n) - n // 2) * dx
    u = gaussian(n, dx, 4e-6) * np.exp(2j * np.pi * sine / WAVELENGTH * x)[None, :]
    out = optics.propagate(u, dx=dx, wavelength=WAVELENGTH, distance=20e-6, out_dx=0.25e-6, out_shape=(128, 256))
    power = np.abs(out.u) ** 2
    centre_x = np.sum(power.sum(axis=0) * (np.arange(256) - 128) * out.dx) / power.sum()
    centre_y = np.sum(power.sum(axis=1) * (np.arange(128) - 64) * out.dx) / power.sum()
    assert centre_x == pytest.approx(20e-6 * np.tan(np.arcsin(sine)), rel=0.02)  # 15.0 µm; the sine would be 12.0
    assert abs(centre_y) < 1e-7


def test_output_pitch_and_window_sample_the_same_field():
    u = gaussian(96, 0.5e-6, 3e-6)
    settings = {"dx": 0.5e-6, "wavelength": WAVELENGTH, "distance": 50e-6}
    coarse = optics.propagate(u, **settings).u
    fine = optics.propagate(u, **settings, out_dx=0.25e-6, out_shape=(97, 95)).u
    np.testing.assert_allclose(fine[48::2, 47::2], coarse[48 : 48 + 25, 48 : 48 + 24], atol=3e-4)


def test_evanescent_waves_decay_and_do_not_return():
    """The orders of a grating of period λ/2 are evanescent, and decay like exp(-2πz √3 / λ)."""
    n, dx = 256, 62.5e-9
    x = (np.arange(n) - n // 2) * dx
    u = gaussian(n, dx, 3e-6) * np.cos(2 * np.pi * 2 / WAVELENGTH * x)[None, :]
    settings = {"dx": dx, "wavelength": WAVELENGTH, "tolerance": 1e-3}
    near = optics.propagate(u, distance=0.1e-6, **settings)
    assert near.evanescent_power == pytest.approx(1, abs=1e-6)
    expected = np.exp(-2 * np.pi * 0.1e-6 / WAVELENGTH * np.sqrt(3))
    assert np.abs(near.u).max() == pytest.approx(expected, rel=0.02)
    with pytest.raises(optics.AccuracyError):  # only rounding is left of it
        optics.propagate(u, distance=-0.1e-6, **settings)


def test_zero_distance_returns_the_field():
    u = random_field(64, 10, seed=4)
    out = optics.propagate(u, dx=0.5e-6, wavelength=WAVELENGTH, distance=0.0)
    assert np.linalg.norm(out.u - u) < 1e-5 * np.linalg.norm(u)


def test_stacks_keep_their_shape():
    u = np.stack([random_field(48, 6, seed) for seed in (5, 6)])[None]
    out = optics.propagate(u, dx=0.5e-6, wavelength=WAVELENGTH, distance=20e-6)
    assert out.u.shape == (1, 2, 48, 48)
    alone = optics.propagate(u[0, 1], dx=0.5e-6, wavelength=WAVELENGTH, distance=20e-6)
    np.testing.assert_array_equal(out.u[0, 1], alone.u)


def test_medium_shortens_the_wavelength():
    u = gaussian(96, 0.5e-6, 5e-6)
    in_water = optics.propagate(u, dx=0.5e-6, wavelength=WAVELENGTH, distance=50e-6, medium_n=1.33).u
    shorter = optics.propagate(u, dx=0.5e-6, wavelength=WAVELENGTH / 1.33, distance=50e-6).u
    np.testing.assert_allclose(in_water, shorter, atol=1e-5)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"dx": -1.0}, "dx"),
        ({"wavelength": 0.0}, "wavelength"),
        ({"distance": float("nan")}, "distance"),
        ({"medium_n": 0.5}, "medium_n"),
        ({"tolerance": 1e-9}, "tolerance"),
        ({"method": "huygens"}, "method = 'huygens'"),
        ({"dtype": "float16"}, "dtype"),
        ({"out_shape": (0, 3)}, "shape"),
        ({"u": np.full((4, 4), np.nan)}, "u: must be finite"),
        ({"u": np.zeros(4)}, "u has shape"),
    ],
)
def test_bad_arguments_are_named(changed, message):
    arguments = {"u": np.ones((8, 8)), "dx": 1e-6, "wavelength": WAVELENGTH, "distance": 1e-5} | changed
    with pytest.raises(ValueError, match=message):
        optics.propagate(arguments.pop("u"), **arguments)


def test_a_window_off_the_axis_shows_what_a_larger_one_does():
    x = (np.arange(64) - 32) * 1e-6
    u = np.exp(-(x[None, :] ** 2 + x[:, None] ** 2) / (2 * (5e-6) ** 2))
    asked = {"dx": 1e-6, "wavelength": 550e-9, "distance": 300e-6, "tolerance": 1e-4}
    whole = optics.propagate(u, out_shape=(101, 101), **asked)
    part = optics.propagate(u, out_shape=(9, 11), out_centre=(-13e-6, 7e-6), **asked)
    expected = whole.u[50 + 7 - 4 : 50 + 7 + 5, 50 - 13 - 5 : 50 - 13 + 6]
    assert np.linalg.norm(part.u - expected) < 1e-4 * np.linalg.norm(expected)
    assert (part.x[5], part.y[4]) == (-13e-6, 7e-6)
    np.testing.assert_allclose(part.x, whole.x[50 - 13 - 5 : 50 - 13 + 6], atol=1e-12)
    np.testing.assert_allclose(part.y, whole.y[50 + 7 - 4 : 50 + 7 + 5], atol=1e-12)


def test_darkness_around_the_light_costs_nothing():
    """A field within a wide dark frame is computed with the same period, and gives the same image, as the field
    alone.
    """
    u = gaussian(48, 0.5e-6, 4e-6)
    settings = {"dx": 0.5e-6, "wavelength": WAVELENGTH, "distance": 80e-6, "out_shape": (40, 40), "tolerance": 1e-5}
    framed = optics.propagate(np.pad(u[None], ((0, 1), (100, 100), (60, 61))), **settings)
    alone = optics.propagate(u, **settings)
    np.testing.assert_allclose(framed.u[0], alone.u, atol=1e-6 * np.abs(alone.u).max())
    assert np.abs(framed.u[1]).max() == 0
    assert framed.plan.samples == alone.plan.samples


def test_evanescent_power_is_the_given_fields_whatever_becomes_of_it():
    """The evanescent power is computed on request, when the user's array may already contain other values."""
    waist, dx = 0.2 * WAVELENGTH, WAVELENGTH / 20
    u = gaussian(81, dx, waist)
    result = optics.propagate(u, dx=dx, wavelength=WAVELENGTH, distance=0.5e-6, tolerance=2e-2)
    u[:] = 1
    assert result.evanescent_power == pytest.approx(reference.gaussian_evanescent_power(WAVELENGTH, waist), rel=0.02)


@pytest.mark.parametrize("size", [1e-23, 1e20])
def test_faint_and_bright_fields_are_carried_alike(size):
    """The powers of these fields are outside the range of float32. This has no effect, because propagation is
    linear.
    """
    x = (np.arange(48) - 24) * 1e-6
    u = np.exp(-np.add.outer(x**2, x**2) / 8e-6**2).astype(complex)
    plain, scaled = (optics.propagate(f * u, dx=1e-6, wavelength=5e-7, distance=1e-4) for f in (1.0, size))
    assert scaled.u / size == pytest.approx(plain.u, rel=1e-5, abs=1e-6)
    assert scaled.plan.predicted_error == pytest.approx(plain.plan.predicted_error, rel=1e-3)
    way = [optics.FreeSpace(1e-4)]
    plain, scaled = (optics.propagate_through(way, f * u, dx=1e-6, wavelength=5e-7) for f in (1.0, size))
    assert scaled.u / size == pytest.approx(plain.u, rel=1e-5, abs=1e-6)
    assert scaled.steps[0].power_in == pytest.approx(size**2 * plain.steps[0].power_in)
