"""Sums, means and windows of PSF results, from given samples, against formulas written out here."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import optics
from optics.numerics.accuracy import AccuracyError, Plan
from optics.numerics.grid import Grid
from optics.point_spread import psf_result
from optics.point_spread.psf_result import PSFResult

IMAGES = np.random.default_rng(0).random((3, 4, 5))
WAVES = np.array([0.4e-6, 0.5e-6, 0.7e-6])
WATER = optics.Pupil(1e-3, medium_n=1.33)


def plan(error=1e-3, method="direct"):
    return Plan(method, (1, 1), "float64", error, "")


def requests(*wavelengths):
    return tuple(SimpleNamespace(beam=SimpleNamespace(wavelength=at)) for at in wavelengths)


def result(**changes):
    given = {
        "tensor": IMAGES,
        "dx": 2e-6,
        "wavelengths": WAVES,
        "sensor_distance": 3e-3,
        "pupil": WATER,
        "plans": (plan(1e-3), plan(3e-3), plan(2e-3)),
        "centre": (1e-6, -2e-6),
        "requests": requests(*WAVES),
    }
    return PSFResult(**{**given, **changes})


def test_the_plan_is_the_least_accurate_one():
    assert result().plan.predicted_error == 3e-3
    assert result().window == Grid((4, 5), 2e-6, (1e-6, -2e-6))


def test_the_cutoff_is_that_of_the_steepest_rays():
    sine = 1 / math.hypot(1, 3)
    expected = [2 * sine * WATER.index_behind(at) / at for at in WAVES]
    np.testing.assert_allclose(result().cutoff, expected)
    assert result().highest_cutoff == pytest.approx(max(expected))


@pytest.mark.parametrize(
    ("methods", "cells"), [(["pinhole"] * 3, True), (["pinhole", "direct", "pinhole"], False), (["direct"] * 3, False)]
)
def test_errors_of_sums(methods, cells):
    """A sum's error is that of the PSF, three times as large for cells. The sum of points also misses the rim."""
    errors = (1e-3, 3e-3, 2e-3)
    seen = result(plans=tuple(map(plan, errors, methods)), dx=1e-7)
    sums = IMAGES.sum(axis=(1, 2)) * 1e-14
    assert seen.holds_cells is cells
    np.testing.assert_allclose(seen.window_sums, sums)
    np.testing.assert_allclose(seen.power, sums)
    np.testing.assert_allclose(seen.sum_error, (3 if cells else 1) * np.array(errors) * sums)
    rim = 0 if cells else (sums - IMAGES[:, 1:-1, 1:-1].sum(axis=(1, 2)) * 1e-14) / 2
    np.testing.assert_allclose(seen.power_error, seen.sum_error + rim)
    fewer = result(plans=(plan(2e-3), plan(5e-3)))
    np.testing.assert_allclose(fewer.sum_error, 5e-3 * IMAGES.sum(axis=(1, 2)) * 4e-12)


def test_which_can_be_computed_again():
    assert result().can_recompute
    assert not result(requests=()).can_recompute
    assert not result(requests=requests(*WAVES[::-1])).can_recompute
    shares = np.array([0.2, 0.3, 0.5])
    mean = {"tensor": IMAGES[:1], "wavelengths": np.array([shares @ WAVES]), "shares": shares}
    assert result(**mean).can_recompute is True
    assert not result(**mean, requests=requests(*WAVES[:2])).can_recompute
    assert not result(**{**mean, "wavelengths": np.array([0.5e-6])}).can_recompute
    whole = result(**mean)
    assert whole.highest_cutoff == pytest.approx(whole.cutoff[0] * (shares @ WAVES) / WAVES[0])
    lost = result(**mean, requests=())
    assert lost.highest_cutoff == pytest.approx(lost.cutoff[0])


def test_means():
    shares = np.array([0.2, 0.3, 0.5])
    seen = result(field_parts=(IMAGES, IMAGES))
    found = seen.mean(shares)
    np.testing.assert_allclose(found.psf[0], np.tensordot(shares, IMAGES, axes=1), rtol=1e-6)
    assert found.wavelengths == pytest.approx([shares @ WAVES])
    assert (found.plans, found.requests, found.field_parts) == ((plan(3e-3),), seen.requests, None)
    assert found.shares is not None
    assert result(requests=requests(1e-6)).mean(shares).requests == ()
    assert found.mean(np.array([1.0])) is found
    for bad in ([0.5, 0.5], [0.2, 0.3, 0.6], [[0.2, 0.3, 0.5]]):
        with pytest.raises(ValueError, match=r"shares = .*: must be 3 numbers that sum to 1"):
            seen.mean(bad)


def test_one_wavelength():
    seen = result(field_parts=(IMAGES, 2 * IMAGES))
    for index in range(3):
        one = seen.of_wavelength(index)
        np.testing.assert_array_equal(one.psf, IMAGES[index : index + 1])
        assert one.wavelengths == [WAVES[index]]
        assert (one.plans, one.requests) == (seen.plans[index : index + 1], seen.requests[index : index + 1])
        np.testing.assert_array_equal(one.field_parts[1], 2 * IMAGES[index : index + 1])
    assert result().of_wavelength(1).field_parts is None
    common = result(plans=(plan(),), requests=()).of_wavelength(1)
    assert (common.plans, common.requests) == ((plan(),), ())
    single = result(tensor=IMAGES[:1], wavelengths=WAVES[:1])
    assert single.of_wavelength(0) is single
    for bad in (-1, 3):
        with pytest.raises(ValueError, match=rf"index = {bad}: must be a whole number in \[0, 2\]"):
            seen.of_wavelength(bad)


def test_fields_are_complex():
    assert result().field is None
    parts = tuple(SimpleNamespace(numpy=lambda k=k: k * IMAGES) for k in (1, 2))
    np.testing.assert_array_equal(result(field_parts=parts).field, (1 + 2j) * IMAGES)


def test_they_are_printed_in_a_line():
    assert repr(result()) == "<PSFResult 3 wavelengths, 4 x 5 samples 2e-06 m apart, predicted error 3.0e-03>"
    assert repr(result(tensor=IMAGES[:1])).startswith("<PSFResult 1 wavelength, 4 x 5 ")


def asked_for(monkeypatch, seen, *arguments):
    """Return the window on which a PSF with this pitch is computed again."""
    asked = []
    monkeypatch.setattr(PSFResult, "recompute_on", lambda self, window, what: asked.append((window, what)) or "new")
    assert seen.with_pitch(*arguments) == "new"
    ((window, what),) = asked
    assert what == arguments[1]
    return window


@pytest.mark.parametrize(("coarsest", "parts"), [(1e-6, 2), (0.99e-6, 3), (0.5e-6, 4), (1.99e-6, 2)])
def test_finer_samples_fill_the_same_cells(monkeypatch, coarsest, parts):
    seen = result()
    window = asked_for(monkeypatch, seen, coarsest, "it")
    assert window.shape == (4 * parts, 5 * parts)
    assert window.dx == pytest.approx(2e-6 / parts)
    for fine, coarse in ((window.x, seen.x), (window.y, seen.y)):
        ends = fine[0] - window.dx / 2, fine[-1] + window.dx / 2
        assert ends == pytest.approx((coarse[0] - 1e-6, coarse[-1] + 1e-6), abs=1e-12)


def test_samples_that_are_fine_enough_are_kept(monkeypatch):
    seen, cells = result(), result(plans=(plan(method="pinhole"),))
    assert seen.with_pitch(2e-6, "it") is seen
    assert cells.with_pitch(1e-9, "it") is cells
    windowed = result(for_window=True)
    assert asked_for(monkeypatch, windowed, 2e-6, "a sum") == windowed.window
    lost = result(for_window=True, requests=())
    assert lost.with_pitch(2e-6, "it") is lost


def test_power_needs_two_samples_per_cutoff(monkeypatch):
    asked = []
    monkeypatch.setattr(PSFResult, "with_pitch", lambda self, coarsest, what: asked.append((coarsest, what)) or self)
    seen = result()
    seen.power  # noqa: B018
    assert asked == [(pytest.approx(0.5 / seen.cutoff.max()), "power")]


def test_what_cannot_be_computed_again_is_refused(monkeypatch):
    window, large = Grid((7, 9), 1e-7), Grid((2049, 2050), 1e-7)
    needs = r"it needs 7 x 9 samples 1e-07 m apart, and this PSF has 4 x 5 samples 2e-06 m apart"
    with pytest.raises(AccuracyError, match=rf"{needs}: set dx=1e-07, shape=\(7, 9\)$"):
        result(requests=()).recompute_on(window, "it")
    with pytest.raises(AccuracyError, match=r"it needs 2049 x 2050 samples .*: set dx="):
        result().recompute_on(large, "it")
    monkeypatch.setattr(psf_result, "_through", lambda request, window: (request, window))
    monkeypatch.setattr(psf_result, "spread", lambda requests: SimpleNamespace(of=requests, mean=lambda s: ("mean", s)))
    seen = result()
    assert seen.recompute_on(window, "it").of == [(request, window) for request in seen.requests]
    assert seen.recompute_on(Grid((2049, 2049), 1e-7), "it").of
    wide = result(tensor=np.broadcast_to(1.0, (3, 2049, 2050)))
    assert wide.recompute_on(wide.window, "it").of
    shares = np.array([0.2, 0.3, 0.5])
    mean = result(tensor=IMAGES[:1], wavelengths=np.array([shares @ WAVES]), shares=shares)
    assert mean.recompute_on(window, "it")[1] is mean.shares

    def fails(requests):
        raise AccuracyError("too dark")

    monkeypatch.setattr(psf_result, "spread", fails)
    with pytest.raises(AccuracyError, match=rf"^{needs}, which fails: too dark$"):
        seen.recompute_on(window, "it")


@pytest.mark.parametrize("method", ["auto", "exact", "geometric", "angular_spectrum"])
def test_requests_for_other_windows(method):
    """All light counts, exact methods are compared again, and approximate ones are kept."""
    pupil = optics.Pupil(1e-4, thin_lens_focal_length=3e-3)
    (asked,) = optics.psf(pupil, dx=2e-6, shape=(5, 5), tolerance=0.2, method="auto").requests
    asked = psf_result.replace(asked, method=method, keeps_field=True)
    window = Grid((7, 9), 1e-6)
    found = psf_result._through(asked, window)
    assert found.problem.window == window
    assert (found.problem.all_light, found.problem.tolerance, found.problem.dtype) == (True, 0.2, asked.problem.dtype)
    assert found.method == (method if method == "geometric" else "auto")
    assert (found.most_seconds, found.keeps_field, found.beam) == (20.0, False, asked.beam)
    steep = psf_result.replace(asked, problem=psf_result.replace(asked.problem, steep=True, reach=3.0))
    through = psf_result._through(steep, window).problem
    assert (through.steep, through.reach) == (True, 3.0)
    assert not found.problem.steep


@pytest.mark.parametrize("count", [7, 8])
def test_eight_wavelengths_share_a_plan(monkeypatch, count):
    pupil = optics.Pupil(1e-4, thin_lens_focal_length=3e-3)
    asked, own = [], psf_result.pictures
    monkeypatch.setattr(psf_result, "pictures", lambda requests, alike: asked.append(alike) or own(requests, alike))
    found = optics.psf(pupil, np.linspace(5e-7, 6e-7, count), dx=4e-6, shape=(5, 5), tolerance=0.2)
    assert asked == [count == 8]
    assert found.psf.shape == (count, 5, 5)
