"""Handling of a PSF that fails the spot check."""

import subprocess
import sys

import numpy as np
import pytest

import optics
from optics.methods.window_sampling import WindowSampling
from optics.numerics.accuracy import FLOAT_NOISE
from optics.point_spread import pictures
from optics.point_spread.request import Request

LENS = optics.Pupil(20e-6, thin_lens_focal_length=400e-6)
PLAIN = optics.Pupil(20e-6)
WIDE = optics.Pupil(200e-6, aperture=optics.Polygon.regular(6))
WINDOW = {"dx": 1e-6, "shape": (21, 21)}
TOLERANCE = 1e-3


@pytest.fixture
def told(monkeypatch):
    """Return a function that lets the checks find given errors one after the other; it returns the checked problems."""

    def tell(*errors):
        checked, left = [], iter(errors)

        def spot_check(beam, problem, image, seconds):
            checked.append(problem)
            return next(left)

        def error(sampling, beam, problem, image):
            return spot_check(beam, problem, image, sampling.seconds)

        monkeypatch.setattr(pictures, "spot_check", spot_check)
        monkeypatch.setattr(WindowSampling, "error", error)
        return checked

    return tell


def test_the_error_that_is_seen_is_the_one_that_is_stated(told):
    checked = told(0.7 * TOLERANCE)
    result = optics.psf(LENS, sensor_distance=400e-6, tolerance=TOLERANCE, method="low_rank", **WINDOW)
    assert result.plan.predicted_error == 0.7 * TOLERANCE
    assert [problem.tolerance for problem in checked] == [TOLERANCE]


def test_an_exact_method_tries_again_for_a_smaller_tolerance(told):
    """A PSF whose error is ten times too large is computed again with 0.03 of the tolerance, for which the method takes
    more samples.
    """
    tight = 2e-4
    checked = told(10 * tight, 0.5 * tight)
    ask = {"sensor_distance": 400e-6, "method": "low_rank", "dtype": "float64", **WINDOW}
    result = optics.psf(LENS, tolerance=tight, **ask)
    assert [problem.tolerance for problem in checked] == pytest.approx([tight, 0.03 * tight])
    assert result.plan.samples == optics.plan(LENS, tolerance=0.03 * tight, **ask).samples
    assert result.plan.samples > optics.plan(LENS, tolerance=tight, **ask).samples
    assert result.plan.predicted_error == 0.5 * tight


@pytest.mark.parametrize("error", [3.0, 20.0])
def test_quick_samples_that_fail_give_way_to_samples_of_all_light(told, error):
    """More of the quick samples are used if slightly more accuracy is needed. If much more is needed, samples for all
    light are used instead.
    """
    asked, ask = 1e-2, {"sensor_distance": 400e-6, "method": "low_rank", **WINDOW}
    checked = told(error * asked, 0.5 * asked)
    result = optics.psf(LENS, tolerance=asked, **ask)
    whole = error > 5
    assert [problem.all_light for problem in checked] == [False, whole]
    assert checked[1].tolerance == pytest.approx(asked if whole else 0.3 * asked / error)
    assert result.plan.predicted_error == 0.5 * asked


def test_an_approximation_gives_way_to_an_exact_method(told):
    ask = {"sensor_distance": 0.4, "tolerance": 2e-4, "dx": 40e-6, "shape": (201, 201)}
    assert optics.plan(WIDE, **ask).method in ("fresnel", "fraunhofer")
    checked = told(0.5, 1e-4)
    result = optics.psf(WIDE, **ask)
    assert result.plan.method not in ("fresnel", "fraunhofer")
    assert [problem.tolerance for problem in checked] == [2e-4, 2e-4]
    exact = optics.psf(WIDE, **ask | {"method": "exact"}) if told(1e-4) == [] else None
    np.testing.assert_array_equal(result.psf, exact.psf)


def test_an_approximation_asked_for_by_name_stays(told):
    checked = told(0.5)
    result = optics.psf(PLAIN, sensor_distance=1e-3, method="fresnel", **WINDOW)
    assert (result.plan.method, result.plan.predicted_error, len(checked)) == ("fresnel", 0.5, 1)


def test_what_stays_wrong_is_refused(told):
    checked = told(*[2 * TOLERANCE] * (1 + pictures.TRIES))  # the first attempt has quick samples
    with pytest.raises(optics.AccuracyError, match=r"finds an error of 0\.002 by low_rank"):
        optics.psf(LENS, sensor_distance=400e-6, tolerance=TOLERANCE, method="low_rank", **WINDOW)
    assert len(checked) == 1 + pictures.TRIES


def test_no_more_digits_are_asked_than_there_are(told):
    """float32 can reach ten times its noise: a PSF that fails at that tolerance is not computed again."""
    least = 10 * FLOAT_NOISE["float32"]
    checked = told(10 * least)
    with pytest.raises(optics.AccuracyError, match="in float32"):
        optics.psf(LENS, sensor_distance=400e-6, tolerance=least, method="low_rank", **WINDOW)
    assert len(checked) == 1


def test_where_no_check_was_made_the_picture_tells_how_dark_it_is(told):
    """Far away from the focus, rounding is larger relative to the light, so float32 is less accurate there than in the
    focus.
    """
    ask = {"sensor_distance": 400e-6, "method": "low_rank", "tolerance": 2e-5, "dx": 0.5e-6, "shape": (9, 9)}
    told(None, None)
    assert optics.psf(LENS, **ask).plan.predicted_error < 2e-5
    with pytest.raises(optics.AccuracyError, match="so dark that float32 rounding"):
        optics.psf(LENS, **ask, centre=(150e-6, 0.0))


def test_the_first_small_picture_waits_for_no_import_of_what_it_does_not_need():
    """Importing all of SciPy's modules would take longer than `import numpy, scipy`. A pupil that deflects light does
    not need SciPy. Reading the packages' metadata for Dr.Jit's version takes longer than the PSF.
    """
    small = """
import sys
import optics
relief = optics.BSplineRelief.paraboloid(0.0, 1 / 120e-6, 25e-6)
pupil = optics.Pupil(25e-6, relief)
optics.psf(pupil, [550e-9], 240e-6, dx=0.25e-6, shape=(65, 65), tolerance=1e-2).psf
slow = {"scipy", "email", "socket", "difflib"}
print(sorted(name for name in sys.modules if name.split(".")[0] in slow or name == "importlib.metadata"))
"""
    found = subprocess.run([sys.executable, "-c", small], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


@pytest.mark.parametrize("alike", [None, False, True])
def test_methods_are_reused_only_on_request(monkeypatch, alike):
    """Each PSF has its own plan by default, so that its result does not depend on the others."""
    requests = optics.psf(LENS, [500e-9, 550e-9], sensor_distance=400e-6, **WINDOW).requests
    reused = []
    right = Request.after
    monkeypatch.setattr(Request, "after", lambda self, *before: reused.append(self) or right(self, *before))
    pictures.pictures(requests, **({} if alike is None else {"alike": alike}))
    assert len(reused) == bool(alike)
