"""Attempts to meet a tolerance, kernels of circles and best foci, from given errors."""

import math
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from optics.apertures.soft_edge import SoftEdge
from optics.numerics.accuracy import FLOAT_NOISE, AccuracyError, Plan
from optics.point_spread import batch, concentration, pictures, through_focus
from optics.point_spread.pictures import _Attempt
from optics.point_spread.through_focus import ThroughFocus


@dataclass(frozen=True)
class Problem:
    tolerance: float = 1e-3
    dtype: str = "float64"
    all_light: bool = False
    steep: bool = True
    window: str = "window"

    @classmethod
    def from_beam(cls, beam, window, tolerance, dtype):
        assert (beam, window) == ("beam", "window")
        return cls(tolerance, dtype, False, False, window)


@dataclass(frozen=True)
class Request:
    problem: Problem = Problem()
    method: str = "auto"
    beam: str = "beam"
    plans: object = None

    def planned(self):
        return "plan", self.problem


class Whole:
    """A sampling of all light, with the error of its model."""

    def __init__(self, error=0.0):
        self.model_error, self.seconds = error, 7.0


class Part(Whole):
    """A sampling of the window's light."""

    def error(self, beam, problem, image):
        return 5.0


@pytest.fixture
def window_light(monkeypatch):
    monkeypatch.setattr(pictures, "WindowSampling", Part)
    monkeypatch.setattr(pictures, "Problem", Problem)


def attempt(sampling, **problem):
    return _Attempt(Request(Problem(**problem)), Plan("fft", (8, 8), "float64", 0.0, ""), sampling, np.ones(4))


@pytest.fixture
def again(monkeypatch, window_light):
    monkeypatch.setattr(_Attempt, "at", classmethod(lambda cls, request, planned: (request, planned)))

    def repeated(sampling, error, asked, last=False, **problem):
        found = attempt(sampling, **problem).repeated(error, asked, last)
        return None if found is None else found[0]

    return repeated


def test_approximations_are_followed_by_exact_methods(again):
    request = again(Whole(0.1), 5e-3, 1e-3)
    assert (request.method, request.problem) == ("exact", Problem())


@pytest.mark.parametrize(("last", "factor"), [(False, 0.3), (True, 3e-3)])
def test_the_next_tolerance(again, last, factor):
    """An error that is twice too large divides the tolerance by 2 and by 1/0.3, the last time by another 100."""
    problem = again(Whole(), 2e-3, 1e-3, last).problem
    assert problem.tolerance == pytest.approx(factor * 5e-4)
    assert (problem.all_light, problem.steep, problem.dtype) == (False, True, "float64")
    second = again(Whole(), 2e-3, 1e-3, last, tolerance=1e-4).problem
    assert second.tolerance == pytest.approx(factor * 5e-5)


def test_the_smallest_tolerance_of_a_type(again):
    least = 10 * FLOAT_NOISE["float64"]
    assert again(Whole(), 1e9, 1e-3).problem.tolerance == pytest.approx(least)
    assert again(Whole(), 1e9, 1e-3, tolerance=least * 1.001).problem.tolerance == pytest.approx(least)
    assert again(Whole(), 1e9, 1e-3, tolerance=least) is None


def test_samples_of_the_window_are_followed_by_samples_of_all_light(again):
    """They do not support very small tolerances. All light is then sampled at the original tolerance."""
    assert pictures.TIGHTEST == 3e-4
    for error, tolerance, whole in ((0.999e-3, 0.3e-6 / 0.999e-3, False), (1.001e-3, 1e-3, True)):
        problem = again(Part(), error, 1e-3).problem
        assert (problem.tolerance, problem.all_light) == (pytest.approx(tolerance), whole)
    kept = again(Part(), 1e-3, 1e-3, tolerance=1e-2).problem
    assert (kept.tolerance, kept.all_light) == (pytest.approx(3e-3), False)
    whole = again(Whole(), 2e-3, 1e-3, all_light=True).problem
    assert (whole.tolerance, whole.all_light) == (pytest.approx(1.5e-4), True)


def checked(monkeypatch, errors, sampling=Whole, method="auto", tries=3, model=0.0, refused=None):
    """Return the picture of the last attempt, and the arguments of all repetitions."""
    left, asked = list(errors), []

    def repeated(self, error, tolerance, last):
        asked.append((error, tolerance, last))
        if refused:
            raise AccuracyError(refused)
        return attempt(sampling(model)) if left else None

    monkeypatch.setattr(pictures, "spot_check", lambda beam, problem, image, seconds: left.pop(0))
    monkeypatch.setattr(Part, "error", lambda self, beam, problem, image: left.pop(0))
    monkeypatch.setattr(_Attempt, "repeated", repeated)
    monkeypatch.setattr(_Attempt, "stated", lambda self, error: error)
    monkeypatch.setattr(pictures, "_predicted_error", lambda image, sampling, problem: "predicted")
    try:
        return pictures._checked(attempt(sampling(model)), Request(Problem(), method), tries), asked
    except AccuracyError as error:
        return str(error), asked


def test_attempts_are_repeated_until_the_check_agrees(monkeypatch, window_light):
    assert checked(monkeypatch, [1e-3]) == (1e-3, [])
    assert checked(monkeypatch, [None]) == ("predicted", [])
    assert checked(monkeypatch, [2e-3, 1e-3]) == (1e-3, [(2e-3, 1e-3, False)])
    assert checked(monkeypatch, [3e-3, 2e-3, 1e-3]) == (1e-3, [(3e-3, 1e-3, False), (2e-3, 1e-3, True)])
    said, asked = checked(monkeypatch, [4e-3, 3e-3, 2e-3, 1e-3])
    assert len(asked) == 2
    assert said.startswith(
        "tolerance = 0.001: a check against the direct sum finds an error of 0.002 by fft in float64;"
    )
    assert said.endswith("widen the tolerance or use another method or dtype")
    found, asked = checked(monkeypatch, [5e-3, 4e-3, 3e-3, 2e-3, 1e-3], Part)
    assert found == 1e-3
    assert [last for *_, last in asked] == [False] * 4, "attempts with samples of the window are not counted"


def test_named_approximations_are_accepted(monkeypatch, window_light):
    assert checked(monkeypatch, [0.5], method="fft", model=0.1) == (0.5, [])
    assert checked(monkeypatch, [0.5, 1e-3], method="fft")[0] == 1e-3
    assert checked(monkeypatch, [0.5, 1e-3], method="auto", model=0.1)[0] == 1e-3


def test_refused_attempts_are_named(monkeypatch, window_light):
    said, _ = checked(monkeypatch, [2e-3], refused="tolerance = 3 needs 9 nodes: too many")
    assert said.endswith(", and a smaller error needs 9 nodes; widen the tolerance or shrink the window")
    said, _ = checked(monkeypatch, [2e-3], refused="too large")
    assert said.endswith("finds an error of 0.002 by fft in float64; widen the tolerance or shrink the window")


@pytest.mark.parametrize(("dx", "room"), [(0.125, 0.0), (0.125, math.inf), (0.125, 3.0), (0.125, 1e-3), (0.3, 3.0)])
def test_kernels_for_circles(dx, room):
    """The spectrum ends at 1/dx - 1 or earlier, at 2 at the earliest, so that the kernel fits into the room."""
    cutoff = 1.0
    found = concentration._kernel(dx, cutoff, room)
    last = 1 / dx - 1
    widest = SoftEdge(1.0, last, 1e-5)
    end = last if room == 0 else min(last, max(2.0, 1 + widest.reach * (last - 1) / room))
    assert found.stopband == pytest.approx(end)
    assert found == SoftEdge(1.0, found.stopband, 1e-5)
    assert concentration._kernel(dx / 10, 10.0, room / 10) == found


def focused(ratios):
    """Return PSFs at the distances 1, 2, 4 and 5, whose ratios are given (distance, wavelength)."""
    results = [
        SimpleNamespace(wavelengths=np.array([4e-7, 5e-7]), ratios=row, psf=np.full((2, 1, 1), k))
        for k, row in enumerate(ratios)
    ]
    return ThroughFocus(np.array([1.0, 2, 4, 5])[: len(ratios)], tuple(results))


def test_best_focus_is_the_vertex_of_a_parabola(monkeypatch):
    monkeypatch.setattr(through_focus, "strehl_ratio", lambda result: np.array(result.ratios))
    at = np.array([1.0, 2, 4, 5])
    found = focused(np.stack([1 - (at - 2.5) ** 2, 3 - 2 * (at - 3.75) ** 2], axis=1))
    np.testing.assert_allclose(found.best_focus(), [2.5, 3.75])
    np.testing.assert_array_equal(found.psf[:, 0, 0, 0], range(4))
    np.testing.assert_allclose(
        found.measured(lambda result: np.array(result.ratios) * 2)[0], [2 * -1.25, 2 * (3 - 2 * 2.75**2)]
    )
    for end in (1.0, 5.0):
        wrong = focused(np.stack([-((at - 2.5) ** 2), -((at - end) ** 2)], axis=1))
        with pytest.raises(
            ValueError, match=rf"^at 5e-07 m the Strehl ratio is highest at sensor_distance = {end:g} m"
        ):
            wrong.best_focus()
    with pytest.raises(ValueError, match=r"^2 sensor_distances: must be three or more"):
        focused(np.ones((2, 2))).best_focus()
    assert focused(np.stack([-((at[:3] - 2.5) ** 2)] * 2, axis=1)).best_focus() == pytest.approx([2.5, 2.5])


def test_distances_of_sensors(monkeypatch):
    asked = []
    monkeypatch.setattr(through_focus, "psf", lambda pupil, **given: asked.append((pupil, given)) or "psf")
    found = through_focus.through_focus("pupil", [1.0, 2.0], dx=3)
    assert found.results == ("psf", "psf")
    assert asked == [("pupil", {"sensor_distance": at, "dx": 3}) for at in (1.0, 2.0)]
    assert through_focus.through_focus("pupil", 4.0).distances.tolist() == [4]
    for wrong in ([], [2.0, 1.0], [1.0, 1.0], [[1.0, 2.0]], [-1.0, 1.0]):
        with pytest.raises(ValueError, match=r"^sensor_distances = "):
            through_focus.through_focus("pupil", wrong)
    with pytest.raises(ValueError, match=r"^sensor_distance: must be left out"):
        through_focus.through_focus("pupil", [1.0], sensor_distance=1.0)


def test_results_of_a_batch(monkeypatch):
    """Members are ordered by eye, then by depth, then by wavelength."""
    members = tuple(
        SimpleNamespace(wavelength=wave, distance=depth, pupil=eye)
        for eye in range(3)
        for depth in range(2)
        for wave in range(4)
    )
    tensor = np.arange(3.0 * 2 * 4).reshape(3, 2, 4, 1, 1)
    plans = tuple(Plan("fft", (8, 8), "float64", 1e-3 * k, "") for k in range(24))
    setup = SimpleNamespace(window=SimpleNamespace(centre=(1.0, 2.0)))
    monkeypatch.setattr(batch, "PSFResult", lambda *given: given)
    monkeypatch.setattr(batch, "_request", lambda member, setup: ("request", member))
    found = batch.PSFBatch.__new__(batch.PSFBatch)
    vars(found).update(tensor=tensor, dx=0.5, plans=plans, members=members, setup=setup)
    for given, place in (((2, 1), 5), ((1,), 2)):
        own, dx, waves, distance, pupil, mine, centre, requests = found.result(*given)
        eye, depth = divmod(place, 2)
        np.testing.assert_array_equal(own, tensor[eye, depth])
        assert (dx, waves.tolist(), distance, pupil, centre) == (0.5, [0, 1, 2, 3], depth, eye, (1.0, 2.0))
        assert mine == plans[4 * place : 4 * place + 4]
        assert requests == tuple(("request", member) for member in members[4 * place : 4 * place + 4])
    assert found.plan is plans[23]
    for wrong, name in (((3, 0), "eye"), ((-1, 0), "eye"), ((0, 2), "depth"), ((0, -1), "depth")):
        with pytest.raises(ValueError, match=f"^{name} = "):
            found.result(*wrong)
    assert repr(found) == "<PSFBatch of 3 x 2 x 4 x 1 x 1 samples 0.5 m apart, predicted error 2.3e-02 at most>"
