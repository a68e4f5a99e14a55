"""Areas behind a pupil against the convolution of `Eye.see`, with numerical means of a scene without a closed form."""

import dataclasses

import numpy as np
import pytest

import optics
from sim.eyes.allowed_error import allowed_error
from sim.eyes.field_areas import BEYOND, FieldAreas
from sim.eyes.receptive_fields import ReceptiveFields, cells_per_receptor
from sim.eyes.sampling import FieldSampling
from tests.sim.eyes.test_sensor import L, convolved, dense, eye, focused, plane_of, prism, scene

FINE = 8  # points along an area's side for its mean


def sampling_of(e, tolerance=None):
    return FieldSampling(e, ReceptiveFields.from_eye(e, cells_per_receptor(e.resolution)), tolerance=tolerance)


def from_means(e, sensor):
    """Return the signals (channel, h, w) from the scene's means over the sensor's areas."""
    width, height = (side * e.sensor_distance / e.receptor_pitch for side in sensor.extent)
    x, y = plane_of(e, sensor.directions.astype(float))
    within = (np.arange(FINE) + 0.5) / FINE - 0.5
    x, y = x[:, None, None] + width * within, y[:, None, None] + height * within[:, None]
    means = np.stack([scene(x, y, band).mean(axis=(1, 2)) for band in range(e.bands)]).astype(np.float32)
    receptors = sensor.receptor_radiance(means[:, None])[:, 0].reshape(e.bands, *e.resolution)
    return e.throughput * np.einsum("cb,byx->cyx", e.spectral_bands.weights, receptors)


def error(e, per_receptor, tolerance=None):
    expected = convolved(e, cells_per_receptor(e.resolution))
    found = from_means(e, sampling_of(e, tolerance).areas(per_receptor))
    return np.sqrt(np.mean((found - expected) ** 2)) / expected.mean()


@pytest.mark.parametrize(("pupil", "most"), [(focused(), 0.004), (prism(), 0.02)], ids=["focused", "prism"])
def test_agrees_with_the_convolution(pupil, most):
    """The error with one area per receptor is relative to the mean signal. (With 16 rays, an error of 0.01 is allowed.)
    The prism's light comes from 1.5 receptors around each direction, and so varies within one area.
    """
    assert error(eye(pupil=pupil), 1) < most


@pytest.mark.parametrize("pupil", [focused(), prism()], ids=["focused", "prism"])
def test_errors_fall_with_smaller_areas(pupil):
    """Errors fall with the square of the areas' sides: half the side reduces them at least threefold, and more if the
    areas then fit the fields. The tolerance for light beyond the lattice is small here. The convolution's own cells, a
    quarter as wide as receptors, have errors of at most 0.0015.
    """
    e = eye(pupil=pupil)
    errors = [error(e, n, 5e-4 * e.throughput) for n in (1, 4, 16)]
    assert errors[1] < errors[0] / 3
    assert errors[2] < 0.0015


@pytest.mark.parametrize("a", [0.9, 0.55, 0.3])
def test_the_lattice_reaches_as_far_as_the_noise_asks(a):
    """Behind a pinhole, the error of one area per receptor stays within the tolerance, although receptors at the rim
    get much of their light from outside the retina. A lattice whose reach ignores the noise has a larger error if the
    pinhole is wider than half of the retina.
    """
    e = dataclasses.replace(eye((15, 15), optics.Pupil(aperture_radius=a * L / 2)), noise_sigma=0.003)
    expected, allowed = convolved(e, cells_per_receptor(e.resolution)), allowed_error(e, None)

    def rms(tolerance):
        return np.sqrt(np.mean((from_means(e, sampling_of(e, tolerance).areas(1)) - expected) ** 2))

    assert rms(None) < allowed
    assert (rms(BEYOND * e.throughput) > allowed) == (a > 0.5)


@pytest.mark.parametrize("a", [0.55, 0.3])
def test_areas_of_several_receptors_err_as_the_square_of_their_sides(a):
    """Pinholes blur more widely than a receptor. Areas of four receptors have sides twice as long as areas of one."""
    e = eye((15, 15), optics.Pupil(aperture_radius=a * L / 2))
    of_four, of_one = (error(e, n, 5e-4 * e.throughput) for n in (1 / 4, 1))
    assert 3 < of_four / of_one < 5


def test_areas_are_shared_where_fields_are_twice_as_wide():
    """Behind a pinhole, a field is about as wide as the pinhole; behind a lens in focus, it is as wide as a receptor.
    The retina has 15 receptors.
    """
    for pupil, width in ((optics.Pupil(0.3 * L / 2), 4.5), (optics.Pupil(0.9 * L / 2), 13.5), (focused(), 1.0)):
        sampling = sampling_of(eye((15, 15), pupil))
        assert sampling.fields.widths == pytest.approx((width, width), rel=0.25)
        shared = [sampling.may_share(n) for n in (4 / 9, 1 / 4, 1 / 9)]
        assert shared == [width > 3, width > 4, width > 6]
    columns = sampling_of(eye((15, 15), optics.Pupil(0.3 * L / 2)))
    assert [columns.may_share(n, in_rows=False) for n in (1 / 2, 1 / 4)] == [True, False]


def test_areas_of_several_receptors_cover_all_in_the_middle():
    """Fifteen receptors need ten columns of 1.5 receptors or eight of two; the outer columns of the latter extend half
    a receptor beyond the retina.
    """
    fields = sampling_of(eye((15, 15), focused())).fields
    for per_receptor, columns in ((4 / 9, 10), (1 / 4, 8)):
        lattice = FieldAreas.from_fields(fields, (1, per_receptor**0.5))
        assert len(lattice.edges[1]) == columns + 1
        assert lattice.size == pytest.approx((per_receptor**-0.5, 1))
        assert sum(lattice.edges[1]) == pytest.approx(0)


def test_columns_of_any_height_leave_rows_alone():
    """An area covers all receptors of a column with `in_rows=False`, and only neighbours in a row share an area."""
    e = eye((4, 8), optics.Pupil(aperture_radius=0.1 * L))
    tall, square = (sampling_of(e).areas(1 / 4, in_rows=in_rows) for in_rows in (False, True))
    pitch = e.receptor_pitch / e.sensor_distance
    assert tall.extent == pytest.approx((4 * pitch, pitch))
    assert square.extent == pytest.approx((2 * pitch, 2 * pitch))


def turned(self, fields, receptors, right=FieldAreas.weights):
    return right(self, dataclasses.replace(fields, field=fields.field[:, ::-1, ::-1]), receptors)


def none_at_all(self, fields, receptors, right=FieldAreas.weights):
    """Give every receptor only the area that contains most of its field."""
    weights = right(self, fields, receptors)
    return (weights == weights.max(axis=2, keepdims=True)) * fields.power[:, None, None]


@pytest.mark.parametrize("wrong", [turned, none_at_all])
def test_wrong_weights_are_noticed(monkeypatch, wrong):
    monkeypatch.setattr(FieldAreas, "weights", wrong)
    assert error(eye(pupil=prism()), 1) > 0.03


def test_white_light_gives_the_kernels_power():
    e = eye(pupil=focused(0.1))
    sampling = sampling_of(e)
    for weights, power in zip(sampling.areas(2).weights, sampling.fields.power, strict=True):
        np.testing.assert_allclose(weights.sum(axis=1), power, rtol=1e-5)


def test_each_receptor_is_cut_and_light_comes_from_around_it():
    """A lens in focus needs no margin around the field. A prism looks to one side, and the lattice extends only
    there.
    """
    sharp, beside = (
        FieldAreas.from_fields(sampling_of(eye(pupil=pupil)).fields, (2, 3)) for pupil in (focused(), prism())
    )
    assert sharp.size == pytest.approx((1 / 3, 1 / 2))
    np.testing.assert_allclose(sharp.edges[1], np.arange(28) / 3 - 4.5)
    assert len(sharp.middles) == 18 * 27
    y, x = beside.edges
    rims = np.array([-4.5 - y[0], y[-1] - 4.5, -4.5 - x[0], x[-1] - 4.5])
    assert (rims >= 0).all()
    assert 0 < rims.max() < 3
    assert rims.min() == 0
    # A lattice that extends everywhere shows that the light beyond this lattice's upper end is within the tolerance.
    fields = sampling_of(eye(pupil=prism())).fields
    everywhere = FieldAreas((np.arange(-20, 21) / 2, np.arange(-60, 61) / 3))
    weights = everywhere.weights(fields, np.arange(81)).reshape(3, 81, 40, 120)
    beyond = weights[:, :, everywhere.edges[0][1:] <= y[0] + 1e-9].sum(axis=(2, 3)) / fields.power[:, None]
    assert beyond.mean() <= BEYOND


def test_a_trial_is_part_of_the_sensor():
    e, some = eye((4, 5), focused()), np.array([0, 7, 19])
    sampling = sampling_of(e)
    trial, sensor = sampling.area_trial(4, some), sampling.areas(4)
    np.testing.assert_array_equal(trial.directions, sensor.directions)
    assert trial.extent == sensor.extent
    # The sensor omits weights that change signals by less than a tenth of the noise.
    light = np.random.default_rng(0).random(len(sensor.directions))
    np.testing.assert_allclose(
        trial.weights @ light, (dense(sensor) @ light)[:, some], atol=0.1 * e.noise_sigma / e.throughput
    )


def test_rays_can_be_drawn_for_some_receptors_alone():
    """The same number of rays then gives more information about these receptors: all rays lie in one of their fields,
    and signals stay the same.
    """
    e, some = eye(pupil=focused()), np.array([0, 40])
    sampling = sampling_of(e)
    own = dataclasses.replace(sampling, fields=sampling.fields.drawn_for(some))

    def signals(which, rays):
        trial = which.trial(rays, some)
        x, y = plane_of(e, trial.directions.astype(float))
        return np.stack([trial.weights[band] @ scene(x, y, band) for band in range(e.bands)])

    trial = own.trial(4, some)
    assert (trial.weights.sum(axis=(0, 1)) > 0).all()
    assert (sampling.trial(4, some).weights.sum(axis=(0, 1)) > 0).mean() < 0.7
    np.testing.assert_allclose(signals(own, 16), signals(sampling, 256), atol=0.01)
