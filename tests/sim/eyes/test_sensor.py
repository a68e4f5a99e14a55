"""Sampling of receptive fields against the paper's convolution, and sampling of the perfect lens against quadrature."""

import math

import numpy as np
import pytest
import scipy.sparse

import optics
from sim.eyes.receptive_fields import NoRaysError, ReceptiveFields, cells_per_receptor, low_discrepancy
from sim.eyes.receptor_sums import RowProduct
from sim.eyes.sampling import BoxSampling, FieldSampling, build_sensor, eye_sampling
from sim.eyes.sensor import BoxSensor, ReceptiveFieldSensor

L = 200e-6


def eye(resolution=(9, 9), pupil=None, bands=3):
    return optics.Eye(pupil=pupil, resolution=resolution, fov_deg=45.0, sensor_width=L, bands=bands, tolerance=0.03)


def box_sensor(eye, rays):
    return BoxSampling(eye).sensor(rays)


def receptive_field_sensor(eye, rays, cells):
    return FieldSampling(eye, ReceptiveFields.from_eye(eye, cells)).sensor(rays / math.prod(eye.resolution))


def focused(a=0.3):
    f = L / (2 * math.tan(math.radians(22.5)))
    return optics.Pupil(aperture_radius=a * L / 2, thin_lens_focal_length=f)


def prism(a=0.3):
    """Return a glass wedge, whose PSF is off centre.

    A sensor with a flipped kernel would shift it to the other side.
    """
    slope = np.linspace(-1, 1, 65)
    return optics.Pupil(aperture_radius=a * L / 2, height=6e-6 * np.add.outer(0.5 * slope, slope), n=1.5)


def scene(x, y, band):
    """Return a smooth radiance over the tangent plane in receptor pitches (x right, y down), different in every
    band.
    """
    return 1 + 0.5 * np.sin(0.9 * x + 0.3 * band) * np.cos(0.5 * y) + 0.3 * np.tanh(x + 0.5 * y - band)


def plane_of(eye, directions):
    """Return tangent-plane coordinates (x right, y down), in receptor pitches, of unit vectors."""
    scale = eye.sensor_distance / eye.receptor_pitch
    return directions[:, 0] / directions[:, 2] * scale, -directions[:, 1] / directions[:, 2] * scale


def sampled(eye, sensor):
    """Return the sensor's signals (channel, h, w) for `scene`."""
    x, y = plane_of(eye, sensor.directions.astype(float))
    radiance = np.stack([scene(x, y, band) for band in range(eye.bands)])[:, None].astype(np.float32)
    if isinstance(sensor, BoxSensor):
        radiance = radiance.reshape(eye.bands, 1, -1, sensor.rays_per_receptor).sum(axis=-1)
    receptors = sensor.receptor_radiance(radiance)[:, 0].reshape(eye.bands, *eye.resolution)
    return eye.throughput * np.einsum("cb,byx->cyx", eye.spectral_bands.weights, receptors)


def convolved(eye, cells):
    """Return the signals of Eye.see, for an image that extends beyond the kernel's reach."""
    kernel = eye.kernel(cells)
    size = [cells * n + 2 * (k // 2 + 1) for n, k in zip(eye.resolution, kernel.shape[1:], strict=True)]
    y, x = ((np.arange(n) - (n - 1) / 2) / cells for n in size)
    picture = np.stack([scene(x[None, :], y[:, None], band) for band in range(eye.bands)])
    return eye.see(picture.astype(np.float32), cells)


@pytest.mark.parametrize(
    "pupil",
    [focused(), optics.Pupil(aperture_radius=0.1 * L), optics.Pupil(aperture_radius=10e-6), prism()],
    ids=["focused", "open", "pinhole", "prism"],
)
def test_agrees_with_the_convolution(pupil):
    """Relative RMSE below 1 % of the mean signal at 16 rays per receptor."""
    e = eye(pupil=pupil)
    cells = cells_per_receptor(e.resolution)
    expected = convolved(e, cells)
    found = sampled(e, receptive_field_sensor(e, 16 * 81, cells))
    error = np.sqrt(np.mean((found - expected) ** 2)) / expected.mean()
    assert error < 0.01


def test_error_falls_with_rays():
    """Errors fall faster than 1/sqrt(n), because the points have low discrepancy."""
    e = eye(pupil=focused())
    cells = cells_per_receptor(e.resolution)
    expected = convolved(e, cells)
    rays = np.array([1, 4, 16, 64]) * 81
    errors = [np.sqrt(np.mean((sampled(e, receptive_field_sensor(e, n, cells)) - expected) ** 2)) for n in rays]
    slope = np.polyfit(np.log(rays), np.log(errors), 1)[0]
    assert slope < -0.5


def test_a_flipped_kernel_is_noticed(monkeypatch):
    e = eye(pupil=prism())
    cells = cells_per_receptor(e.resolution)
    expected = convolved(e, cells)
    kernel = optics.Eye.kernel
    monkeypatch.setattr(type(e), "kernel", lambda self, s, z: kernel(self, s, z)[:, ::-1, ::-1])
    found = sampled(e, receptive_field_sensor(e, 16 * 81, cells))
    assert np.sqrt(np.mean((found - expected) ** 2)) / expected.mean() > 0.05


def test_white_light_gives_the_kernels_power():
    """The weights of a receptor sum to the power inside the kernel, so a uniform scene gives exactly a² times this
    power.
    """
    e = eye(pupil=optics.Pupil(aperture_radius=0.1 * L))
    sensor = build_sensor(e, 4)
    power = e.kernel(cells_per_receptor(e.resolution)).sum(axis=(1, 2))
    for weights, p in zip(sensor.weights, power, strict=True):
        np.testing.assert_allclose(weights.sum(axis=1), p, rtol=1e-5)


def dense(sensor):
    """Return the weights as one array, (band, receptor, ray)."""
    return np.stack([w.toarray() for w in sensor.weights]).astype(float)


@pytest.mark.parametrize("components", [1, 2, 3])
def test_signals_are_the_weighted_sums(components):
    """Both implementations agree: bands multiplied into the weights (few components), or one band after the other."""
    e = eye(pupil=focused(), resolution=(4, 5))
    sensor = receptive_field_sensor(e, 400, 4)
    rng = np.random.default_rng(0)
    light = rng.random((components, 37, 400), dtype=np.float32)
    basis = np.eye(3) if components == 3 else rng.random((components, 3))
    mixing = rng.random((2, 3))
    expected = np.einsum("cb,kb,brp,kvp->vcr", mixing, basis, dense(sensor), light)
    found = sensor.receptor_sums(mixing, basis)(light)
    np.testing.assert_allclose(found.reshape(37, 2, 20), expected, rtol=2e-5)
    bands = np.einsum("kb,kvp->bvp", basis, light).astype(np.float32)
    np.testing.assert_allclose(
        sensor.receptor_radiance(bands), np.einsum("brp,bvp->bvr", dense(sensor), bands), rtol=2e-5
    )


@pytest.mark.parametrize("density", [0.05, 1.0])
def test_signals_of_a_view_do_not_depend_on_the_other_views(density):
    """Rows need products of different sizes. A few views take one product per row, and no views that fill up others."""
    rng = np.random.default_rng(3)
    weights = rng.random((3, 45, 900), dtype=np.float32) * (rng.random((3, 45, 900)) < density)
    weights[:, 20:25, 100:] = 0  # a row with few rays
    product = RowProduct.from_weights([scipy.sparse.csr_array(w) for w in weights], (9, 5))
    light = rng.random((70, 900), dtype=np.float32)
    signals = product(light)
    np.testing.assert_allclose(signals[:, 1], (light @ weights[1].T).reshape(70, 9, 5), rtol=1e-5)
    for views in (1, 2, 5, 16, 31, 33, 64):
        np.testing.assert_array_equal(product(light[:views]), signals[:views])
    narrow, wide = product.stretches[4], product.stretches[0]
    assert (narrow.views, wide.views) == (32, 16)
    assert len(wide.product(light[:32], 2)) == 16
    assert len(wide.product(light[:32], 17)) == 32


def test_what_is_left_out_is_less_than_a_tenth_of_the_noise():
    """Omitted weights change no signal by more, for any scene between black and white in full daylight, and leave
    uniform scenes unchanged.
    """
    sigma = 0.005
    exact, cut = (
        receptive_field_sensor(
            optics.Eye(pupil=focused(), resolution=(9, 9), sensor_width=L, bands=3, noise_sigma=noise), 400, 4
        )
        for noise in (0.0, sigma)
    )
    assert cut.density < 0.7 * exact.density
    before, after = dense(exact), dense(cut)
    np.testing.assert_allclose(after.sum(axis=2), before.sum(axis=2), rtol=1e-5)
    worst = np.maximum(after - before, 0).sum(axis=2)  # the scene that is white exactly at the weights that have grown
    throughput = 0.3**2
    assert 0.02 * sigma < throughput * worst.max() <= 0.1 * sigma


def test_perfect_lens_averages_over_each_receptor():
    e = eye(resolution=(5, 7))
    found = sampled(e, box_sensor(e, 64))
    fine = 40
    y, x = ((np.arange(n * fine) + 0.5) / fine - n / 2 for n in (5, 7))
    picture = np.stack([scene(x[None, :], y[:, None], b) for b in range(3)])
    means = picture.reshape(3, 5, fine, 7, fine).mean(axis=(2, 4))
    expected = np.einsum("cb,byx->cyx", e.spectral_bands.weights, means)
    # the gradient is 0.6 per pitch, and 64 points have this discrepancy
    np.testing.assert_allclose(found, expected, atol=4e-3)


def test_perfect_lens_is_the_default_of_the_same_contract():
    e = eye(resolution=(5, 7))
    assert isinstance(build_sensor(e, 4), BoxSensor)
    assert build_sensor(e, 4).directions.shape == (5 * 7 * 4, 3)
    assert isinstance(build_sensor(eye(pupil=focused()), 4), ReceptiveFieldSensor)


def test_rows_go_down_and_columns_right():
    """The convention of docs/architecture.md: receptor (0, 0) looks up and to the left; x is right, y is up."""
    e = eye(resolution=(3, 3))
    d = box_sensor(e, 16).directions.reshape(3, 3, 16, 3).mean(axis=2)
    assert d[0, 0, 0] < 0 < d[0, 0, 1]
    assert d[2, 2, 1] < 0 < d[2, 2, 0]
    edge = box_sensor(e, 4096).directions
    assert np.degrees(np.arctan2(edge[:, 0], edge[:, 2])).max() == pytest.approx(22.5, abs=0.1)


def test_points_fill_the_square_evenly():
    """The star discrepancy over anchored boxes is O(log n / n), far below the random 1/sqrt(n)."""
    for n in (1, 4, 7, 100):
        points = low_discrepancy(n)
        assert points.shape == (n, 2)
        assert ((points > 0) & (points < 1)).all()
        corners = np.random.default_rng(0).random((200, 2))
        share = (points[None] < corners[:, None]).all(axis=-1).mean(axis=1)
        assert np.abs(share - corners.prod(axis=1)).max() < (1.5 + np.log2(n)) / n


def test_light_that_spreads_far_is_tabulated_on_coarser_cells():
    """Behind this pinhole, every receptor receives light from many times the field, which 32 cells per receptor cannot
    cover.
    """
    e = optics.Eye(pupil=optics.Pupil(aperture_radius=10e-6), resolution=(1, 1), fov_deg=1.5, sensor_width=L)
    with pytest.raises(optics.AccuracyError):
        receptive_field_sensor(e, 64, cells_per_receptor((1, 1)))
    sensor = build_sensor(e, 64)
    assert np.asarray(sensor.weights[0].sum()) == pytest.approx(1.0, abs=0.02)


def test_a_trial_is_part_of_the_sensor():
    """A trial has the directions and weights of some receptors only."""
    for e in (eye((4, 5)), eye((4, 5), focused())):
        some = np.array([0, 7, 19])
        sampling = eye_sampling(e)
        trial, sensor = sampling.trial(12, some), sampling.sensor(12)
        light = np.random.default_rng(0).random(len(sensor.directions))
        if isinstance(sensor, BoxSensor):
            mine = light.reshape(20, -1)[some].ravel()
            np.testing.assert_array_equal(trial.directions, sensor.directions.reshape(20, -1, 3)[some].reshape(-1, 3))
            whole = light.reshape(20, -1).mean(axis=1)[None].repeat(3, axis=0)
        else:
            mine = light
            np.testing.assert_array_equal(trial.directions, sensor.directions)
            whole = dense(sensor) @ light
        # The sensor omits weights that change signals by less than a tenth of the noise.
        np.testing.assert_allclose(trial.weights @ mine, whole[:, some], atol=0.1 * e.noise_sigma / e.throughput)


def test_so_few_rays_that_a_receptor_has_none_become_more():
    sampling = eye_sampling(eye((6, 6), focused()))
    with pytest.raises(NoRaysError, match="rays_per_receptor"):
        sampling.trial(1 / 36, np.arange(36))
    assert 1 < len(sampling.sensor(1 / 36).directions) < 36
