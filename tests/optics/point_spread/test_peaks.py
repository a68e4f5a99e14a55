"""Peaks of given samples: paraboloids, splines, windows and errors, against closed forms."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import optics
from optics.numerics.accuracy import AccuracyError
from optics.numerics.autodiff import number
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.point_spread import strehl
from optics.point_spread.strehl import Peak
from tests.optics.point_spread.test_psf_result import plan, requests, result

TYPES = precision("float64")
CUTOFF = float(result().cutoff[0])


def one(image, **changes):
    """Return a PSF of one wavelength, whose samples are so close that a paraboloid fits."""
    given = {"wavelengths": result().wavelengths[:1], "plans": (plan(0.0),), "requests": requests(4e-7), "dx": 1e-9}
    return result(tensor=np.asarray(image, np.float64)[None], **{**given, **changes})


def paraboloid(shape, top, at, curvature):
    """Return samples of top - dᵀBd/2, where d is the distance from `at` (row, column)."""
    rows, columns = np.indices(shape)
    d = np.stack([columns - at[1], rows - at[0]])
    return top - np.einsum("iyx,ij,jyx->yx", d, np.array(curvature), d) / 2


def test_the_vertex_of_a_paraboloid_is_exact():
    seen = one(paraboloid((5, 7), 9.0, (2.2, 3.4), [[0.3, 0.1], [0.1, 0.5]]), centre=(1e-6, -2e-6))
    peak = strehl._vertex(seen)
    assert number(peak.value) == pytest.approx(9)
    assert peak.at == pytest.approx((1e-6 + 0.4e-9, -2e-6 + 0.2e-9), abs=1e-14)
    assert peak.error == pytest.approx(strehl.PARABOLOID_ERROR)
    beside = strehl._vertex(seen, (1, 2))
    assert number(beside.value) == pytest.approx(9)


@pytest.mark.parametrize("curvature", [[[0.3, 0.6], [0.6, 0.3]], [[0.0, 0.0], [0.0, 0.0]], [[-0.3, 0.1], [0.1, -0.5]]])
def test_samples_that_are_not_curved_have_no_vertex(curvature):
    """The sample itself counts."""
    image = paraboloid((3, 3), 9.0, (1, 1), curvature)
    peak = strehl._vertex(one(image), (1, 1))
    assert (number(peak.value), peak.at) == (9, pytest.approx((1e-6, -2e-6)))


def test_cells_have_no_vertex():
    image = paraboloid((5, 7), 9.0, (2.2, 3.4), [[0.3, 0.1], [0.1, 0.5]])
    peak = strehl._vertex(one(image, plans=(plan(0.01, "pinhole"),), dx=1e-4))
    assert number(peak.value) == image[2, 3]
    around = np.linalg.norm(image) / image[2, 3]
    assert peak.error == pytest.approx(0.01 * around + strehl.PARABOLOID_ERROR)


def test_the_error_of_a_vertex_grows_with_the_pitch():
    """A cosine at the cutoff whose peak is halfway between samples is missed by (2π dx f)⁴ / 170."""
    image = paraboloid((3, 3), 9.0, (1, 1), [[0.3, 0], [0, 0.5]])
    for share in (0.1, 0.2):
        seen = one(image, dx=share / CUTOFF, plans=(plan(1e-3),))
        around = np.linalg.norm(image) / 9
        assert strehl._vertex(seen).error == pytest.approx(1e-3 * around + (2 * math.pi * share) ** 4 / 170)


def test_a_spline_finds_the_brightest_point_between_samples():
    """The peak of a sum of cosines below the cutoff is a third of a sample from the brightest sample."""
    dx = 0.4 / CUTOFF
    x, y = ((np.arange(n) - n // 2) * dx for n in (21, 25))
    at = x[10] + dx / 3, y[12] - dx / 4
    image = np.outer(
        1 + np.cos(2 * np.pi * 0.3 * CUTOFF * (y - at[1])), 1 + np.cos(2 * np.pi * 0.2 * CUTOFF * (x - at[0]))
    )
    image *= np.outer(np.exp(-(((y - at[1]) / (6 * dx)) ** 2)), np.exp(-(((x - at[0]) / (6 * dx)) ** 2)))
    found = strehl._brightest(one(image, dx=dx, centre=(0.0, 0.0)))
    assert found == pytest.approx(at, abs=dx / 12)


def test_the_lower_sample_can_belong_to_the_higher_lobe():
    dx = 0.45 / CUTOFF
    x = (np.arange(41) - 20) * dx
    high, low = (x[10] + dx / 2, x[10] + dx / 2), (x[30], x[30])

    def lobe(at, top):
        return top * np.outer(np.sinc(0.5 * CUTOFF * (x - at[1])) ** 2, np.sinc(0.5 * CUTOFF * (x - at[0])) ** 2)

    image = lobe(high, 1.0) + lobe(low, 0.96)
    assert image.argmax() == 30 * 41 + 30
    assert strehl._brightest(one(image, dx=dx, centre=(0.0, 0.0))) == pytest.approx(high, abs=dx / 8)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("side", [-1, 1])
def test_searches_end_at_the_rim_of_the_window(axis, side):
    seen = one(np.ones((3, 5)), centre=(0.0, 0.0), dx=1.0)
    half = (2, 1)[axis]
    inside, outside = [0.0, 0.0], [0.0, 0.0]
    inside[axis], outside[axis] = side * (half + 0.5), side * (half + 0.5001)
    strehl._check_inside(seen, tuple(inside))
    with pytest.raises(AccuracyError, match=r"the intensity increases towards .*outside the window"):
        strehl._check_inside(seen, tuple(outside))


class Rays:
    def __init__(self, *points):
        self.points = points

    def densest(self):
        return iter(self.points)

    def __len__(self):
        return len(self.points)


def test_a_brighter_point_outside_is_refused(monkeypatch):
    """Points at most a sample outside the window are inside the reach of its peak."""
    asked, bright = [], SimpleNamespace(psf=np.array([1.0, 2.0]), plan=plan(0.1))
    monkeypatch.setattr(optics.PSFResult, "recompute_on", lambda self, window, what: asked.append(window) or bright)

    def seen(*points):
        rays = [
            SimpleNamespace(**vars(request), problem=SimpleNamespace(rays=Rays(*points))) for request in requests(4e-7)
        ]
        return one(np.ones((3, 5)), centre=(0.0, 0.0), dx=1e-6, requests=tuple(rays))

    strehl._refuse_brighter_outside(seen(), 0.0)
    strehl._refuse_brighter_outside(seen((2.99e-6, 0.0), (-2.99e-6, 1.99e-6), (0.0, -1.99e-6), (0.0, 0.0)), 0.0)
    cells = replace(seen((9e-6, 0.0)), plans=(plan(method="pinhole"),))
    strehl._refuse_brighter_outside(cells, 0.0)
    strehl._refuse_brighter_outside(one(np.ones((3, 5)), requests=()), 0.0)
    assert asked == []
    pitch = 0.4 / CUTOFF
    for outside in ((3.1e-6, 0.0), (-3.1e-6, 0.0), (0.0, 2.1e-6), (0.0, -2.1e-6)):
        strehl._refuse_brighter_outside(seen((0.0, 0.0), outside), 2.0 / 1.1 * 1.0001)
        assert asked.pop() == Grid.square(9, pitch).moved(outside)
        with pytest.raises(AccuracyError, match=r"rays land around .* where the PSF is brighter"):
            strehl._refuse_brighter_outside(seen(outside), 2.0 / 1.1 * 0.9999)
        asked.clear()


def test_peaks_are_compared_with_direct_sums(monkeypatch):
    """The direct sums lie on a paraboloid with the peak 5 whose sample is 4.9."""
    image = paraboloid((3, 3), 5.0, (1.2, 0.9), [[0.3, 0.1], [0.1, 0.5]])
    asked = []

    def exact(beam, problem, x, y, peak, seconds):
        asked.append((beam, x, y, peak, seconds))
        return None if beam == "long" else (image.ravel() * beam, 1e-6 * beam)

    monkeypatch.setattr(strehl, "exact_psf", exact)

    monkeypatch.setattr(optics.PSFResult, "can_recompute", True)
    monkeypatch.setattr(optics.PSFResult, "highest_cutoff", CUTOFF)
    peak = Peak(TYPES.Float(5.05), 0.5, (3e-6, 4e-6))
    for beams, shares, error in (
        ((1,), None, 0.01 + 1e-6),
        ((1, 3), np.array([0.25, 0.75]), 1 - 5.05 / 12.5 + 2.5e-6),
        ((1, "long"), np.array([0.25, 0.75]), 0.5),
    ):
        rows = tuple(
            SimpleNamespace(beam=beam, problem=None, planned=lambda: (None, SimpleNamespace(seconds=3.0)))
            for beam in beams
        )
        found = strehl._measured_error(one(image, requests=rows, shares=shares), peak)
        assert found == pytest.approx(min(error + strehl.PARABOLOID_ERROR / 4**4, 0.5), rel=1e-6)
    near = 1 / 32 / 4 / CUTOFF * np.array([-1, 0, 1])
    _, x, y, value, seconds = asked[0]
    np.testing.assert_allclose(x, np.tile(3e-6 + near, 3))
    np.testing.assert_allclose(y, np.repeat(4e-6 + near, 3))
    assert (value, seconds) == (5.05, 3.0)
    exactly = Peak(TYPES.Float(5.05), 1e-4, (0.0, 0.0))
    assert strehl._measured_error(one(image, requests=rows[:1]), exactly) == 1e-4
    cells = one(image, plans=(plan(method="pinhole"),))
    assert strehl._measured_error(cells, peak) == 0.5
    monkeypatch.setattr(optics.PSFResult, "can_recompute", False)
    assert strehl._measured_error(one(image), peak) == 0.5


def test_which_peak_is_searched(monkeypatch):
    """Fine samples suffice, and coarse ones if no others can be had; else the search climbs window by window."""
    calls = []
    monkeypatch.setattr(strehl, "_vertex", lambda seen: calls.append(seen) or "vertex")
    monkeypatch.setattr(strehl, "_brightest", lambda seen: (0.0, 0.0))
    inner, rim = np.zeros((3, 3)), np.zeros((3, 3))
    inner[1, 1] = rim[0, 1] = 1
    fine = 1 / 32 / CUTOFF

    def peak(image, dx, **changes):
        calls.clear()
        seen = one(image, dx=dx, **changes)
        assert strehl._peak(seen) == "vertex"
        return calls == [seen]

    assert peak(inner, fine)
    assert peak(rim, 1.0, plans=(plan(method="pinhole"),))
    lost = {"requests": ()}
    assert peak(inner, 0.4 / CUTOFF, **lost)
    with pytest.raises(AccuracyError, match="the Strehl ratio needs"):
        peak(inner, 0.41 / CUTOFF, **lost)
    with pytest.raises(AccuracyError, match="the Strehl ratio needs"):
        peak(rim, fine, **lost)
    asked = []

    def again(self, window, what):
        asked.append(window)
        return one(rim if len(asked) < 3 else inner, dx=window.dx, centre=window.centre)

    monkeypatch.setattr(optics.PSFResult, "recompute_on", again)
    start = {"centre": (0.0, 0.0), "dx": 0.4 / CUTOFF}
    assert not peak(inner, **start)
    assert asked == [Grid.square(9, fine).moved((0.0, -k * fine)) for k in range(3)]
    asked[:] = [None, None]
    assert not peak(np.ones((2, 3)), fine, centre=(0.0, 0.0)), "no sample has all neighbours"
    monkeypatch.setattr(strehl, "CLIMBS", 2)
    asked.clear()
    with pytest.raises(AccuracyError, match="no peak was found within 2 windows of 9 samples"):
        peak(inner, **start)


def test_a_flag_is_true_or_false():
    with pytest.raises(ValueError, match=r"^with_error = 2"):
        optics.strehl_ratio(None, with_error=2)


def test_the_peak_without_aberration_is_that_of_a_spherical_wave():
    """Its field is |1 - z/L - ikz ln(L/z)| for a circle. Behind a Gaussian mask, the integral over rings is the
    oracle. The wavelengths are those in water.
    """
    waves, z, radius = np.array([4e-7, 7e-7]), 3e-3, 1e-3
    pupil = optics.Pupil(radius, medium_n=1.33)
    k = 2 * np.pi * np.array([pupil.index_behind(at) for at in waves]) / waves
    far = math.hypot(z, radius)
    field = np.abs(1 - z / far - 1j * k * z * math.log(far / z)) ** 2
    found = strehl._unaberrated(result(pupil=pupil, sensor_distance=z), waves)
    np.testing.assert_allclose(found.numpy(), field / (np.pi * radius**2), rtol=1e-9)
    masked = optics.Pupil(radius, medium_n=1.33, mask=optics.GaussianMask(0.4e-3))
    node, weight = np.polynomial.legendre.leggauss(60)
    r, weight = radius * (node + 1) / 2, weight * radius / 2
    slant = np.hypot(r, z)
    size = weight * 2 * np.pi * r * np.exp(-((r / 0.4e-3) ** 2)) * z / (2 * np.pi * slant**2)
    field = (size / slant).sum() ** 2 + (k * size.sum()) ** 2
    found = strehl._unaberrated(result(pupil=masked, sensor_distance=z), waves)
    np.testing.assert_allclose(found.numpy(), field / (np.pi * radius**2), rtol=1e-9)
    ring = optics.Pupil(radius, medium_n=1.33, aperture=optics.Annulus(0.5))
    near = math.hypot(z, radius / 2)
    field = np.abs(z / near - z / far - 1j * k * z * math.log(far / near)) ** 2
    found = strehl._unaberrated(result(pupil=ring, sensor_distance=z), waves)
    np.testing.assert_allclose(found.numpy(), field / (0.75 * np.pi * radius**2), rtol=1e-9)


@pytest.mark.parametrize("place", [(0, 2), (3, 2), (2, 0), (2, 4), (1, 1), (2, 3)])
def test_samples_at_the_rim(place):
    image = np.zeros((4, 5))
    image[place] = 1.0
    assert strehl._at_rim(image) == (place[0] in (0, 3) or place[1] in (0, 4))


def test_ratios_of_several_wavelengths(monkeypatch):
    """Errors are relative to the peaks. A mean over wavelengths is divided by the mean of the ideal peaks."""
    peaks = {wave: Peak(TYPES.Float(2.0 * k), 0.1 * k, (0.0, 0.0)) for k, wave in enumerate(result().wavelengths, 1)}
    refused = []
    monkeypatch.setattr(strehl, "_peak", lambda one: peaks[one.wavelengths[0]])
    monkeypatch.setattr(strehl, "_refuse_brighter_outside", lambda one, most: refused.append(most))
    monkeypatch.setattr(strehl, "_measured_error", lambda one, peak: peak.error / 10)
    monkeypatch.setattr(strehl, "_unaberrated", lambda seen, waves: TYPES.Float(waves * 1e7))
    many = result()
    value, error = strehl.strehl_ratio(many, with_error=True)
    np.testing.assert_allclose(value, [2 / 4, 4 / 5, 6 / 7])
    np.testing.assert_allclose(error, [0.01 * 2 / 4, 0.02 * 4 / 5, 0.03 * 6 / 7])
    assert refused == pytest.approx([2 * 1.1, 4 * 1.2, 6 * 1.3])
    np.testing.assert_allclose(strehl.strehl_ratio(many), value)
    shares = np.array([0.5, 0.25, 0.25])
    mean = replace(
        many,
        tensor=many.tensor[:1],
        wavelengths=np.array([shares @ many.wavelengths]),
        plans=many.plans[:1],
        shares=shares,
    )
    peaks[mean.wavelengths[0]] = Peak(TYPES.Float(3.0), 0.1, (0.0, 0.0))
    np.testing.assert_allclose(strehl.strehl_ratio(mean), [3 / (0.5 * 4 + 0.25 * 5 + 0.25 * 7)])
