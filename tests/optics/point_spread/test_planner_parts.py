"""Choice among methods, from given samplings: order, limits and the resulting plan."""

import math
from types import SimpleNamespace

import pytest

from optics.methods.window_rank import DERIVATIVE_ERROR
from optics.numerics.accuracy import FLOAT_NOISE, AccuracyError
from optics.point_spread import planner
from tests.optics.point_spread.test_cost_formulas import problem_of, sampling


@pytest.fixture
def given(monkeypatch):
    """Return a function that chooses among given samplings, and the names of the methods that were planned."""
    monkeypatch.setattr(planner, "PSF_CALL", 0.0)
    monkeypatch.setattr(planner, "window_seconds", lambda problem: 0.0)
    monkeypatch.setattr(planner, "check_seconds", lambda problem, option: 0.0)
    monkeypatch.setattr(planner, "window_bytes", lambda *_: 0.0)

    def choose(options, method="auto", most_seconds=60.0, coarse=None, **changes):
        planned = []

        def made(name):
            def of(problem):
                planned.append(name)
                return options.get(name, ())

            return of

        for name in ("EXACT", "METHODS", "FOR_PIXELS", "FOR_STEEP"):
            monkeypatch.setattr(planner, name, {key: made(key) for key in getattr(planner, name)})
        monkeypatch.setattr(planner, "window_sampling", lambda problem: coarse)
        settings = {"steep": False, "divided": False, "wavelength": 5e-7, "scalar_error": 0.25, "band": lambda: 1e6}
        problem = problem_of(**(settings | changes))
        try:
            return *planner.choose.__wrapped__(problem, method, most_seconds), planned
        except AccuracyError as error:
            return error, planned

    return choose


SLOW, FAST = sampling("rayleigh_sommerfeld", 3.0), sampling("low_rank", 2.0)


def test_the_fastest_sampling_within_the_limits(given):
    plan, best, planned = given({"rayleigh_sommerfeld": [SLOW], "low_rank": [sampling(seconds=1.0, size=5e9), FAST]})
    assert best is FAST
    assert (plan.method, plan.samples, plan.seconds, plan.dtype) == ("low_rank", (64, 32), 2.0, "float32")
    assert [option.method for option in plan.options] == ["low_rank", "rayleigh_sommerfeld"]
    assert [option.verdict for option in plan.options] == ["chosen", "1.5 times as slow"]
    assert set(planned) == set(planner.METHODS) - {"pinhole"}, "it is a last resort"
    error = 5e-4 + FLOAT_NOISE["float32"]
    assert plan.predicted_error == pytest.approx(error)
    assert plan.options[1].predicted_error == pytest.approx(error)
    assert plan.why.startswith(
        "Fresnel number 7.25, largest sine of the included light 0.5; cheapest method that meets"
    )
    assert (plan.scalar_error, plan.derivative_error, plan.padding) == (0.25, None, 1.0)
    assert given({"rayleigh_sommerfeld": [SLOW], "low_rank": [FAST]}, most_seconds=2.0)[1] is FAST
    assert given({"rayleigh_sommerfeld": [SLOW], "low_rank": [sampling("low_rank", 4.0)]}, most_seconds=3.0)[1] is SLOW


def test_approximations_have_an_allowed_error(given):
    """Half of the tolerance and rounding are for sampling. A method that is requested by name may exceed it."""
    edge = 5e-4 - FLOAT_NOISE["float32"]
    for error, used in ((edge, True), (edge * 1.001, False)):
        near = sampling("fresnel", 1.0, error=error)
        plan, best, _ = given({"rayleigh_sommerfeld": [SLOW], "fresnel": [near]})
        assert best is (near if used else SLOW)
    assert plan.options[-1].verdict == f"approximation with an error of {near.model_error:.2g}"
    wrong = sampling("fresnel", 1.0, error=0.3)
    plan, best, planned = given({"fresnel": [wrong]}, "fresnel")
    assert (best, planned) == (wrong, ["fresnel"])
    assert plan.predicted_error == pytest.approx(0.3 + 5e-4 + FLOAT_NOISE["float32"])
    assert "; requested" in plan.why


def test_fraunhofer_is_not_planned_if_fresnel_is_too_wrong(given):
    options = {"rayleigh_sommerfeld": [SLOW], "fresnel": [sampling("fresnel", 1.0, error=0.3)]}
    assert "fraunhofer" not in given(options)[-1]
    options["fresnel"] = [sampling("fresnel", 5.0, error=1e-5)]
    assert "fraunhofer" in given(options)[-1]


def test_methods_of_a_problem(given):
    """Derivatives exclude approximations; steep and pixelated reliefs have few methods each."""
    options = {"rayleigh_sommerfeld": [SLOW], "angular_spectrum": [sampling("angular_spectrum", 4.0)]}
    assert set(given(options, differentiated=True)[-1]) == set(planner.EXACT)
    assert given(options, steep=True)[-1] == ["angular_spectrum"]
    assert set(given(options, divided=True)[-1]) == set(planner.FOR_PIXELS)
    assert set(given(options, "exact")[-1]) == set(planner.EXACT)
    assert "far_field" not in given(options, "field")[-1]
    with pytest.raises(ValueError, match=r"^method = 'best': must be 'auto', 'exact' or one of hankel, low_rank"):
        given(options, "best")


def test_methods_that_cannot_be_faster_are_not_planned(given, monkeypatch):
    """Every method takes at least 1 s here; planning others after samples of the window saves 4 ms, or 15 ms with
    cells between knots.
    """
    weighing = {name: planner.Weighing(1.0) for name in planner.WEIGHING}
    monkeypatch.setattr(planner, "WEIGHING", weighing)
    first = next(iter(weighing))
    assert given({first: [sampling(first, 1.0)]})[-1] == [first]
    assert len(given({first: [sampling(first, 1.01)]})[-1]) > 1
    for seconds, knots, alone in ((1.004, None, True), (1.0041, None, False), (1.015, 1, True), (1.0151, 1, False)):
        coarse = sampling("low_rank", seconds)
        plan, best, planned = given(
            {}, coarse=coarse, knots=knots and SimpleNamespace(maps="height"), divided=bool(knots)
        )
        assert (best, plan.method) == (coarse, "low_rank")
        assert (planned == []) == alone


def test_refusals_state_the_shortest_time(given):
    """Only options that fit into memory count."""
    options = {"rayleigh_sommerfeld": [SLOW], "low_rank": [sampling("low_rank", 1.0, size=5e9)]}
    error, _ = given(options, most_seconds=2.9)
    assert error.seconds == 3.0
    assert "the limits are 4 GB and 2.9 s" in str(error)
    error, _ = given({})
    assert error.seconds is None
    error, _ = given({"fresnel": [sampling("fresnel", 1.0, error=0.3)]})
    assert error.seconds is None


@pytest.mark.parametrize("error", [0.0, 1e-5])
def test_errors_of_derivatives(given, monkeypatch, error):
    """Samples of the window have derivatives with a larger error; approximations predict none."""
    best = sampling("low_rank", 2.0, error=error)
    plan, *_ = given({"low_rank": [best]}, "low_rank", differentiated=True)
    if error:
        assert plan.derivative_error is None
        assert plan.why.endswith("; an approximation predicts no error of derivatives")
        return
    assert plan.derivative_error == pytest.approx(1e-3)
    assert plan.why.endswith("; derivatives exclude approximations")
    maps = SimpleNamespace(maps="height")
    plan, *_ = given({"low_rank": [best]}, "low_rank", differentiated=True, knots=maps, divided=True)
    assert plan.why.endswith("need nodes in each cell between knots (height)")
    monkeypatch.setattr(planner, "WindowSampling", SimpleNamespace)
    plan, *_ = given({"low_rank": [best]}, "low_rank", differentiated=True, knots=maps, divided=True)
    assert plan.derivative_error == pytest.approx(DERIVATIVE_ERROR * 1e-3)
    assert plan.why.endswith("need more samples (height)")
    assert math.isfinite(plan.seconds)
