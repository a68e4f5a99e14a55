"""Windows, errors and advice of contrasts, from given samples, against formulas written out here."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import optics
from optics.numerics.accuracy import AccuracyError
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.point_spread import contrast, modulation_transfer
from optics.point_spread.modulation_transfer import MTF
from optics.point_spread.window_loss import ErrorCauses

TYPES = precision("float64")


class Seen:
    """A PSF with given sums. Each recomputed one holds more light.

    sums: sums of this PSF and of the next ones, (PSF, wavelength)
    """

    def __init__(self, sums, shape=(2, 11, 21), dx=1e-6, can_recompute=True, refuses=False):
        self.sums, self.dx, self.can_recompute, self.refuses = sums, dx, can_recompute, refuses
        self.tensor, self.centre, self.highest_cutoff = np.zeros(shape), (3e-6, -4e-6), 2e5
        self.window_sums, self.sum_error, self.asked = np.array(sums[0]), np.array([1e-3, 2e-3]), []

    def recompute_on(self, window, what):
        if self.refuses:
            raise AccuracyError(f"{what}: too large")
        found = Seen(self.sums[1:], (2, *window.shape), window.dx)
        found.asked = [*self.asked, window]
        return found


KNOWN, UNSURE = np.array([0.5, 1.0]), np.array([0.01, 0.0])


def test_a_window_that_holds_enough_is_kept():
    seen = Seen([[0.45, 0.99]])
    lost = 1 - 0.45 / 0.5
    assert contrast._wide(seen, KNOWN, UNSURE, lost) is seen
    assert contrast._wide(Seen([[0.45, 0.99], [0.5, 1]]), KNOWN, UNSURE, lost * (1 - 1e-12)).asked != []
    dark = Seen([[-0.3, 0.5]])
    assert contrast._wide(dark, KNOWN, UNSURE, 1.0) is dark


def test_a_window_is_enlarged_by_what_it_loses_and_its_pitch_to_what_the_cutoff_allows():
    """The loss is four times the tolerance, so the width is multiplied by 4 √2. The pitch is doubled, because 2.5
    samples would fit the cutoff.
    """
    seen = contrast._wide(Seen([[0.46, 0.99], [0.495, 0.999]]), KNOWN, UNSURE, 0.02000001)
    half = 10.5e-6 * 4 * math.sqrt(2)
    side = 2 * math.ceil(half / 2e-6) + 1
    assert seen.asked == [Grid((side, side), 2e-6, (3e-6, -4e-6))]
    coarse = contrast._wide(Seen([[0.46, 0.99], [0.495, 0.999]], dx=2.6e-6), KNOWN, UNSURE, 0.02000001)
    assert coarse.asked[0].dx == 2.6e-6


def test_three_windows_are_tried():
    seen = contrast._wide(Seen([[0.4, 0.8]] * 5), KNOWN, UNSURE, 0.1)
    assert len(seen.asked) == 3


@pytest.mark.parametrize(
    ("shape", "able", "share"),
    [((2, 11, 21), False, 1.0), ((2, 11, 21), True, 1.0)]
    + [(shape, True, 2**0.75 * 1001 / 2049) for shape in ((2, 11, 1001), (2, 1001, 11))],
)
def test_a_refused_window_comes_with_a_tolerance_that_would_do(shape, able, share):
    """It allows for the light that the widest possible window loses, and for all other errors."""
    seen = Seen([[0.4, 0.9]], shape, can_recompute=able, refuses=True)
    seen.highest_cutoff = 1e7
    others = max((2 * 0.01 + 1e-3) / 0.5, 2e-3 / 1.0)
    enough = 0.2 * share + others
    rounded = math.ceil(enough * 10) / 10
    with pytest.raises(AccuracyError, match=rf"the MTF: too large; tolerance={rounded:.1g} needs fewer samples"):
        contrast._wide(seen, KNOWN, UNSURE, 0.05)


@pytest.mark.parametrize(
    ("error", "advice"), [(0.0123, "0.02"), (0.02, "0.02"), (0.5, "0.5"), (0.89, "0.9"), (0.91, None), (1.0, None)]
)
def test_advice_on_tolerances_has_one_digit(error, advice):
    expected = f"; tolerance={advice} needs fewer samples" if advice else ""
    assert contrast._looser(error) == expected


def test_means_are_trapezoidal_sums():
    values = np.random.default_rng(0).random((2, 9))
    for step in (1, 2):
        expected = np.trapezoid(values[:, ::step], dx=step / 8, axis=1)
        found = contrast._mean_over(TYPES.Float(values.ravel()), 9, step)
        np.testing.assert_allclose(found.numpy(), expected)


def test_shares_of_more_light_than_arrives_are_those_of_the_window():
    """The PSF of the second wavelength holds more light than arrives, so its shares sum to 1."""
    images = np.array([[[1.0, 2.0], [3.0, 4.0]], [[4.0, 3.0], [2.0, 1.0]]])
    tensor = TYPES.Tensor(images)
    seen = SimpleNamespace(tensor=tensor, dx=0.1, window=Grid((2, 2), 0.1, (0.3, 0.4)), cutoff=np.array([4.0, 5.0]))
    causes = ErrorCauses(np.zeros(2), np.zeros(2), np.array([0.1, 0.2]))
    found = contrast._transformed(seen, TYPES.Float([0.2, 0.05]), causes)
    np.testing.assert_allclose(found.shares.numpy(), [images[0] * 0.01 / 0.2, images[1] * 0.01 / 0.1])
    assert found.centre == (0.3, 0.4)
    np.testing.assert_array_equal(found.cutoff, [4.0, 5.0])
    np.testing.assert_array_equal(found.predicted_error, [0.1, 0.2])
    np.testing.assert_allclose(found.fx, [-5.0, 0.0])


def transfer(images, dx=0.5, lost=0.0, light=0.0, rest=0.0, causes=True):
    images = np.asarray(images, np.float64)
    each = ErrorCauses(*(np.broadcast_to(part, len(images)).astype(float) for part in (lost, light, rest)))
    return MTF.from_shares(TYPES.Tensor(images), Grid(images.shape[1:], dx, (0.2, -0.7)), np.ones(len(images)), each)


def test_contrasts_and_phases_are_fourier_sums():
    image = np.random.default_rng(1).random((2, 3, 5))
    found = transfer(image)
    x, y = (np.arange(5) - 2) * 0.5, (np.arange(3) - 1) * 0.5
    f = np.arange(-2, 3) / 2.5
    np.testing.assert_allclose(found.fx, f)
    np.testing.assert_allclose(found.fy, f)
    waves = np.exp(-2j * np.pi * np.outer(f, x)), np.exp(-2j * np.pi * np.outer(f, y))
    expected = np.einsum("wyx,fx,gy->wgf", image, *waves)
    expected[:, 2, 2] = 1
    np.testing.assert_allclose(found.mtf, np.abs(expected), atol=1e-6)
    moved = expected * np.exp(-2j * np.pi * (f[None, :] * 0.2 - f[:, None] * 0.7))
    off = np.angle(np.exp(1j * found.phase) / (moved / np.abs(moved)))
    np.testing.assert_allclose(off, 0, atol=1e-5)
    for (row, column), value in np.ndenumerate(f[:, None] + 1j * f[None, :]):
        if (row, column) != (2, 2):
            np.testing.assert_allclose(found.otf(value.imag, value.real)[:, 0], moved[:, row, column], atol=1e-9)


def test_frequencies_up_to_half_a_cycle_per_sample_are_known():
    found = transfer(np.ones((1, 3, 3)))
    assert found.otf(1.0, -1.0).shape == (1, 1)
    assert found.otf([0.1, 0.2], [[0.3], [0.4]]).shape == (1, 4)
    for bad in ((1.001, 0), (0, -1.001), (np.nan, 0)):
        with pytest.raises(ValueError, match="fx, fy: must be finite and at most 1 per metre"):
            found.otf(*bad)


def test_errors_are_the_sum_of_their_causes(monkeypatch):
    images = np.random.default_rng(2).random((2, 3, 3)) / 9
    found = transfer(images, lost=[0.3, 0.4], light=[0.02, 0.03], rest=[0.001, 0.002])
    np.testing.assert_allclose(found.predicted_error, [0.301, 0.402])
    asked = []

    def loss(image, lost):
        asked.append((image, lost))
        return np.full((3, 3), lost / 100)

    monkeypatch.setattr(modulation_transfer, "spectrum_of_loss", loss)
    errors = found.errors
    assert [lost for _, lost in asked] == [0.3, 0.4]
    for k in range(2):
        rim = [*found.mtf[k, 0], *found.mtf[k, :, 0]]
        at_nyquist = math.sqrt(sum(value**2 for value in rim) / 6)
        expected = (0.003, 0.004)[k] + (0.02, 0.03)[k] * found.mtf[k] + (0.001, 0.002)[k] + at_nyquist
        expected[1, 1] = 0
        np.testing.assert_allclose(errors[k], expected)


def test_without_causes_all_errors_are_the_predicted_one():
    whole = transfer(np.ones((2, 3, 3)) / 9, rest=[0.1, 0.2])
    found = MTF(whole.tensor, whole.fx, whole.fy, whole.cutoff, whole.predicted_error, whole.shares)
    assert (found.centre, found.causes) == ((0.0, 0.0), None)
    np.testing.assert_array_equal(found.errors, np.array([0.1, 0.2])[:, None, None] * np.ones((3, 3)))
    first = found.first(1)
    assert first.causes is None
    assert first.predicted_error == [0.1]


def test_the_first_wavelengths_keep_all_that_belongs_to_them():
    whole = transfer(np.arange(36.0).reshape(3, 3, 4), lost=[0.1, 0.2, 0.3], light=[4, 5, 6], rest=[7, 8, 9])
    for count in (1, 2, 3):
        found = whole.first(count)
        np.testing.assert_array_equal(found.mtf, whole.mtf[:count])
        np.testing.assert_array_equal(found.shares.numpy(), whole.shares.numpy()[:count])
        np.testing.assert_array_equal(found.predicted_error, whole.predicted_error[:count])
        assert (len(found.cutoff), found.centre) == (count, whole.centre)
        for part in ("lost", "light", "rest"):
            np.testing.assert_array_equal(getattr(found.causes, part), getattr(whole.causes, part)[:count])
    for count in (0, 4):
        with pytest.raises(ValueError, match=rf"count = {count}"):
            whole.first(count)


def test_profiles_of_a_sample_and_of_bad_frequencies():
    one = transfer(np.ones((1, 1, 1)))
    assert one._dx == 1
    with pytest.raises(ValueError, match="the PSF has one sample"):
        one.profile([0.0])
    found = transfer(np.ones((1, 2, 2)) / 4)
    assert found._dx == pytest.approx(0.5)
    for bad in ([], [np.inf], [0.1, np.nan]):
        with pytest.raises(ValueError, match=r"frequencies = .*: must be finite, and at least one"):
            found.profile(bad)
    assert found.profile(0.0)[0, 0] == 1


def test_radial_errors_are_means_over_rings_and_the_largest_within_the_first():
    found = transfer(np.ones((1, 5, 5)) / 25, dx=0.2, rest=0.05)
    errors = np.random.default_rng(3).random((1, 5, 5)) * 0.04
    found.__dict__["errors"] = errors
    rows, columns = np.indices((5, 5)) - 2
    rings = np.rint(np.hypot(rows, columns)).astype(int)
    means = [max(errors[0][rings == ring].mean(), 0.05 if ring < 2 else 0) for ring in range(4)]
    got = found._radial_errors(np.array([0.0, 0.5, 1.0, 1.25, -2.0, 7.0]))[0]
    np.testing.assert_allclose(got, [0, 0.05, means[1], 0.75 * means[1] + 0.25 * means[2], means[2], means[2]])


def test_orientations_are_added_until_two_means_agree(monkeypatch):
    """Means over 16 and over 16 orientations between them differ by more than allowed; both are used."""
    found = transfer(np.ones((1, 3, 3)) / 9, rest=0.1)

    def means(*values):
        left = list(values)
        asked.clear()

        def mean(self, f, n, shift):
            asked.append((n, shift))
            return np.array([[left.pop(0)]])

        monkeypatch.setattr(MTF, "_mean", mean)

    asked = []
    means(0.5, 0.5199)  # apart/2 = 0.00995, a tenth of the error is 0.01
    value, apart = found._over_orientations(np.ones(1))
    assert (value[0, 0], apart[0, 0]) == (pytest.approx(0.50995), pytest.approx(0.00995))
    assert asked == [(16, 0.0), (16, 0.5)]
    means(0.5, 0.5201, 0.6, 0.555025)
    value, _ = found._over_orientations(np.ones(1))
    assert asked == [(16, 0.0), (16, 0.5), (32, 0.5), (64, 0.5)]
    assert value[0, 0] == pytest.approx(((0.5 + 0.5201) / 2 / 2 + 0.6 / 2 + 0.555025) / 2)
    means(*[0.0, 0.1, 0.2, 0.5, 0.1, 0.5, 0.1], *[0.6] * 3)
    with pytest.raises(AccuracyError, match="frequencies: a mean over 1024 orientations has"):
        found._over_orientations(np.ones(1))


def test_image_quality_is_the_contrast_above_the_noise():
    """A single bright sample has the contrast 1 at all frequencies."""
    image = np.zeros((2, 3, 3))
    image[:, 1, 1] = 1
    found = transfer(image, rest=[0.01, 0.02])
    for throughput, noise, expected in ((1.0, 0.0, 1.0), (0.5, 0.1, 0.4), (0.5, 0.6, 0.0), (0.0, 0.1, 0.0)):
        value = optics.image_quality(found, 0.5, throughput, noise)
        np.testing.assert_allclose(value, [expected] * 2, atol=1e-6)
        value, error = optics.image_quality(found, 0.5, throughput, noise, with_error=True)
        np.testing.assert_allclose(value, [expected] * 2, atol=1e-6)
        at = np.linspace(0, 0.5, 257)
        np.testing.assert_allclose(error, throughput * found.profile(at, with_error=True)[1].mean(axis=1), rtol=1e-5)


def test_the_error_of_image_quality_includes_the_step():
    image = np.zeros((1, 3, 3))
    image[0, 1, 1] = 1
    found = transfer(image)
    contrasts = np.linspace(1, 0, 257) ** 2
    found.__dict__["profile"] = lambda f, with_error=False: (
        (contrasts[None], np.zeros((1, 257))) if with_error else None
    )
    value, error = optics.image_quality(found, 0.5, with_error=True)
    coarse = np.trapezoid(contrasts[::2], dx=1 / 128)
    assert value[0] == pytest.approx(np.trapezoid(contrasts, dx=1 / 256))
    assert error[0] == pytest.approx(coarse - value[0])


def test_causes_of_errors_are_relative_to_the_light_that_arrives(monkeypatch):
    """The window holds 0.4 and 1.1 of the light; 0.5 and 1 arrive, with the uncertainties 0.01 and 0.02."""
    light, unsure = TYPES.Float([0.5, 1.0]), np.array([0.01, 0.02])
    asked = []
    seen = SimpleNamespace(window_sums=np.array([0.4, 1.1]), sum_error=np.array([0.02, 0.03]))
    given = contrast.PSFResult.__new__(contrast.PSFResult)
    object.__setattr__(given, "wavelengths", np.array([5e-7]))
    monkeypatch.setattr(contrast.PSFResult, "highest_cutoff", 2e5)
    monkeypatch.setattr(
        contrast.PSFResult, "with_pitch", lambda self, pitch, what: asked.append((pitch, what)) or "fine"
    )
    monkeypatch.setattr(contrast, "arriving_light", lambda result, arriving: (light, unsure))
    monkeypatch.setattr(
        contrast, "_wide", lambda result, known, doubt, tolerance: asked.append((result, tolerance)) or seen
    )
    monkeypatch.setattr(contrast, "_transformed", lambda seen, light, causes: causes)
    found = contrast.mtf(given, tolerance=0.3)
    assert asked == [(0.5 / 2e5, "the MTF"), ("fine", 0.3)]
    np.testing.assert_allclose(found.lost, [(0.1 + 0.01) / 0.5, 0.02])
    np.testing.assert_allclose(found.light, [0.02, 0.02])
    np.testing.assert_allclose(found.rest, [0.04, 0.03])
    contrast.mtf(given, tolerance=float(found.total.max()))
    with pytest.raises(
        AccuracyError, match=r"tolerance = 0\.259: .* errors of up to 0\.26 \(PSF 0\.03, .* 0\.1, .* 0\.02\)"
    ):
        contrast.mtf(given, tolerance=0.259)
    contrast.mtf(given, tolerance=1.0)
