"""Errors of energies, spot checks and requests: samples, chances and messages, from given numbers."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import optics
from optics.numerics.accuracy import AccuracyError
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.point_spread import concentration, disk_sum, pictures, request, spot_check
from tests.optics.point_spread.test_psf_result import plan, result

TYPES = precision("float64")
LENS = optics.Pupil(30e-6, thin_lens_focal_length=3e-4)


def test_errors_of_energies_count_dark_circles_with_a_tenth():
    """The kernel's ripple is relative to the light of a circle at the brightest sample, at most to all light."""
    image = np.full((1, 41, 41), 1e8)
    one = result(
        tensor=image,
        wavelengths=np.array([4e-7]),
        plans=(plan(0.01),),
        requests=result().requests[:1],
        dx=1e-7,
        centre=(0.0, 0.0),
    )
    radii = np.array([0.0, 5e-8, 4e-7])
    value, error = optics.encircled_energy(one, radii, with_error=True)
    total = one.window_sums[0]
    share = np.maximum(value[0], 0.1 * total) / total
    bright = np.minimum(np.pi * radii**2 * 1e8, 1.0)
    np.testing.assert_allclose(error[0], one.sum_error[0] * share + 1e-5 * bright)
    cells = replace(one, plans=(plan(0.01, "pinhole"),))
    value, error = optics.encircled_energy(cells, radii, with_error=True)
    share = np.maximum(value[0], 0.1 * total) / total
    np.testing.assert_allclose(error[0], cells.sum_error[0] * share + 2e-4)
    edge = 20e-7
    optics.encircled_energy(cells, edge)
    for bad in (-1e-9, edge * 1.001):
        with pytest.raises(ValueError, match=r"radii = .*: must be in \[0, 2e-06\] m"):
            optics.encircled_energy(cells, bad)
    with pytest.raises(ValueError, match=r"radii has shape \(1, 1\)"):
        optics.encircled_energy(cells, [[1e-7]])
    optics.encircled_energy(cells, 0.0, (2e-6, -2e-6))
    for centre in ((2.1e-6, 0.0), (-2.1e-6, 0.0), (0.0, 2.1e-6), (0.0, -2.1e-6)):
        with pytest.raises(ValueError, match="must lie within the PSF's window"):
            optics.encircled_energy(cells, 0.0, centre)


def test_samples_around_a_circle(monkeypatch):
    """Fine samples suffice if the window holds the reach of the kernel; otherwise others are computed."""
    asked = []
    monkeypatch.setattr(
        type(result()), "recompute_on", lambda self, window, what: asked.append((window, what)) or "new"
    )
    fine = result(dx=0.3 / result().highest_cutoff)
    unit = 1 / fine.highest_cutoff
    wide = concentration._kernel(fine.dx, fine.highest_cutoff, math.inf).reach * unit
    assert concentration._around(fine, (0.0, 0.0), unit, unit + 1.01 * wide)[0] is fine
    assert asked == []
    for seen, room in ((fine, 1e-3 * unit), (result(dx=0.4 * unit), 100 * unit)):
        found, kernel = concentration._around(seen, (1e-6, 2e-6), unit, unit + room)
        pitch = min(seen.dx, unit / 3)
        half = math.ceil((unit + kernel.reach * unit) / pitch)
        assert found == "new"
        window, what = asked.pop()
        assert (window.shape, window.centre, what) == ((2 * half + 1,) * 2, (1e-6, 2e-6), "encircled energy")
        assert window.dx == pytest.approx(pitch)


@pytest.mark.parametrize("room", [1.0, 1e-9])
def test_light_around_a_disk(monkeypatch, room):
    """Light is computed again if its samples are too coarse, or too few beyond the disk."""
    cutoff = 1e6
    asked = []
    towards = SimpleNamespace(cutoff=cutoff, image=(1e-6, 2e-6), onto=lambda window: asked.append(window) or "new")
    light = SimpleNamespace(dx=1 / 3 / cutoff)
    reach = disk_sum._kernel(light.dx, cutoff).reach / cutoff
    monkeypatch.setattr(disk_sum, "_room", lambda light, middle: 1e-6 + reach * (1 + 1e-9 if room == 1.0 else 0.99))
    found = disk_sum._around(light, towards, (4e-6, -3e-6), 1e-6)
    if room == 1.0:
        assert found is light
        assert disk_sum._around(SimpleNamespace(dx=1.01 * light.dx), towards, (4e-6, -3e-6), 1e-6) == "new"
    pitch = 1 / 3 / cutoff
    height, width = (2 * math.ceil((off + 1e-6 + reach) / pitch) + 1 for off in (5e-6, 3e-6))
    assert asked == [Grid((height, width), pitch, (1e-6, 2e-6))]
    with pytest.raises(AccuracyError, match="needs more than 1025 samples along a side"):
        disk_sum._around(SimpleNamespace(dx=pitch), towards, (4e-6, -3e-6), 1.0)


def test_dark_windows_of_approximations_are_missed_altogether():
    problem = SimpleNamespace(tolerance=0.1, dtype="float64")
    sampling = SimpleNamespace(model_error=0.3, plane=lambda problem: 1.0)
    assert pictures._predicted_error(np.zeros(4), sampling, problem) == 1.0
    assert pictures._predicted_error(np.full(4, 0.5), sampling, problem) == pytest.approx(0.35, abs=1e-9)
    exact = SimpleNamespace(model_error=0.0, plane=lambda problem: 1.0)
    with pytest.raises(AccuracyError, match="the window is so dark that float64 rounding"):
        pictures._predicted_error(np.zeros(4), exact, problem)
    single = SimpleNamespace(tolerance=1e-5, dtype="float32")
    image = np.array([1.0, 3.0])
    rounding = (2e-6 * math.sqrt(2 / 4) + 1e-12 / 4) / math.sqrt(5)
    wide = SimpleNamespace(model_error=0.0, plane=lambda problem: 2.0)
    assert pictures._predicted_error(image, wide, single) == pytest.approx(5e-6 + rounding)


@pytest.mark.parametrize("reach", [None, 1e-5])
@pytest.mark.parametrize(("points", "window"), [(3, 9), (2, 2), (2, 9), (1, 2)])
def test_points_are_summed_directly_if_all_are_affordable(monkeypatch, reach, points, window):
    problem = SimpleNamespace(reach=reach, window=SimpleNamespace(shape=(1, window)))
    reference = SimpleNamespace(points=points)
    monkeypatch.setattr(spot_check, "_darkness", lambda beam, problem, bright: bright)
    monkeypatch.setattr(spot_check, "_affordable", lambda beam, problem, darkness, seconds: reference)
    monkeypatch.setattr(spot_check, "_at_points", lambda beam, problem, reference, x, y: x + y)
    monkeypatch.setattr(spot_check, "_own_error", lambda problem, reference, darkness: darkness / 100)
    found = spot_check.exact_psf(None, problem, np.arange(3.0), np.ones(3), 5.0, 1.0)
    if reach or points < min(3, window):
        assert found is None
    else:
        assert found[0].tolist() == [1, 2, 3]
        assert found[1] == 0.05


def test_chances_are_the_mean_of_six_distributions():
    """Dark windows have no bright rim, so that two of the distributions count once more in its place."""
    window = Grid((3, 4), 1e-6)
    rim, fixed = spot_check._fixed_chances((3, 4), (0.0, 0.0))
    assert fixed.sum() == pytest.approx(3)
    bright = np.random.default_rng(0).random(12)
    found = spot_check._chances(bright, window)
    assert found.sum() == pytest.approx(1)
    squares = np.pad(bright.reshape(3, 4) ** 2, 1)
    near = sum(squares[i : i + 3, j : j + 4] for i in range(3) for j in range(3)).ravel()
    lit = bright * rim
    expected = (fixed + bright / bright.sum() + near / near.sum() + lit / lit.sum()) / 6
    np.testing.assert_allclose(found, expected)
    oblique, _ = spot_check._fixed_chances((3, 4), (5.0, 0.0))
    assert oblique.sum() == pytest.approx(rim.sum())
    assert oblique.reshape(3, 4)[0, 3] > rim.reshape(3, 4)[0, 3]
    assert oblique.reshape(3, 4)[0, 0] < rim.reshape(3, 4)[0, 0]


def test_windows_off_the_axis_are_checked_outwards():
    away = Grid((3, 3), 1.0, (4.0, 0.0))
    squared = np.add.outer(away.y**2, away.x**2).ravel()
    rim, _ = spot_check._fixed_chances((3, 3), (0.0, 0.0))
    far = rim * (squared / squared.max()) ** 2
    expected = (rim + far * (rim.sum() / far.sum())) / 2
    np.testing.assert_allclose(spot_check._fixed_chances((3, 3), (4.0, 0.0))[0], expected)


def planned(monkeypatch, pupil, seconds, message="too fine", jump=0.0):
    """Plan a request for which no method is found, and return the error."""

    def fails(problem, method, most):
        raise AccuracyError(message, seconds=seconds)

    monkeypatch.setattr(request, "choose", fails)
    monkeypatch.setattr(request, "_wrapped", lambda pupil: "wrapped")
    height = SimpleNamespace(jump=jump) if jump or pupil == "height" else None
    own = SimpleNamespace(height=height, wavefront=1 if pupil == "wavefront" else None)
    asked = request.Request(SimpleNamespace(pupil=own), None)
    with pytest.raises(AccuracyError) as caught:
        asked.planned()
    return str(caught.value), caught.value.seconds


def test_advice_on_reliefs(monkeypatch):
    assert planned(monkeypatch, None, 5.0) == ("too fine", 5.0)
    assert planned(monkeypatch, "wavefront", 5.0) == ("too fine; a flatter wavefront needs less", 5.0)
    assert planned(monkeypatch, "height", None) == ("too fine; a flatter height needs less", None)
    assert planned(monkeypatch, "height", 5.0, "use method='fft'") == ("use method='fft'", 5.0)
    assert planned(monkeypatch, "height", 2.0, jump=1e-6) == ("too fine; wrapped", 2.0)
    assert planned(monkeypatch, "height", 2.1, jump=1e-6) == ("too fine; wrapped", None)
    assert planned(monkeypatch, "height", None, jump=1e-6) == ("too fine; wrapped", None)


def test_jumps_that_take_long_are_refused(monkeypatch):
    own = SimpleNamespace(height=SimpleNamespace(jump=1e-6), wavefront=None)
    asked = request.Request(SimpleNamespace(pupil=own), None)
    monkeypatch.setattr(request, "_wrapped", lambda pupil: "wrapped")
    for seconds in (2.0, 2.1):
        found = SimpleNamespace(seconds=seconds, method="fft"), "sampling"
        monkeypatch.setattr(request, "choose", lambda *_, found=found: found)
        if seconds == 2.0:
            assert asked.planned() == found
        else:
            with pytest.raises(AccuracyError, match=r"about 2\.1 s by fft: wrapped"):
                asked.planned()
    own.height = None
    assert asked.planned() == found


@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize("centre", [(0.0, 0.0), (1e-6, 0.0), (0.0, 1e-6)])
@pytest.mark.parametrize("samples", [9, 10**5])
def test_points_along_a_radius_are_enough_on_the_axis(monkeypatch, symmetric, centre, samples):
    """The time allows for all points that are wanted, at most one for each sample."""
    monkeypatch.setattr(spot_check, "_finer_detail", lambda beam, problem: 0.0)
    monkeypatch.setattr(spot_check, "turns", lambda problem, digits: 3.0)
    monkeypatch.setattr(spot_check, "node_count", lambda aperture, cycles, digits: 1.0)
    problem = SimpleNamespace(
        window=SimpleNamespace(shape=(1, samples), centre=centre), symmetric=symmetric, tolerance=1e-2, aperture=None
    )
    found = spot_check._affordable(None, problem, 0.0, 1e9)
    effort = spot_check.EFFORT
    wanted = effort.points_along_radius if symmetric and centre == (0.0, 0.0) else effort.points
    assert effort.points_along_radius != effort.points
    assert found.points == min(wanted, samples)
