"""Costs of windows and verdicts of plans, from given samplings: every term counts, and limits are inclusive."""

import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import optics
from optics.methods.rayleigh_sommerfeld import LANES
from optics.numerics import cost
from optics.numerics.accuracy import FLOAT_NOISE, MOST_BYTES, MOST_SECONDS, AccuracyError
from optics.numerics.grid import Grid
from optics.point_spread import planner, window_cost
from optics.point_spread.planner import METHODS, Weighing
from optics.point_spread.request import GROWN, Request, Setup, sensor_place
from optics.point_spread.spot_check import EFFORT


def problem_of(shape=(20, 30), dtype="float32", **changes):
    """Return the numbers of a problem on which costs depend."""
    given = {
        "window": Grid(shape, 1e-6),
        "dtype": dtype,
        "symmetric": False,
        "reach": None,
        "tolerance": 1e-3,
        "knots": None,
        "pixelated": None,
        "radius": 4e-5,
        "distance": 2e-4,
        "fresnel_number": 7.25,
        "differentiated": False,
    }
    return SimpleNamespace(**{**given, **changes})


def sampling(method="low_rank", seconds=1.0, size=1e6, error=0.0, samples=(64, 32)):
    return SimpleNamespace(method=method, seconds=seconds, bytes=size, model_error=error, samples=samples, padding=1.0)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("symmetric", [False, True])
def test_a_window_costs_its_samples(dtype, symmetric):
    problem = problem_of(dtype=dtype, symmetric=symmetric)
    check = cost.CHECK_SYMMETRIC_SAMPLE if symmetric else cost.CHECK_SAMPLE
    assert window_cost.window_seconds(problem) == pytest.approx(600 * (cost.OUTPUT_SAMPLE[dtype] + check))
    assert window_cost.window_bytes(problem, sampling()) == 600 * (
        cost.OUTPUT_ARRAYS * cost.ITEM_BYTES[dtype] + cost.CHECK_BYTES
    )
    unchecked = problem_of(dtype=dtype, symmetric=symmetric, reach=1e-4)
    assert window_cost.window_seconds(unchecked) == pytest.approx(600 * cost.OUTPUT_SAMPLE[dtype])
    assert window_cost.window_bytes(unchecked, sampling()) == 600 * cost.OUTPUT_ARRAYS * cost.ITEM_BYTES[dtype]


@pytest.mark.parametrize("samples", [1, EFFORT.fewest - 1, EFFORT.fewest, EFFORT.few - 1, EFFORT.few, 10**6])
def test_the_check_of_a_direct_sum(samples):
    """The check has twice as many nodes. It takes no more than a share of the sum's time, except in small windows."""
    for seconds in (1e-9, 1e9):
        option = sampling("rayleigh_sommerfeld", seconds, samples=(5000, 1))
        found = window_cost.check_seconds(problem_of((1, samples)), option)
        points = max(min(EFFORT.points, samples), LANES)
        needed = 2 * 5000 * points / cost.PAIRS_PER_SECOND["float64"]
        share = EFFORT.share if samples >= EFFORT.few else EFFORT.share_of_few
        most = share * seconds * cost.PAIRS_PER_SECOND["float32"] / cost.PAIRS_PER_SECOND["float64"]
        assert found == pytest.approx(needed if samples < EFFORT.fewest else min(needed, most))
    assert window_cost.check_seconds(problem_of((1, samples), reach=1e-4), option) == 0
    assert window_cost.check_seconds(problem_of((1, samples)), sampling()) == 0


@pytest.mark.parametrize(("count", "arrays"), [(1, 1), (3, 1), (3, 2)])
def test_the_largest_window(monkeypatch, count, arrays):
    """It has as much memory or time as allowed. The refusal names a window of this size."""
    each = cost.OUTPUT_ARRAYS * 4 + cost.CHECK_BYTES + 4 * (count * arrays - 1)
    seconds = 1000 * (cost.OUTPUT_SAMPLE["float32"] + cost.CHECK_SAMPLE)
    limits = {"MOST_BYTES": 1000 * each, "MOST_SECONDS": seconds * (1 + 1e-9)}
    for name, limit in limits.items():
        monkeypatch.setattr(window_cost, name, limit)
    window_cost.check_window(Grid((25, 40), 1e-6), "float32", count, arrays)
    for name in limits:
        with monkeypatch.context() as patch:
            patch.setattr(window_cost, name, limits[name] * 0.999)
            most = math.isqrt(int(window_cost.MOST_BYTES / each))
            many = rf"^{count} PSFs of shape = \(25, 40\)" if count > 1 else r"^shape = \(25, 40\)"
            fewer = "compute fewer PSFs at once, or use" if count > 1 else "use"
            with pytest.raises(
                AccuracyError, match=rf"{many} needs .* s for each PSF; .* s: {fewer} at most {most**2} s"
            ):
                window_cost.check_window(Grid((25, 40), 1e-6), "float32", count, arrays)


def test_what_a_method_needs_to_pay():
    method = Weighing(1.0, 0.5, 0.25)
    assert method.pays(3.26, 4)
    assert not method.pays(3.25, 4)
    assert not method.pays(3.0, 4)
    assert Weighing(1.0).pays(1.1, 10**9)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_the_smallest_tolerance_of_a_precision(dtype):
    floor = 10 * FLOAT_NOISE[dtype]
    planner._check_dtype(problem_of(dtype=dtype, tolerance=floor))
    remedy = f"; dtype='float64' allows {10 * FLOAT_NOISE['float64']:g}" if dtype == "float32" else ""
    with pytest.raises(AccuracyError, match=rf"{dtype} allows at least {floor:g}{remedy}$"):
        planner._check_dtype(problem_of(dtype=dtype, tolerance=floor * 0.99))


def test_half_of_the_tolerance_is_for_sampling():
    problem = problem_of(dtype="float32", tolerance=1e-3)
    assert planner._sampling_error(problem) == pytest.approx(5e-4 + FLOAT_NOISE["float32"])
    assert planner._model_tolerance(problem) == pytest.approx(5e-4 - FLOAT_NOISE["float32"])


def test_limits_include_the_window():
    problem = problem_of()
    seconds, size = window_cost.window_seconds(problem), window_cost.window_bytes(problem, sampling())
    option = sampling(seconds=2.0, size=MOST_BYTES - size)
    assert planner._seconds(option, problem) == pytest.approx(2.0 + seconds + cost.PSF_CALL, rel=1e-9)
    assert planner._within(option, problem, planner._seconds(option, problem))
    assert not planner._within(option, problem, 2.0)
    assert not planner._within(sampling(seconds=2.0, size=MOST_BYTES - size + 1), problem, 60.0)
    assert planner._cost(option, problem) == (False, 2.0)
    assert planner._cost(sampling(size=MOST_BYTES), problem) == (True, 1.0)


def test_verdicts():
    problem, best = problem_of(), sampling(seconds=1e3)
    for option, verdict in (
        (best, "chosen"),
        (sampling(size=4e9), "too large: 4 GB, at most 4 GB"),
        (sampling(seconds=3e4), "too slow: at most 10000 s"),
        (sampling(seconds=2e3, error=0.3), "approximation with an error of 0.3"),
        (sampling(seconds=2.5e3), "2.5 times as slow"),
    ):
        assert planner._verdict(option, best, problem, 1e4) == verdict
    edge = planner._model_tolerance(problem)
    assert planner._verdict(sampling(seconds=1e3, error=edge), best, problem, 1e4) == "1.0 times as slow"
    slow = planner._seconds(sampling(seconds=3e3), problem)
    assert planner._verdict(sampling(seconds=3e3), best, problem, slow) == "3.0 times as slow"


def test_numbers_of_samples_in_words():
    assert planner._count(sampling("hankel", samples=(123, 45600))) == "integrals over 1.2e+02 radii and 4.6e+04 angles"
    assert planner._count(sampling("rayleigh_sommerfeld", samples=(77, 1))) == "77 nodes"
    assert (
        planner._count(sampling(samples=(64, 32))) == planner._count(sampling(samples=(32, 64))) == "64 samples across"
    )


MAPS = SimpleNamespace(maps="height")


@pytest.mark.parametrize(
    ("changes", "found", "method", "reason"),
    [
        (
            {"knots": MAPS},
            [],
            "fresnel",
            "method = 'fresnel': cannot compute derivatives with respect to samples of maps",
        ),
        (
            {"knots": MAPS},
            [],
            "auto",
            r"tolerance = 0.001: derivatives .* \(height\) need too many nodes: .*\(3e-05 m\) or .* \(radius 4e-05 m\)",
        ),
        ({"knots": MAPS}, [], "low_rank", "tolerance = 0.001: derivatives"),
        ({"pixelated": "pixels"}, [], "low_rank", "this method cannot sample a pixelated relief within its limits"),
        ({}, [], "hankel", "method = 'hankel': requires a circle or ring"),
        (
            {"symmetric": True},
            [],
            "hankel",
            "tolerance = 0.001 over a window of .* m at a distance of 0.0002 m reaches",
        ),
        ({}, [], "far_field", "method = 'far_field': for interpolation in angle"),
        ({}, [], "angular_spectrum", "tolerance = 0.001 over a window of"),
        (
            {},
            [sampling(seconds=9.0, samples=(8, 8)), sampling("fresnel", 7.0, 1e9)],
            "auto",
            r"tolerance = 0.001 needs 64 samples across, 1 GB and about 7 s by fresnel; the limits are 4 GB and 5 s: "
            r"widen the tolerance, shrink the window \(.* m\) or the pupil \(radius 4e-05 m, Fresnel number 7.25\)",
        ),
        ({"knots": MAPS}, [sampling()], "auto", r"tolerance = 0.001 for derivatives .* \(height\) needs 64 samples"),
    ],
)
def test_refusals(changes, found, method, reason):
    said = planner._refusal(problem_of(**changes), found, 5.0, method)
    assert re.match(reason, said), said


def test_unknown_methods_and_types_are_named():
    for change in ({"method": "best"}, {"dtype": "float16"}):
        settings = {"tolerance": 1e-3, "method": "auto", "dtype": "float32", **change}
        with pytest.raises(ValueError, match=f"{next(iter(change))} = "):
            Setup(2e-4, optics.PointSource(), Grid((5, 5), 1e-6), **settings)
    for method in ("auto", "exact", *METHODS):
        Setup(2e-4, optics.PointSource(), Grid((5, 5), 1e-6), 1e-3, method, "float64")


LENS = optics.Pupil(30e-6, optics.BSplineRelief(1e-7 * np.eye(4)))
SETUP = Setup(2e-4, optics.PointSource(), Grid((33, 33), 1e-6), 1e-3, "auto", "float32")


@pytest.mark.parametrize(("share", "reused"), [(1 / GROWN + 1e-6, True), (1 / GROWN - 1e-6, False), (10.0, True)])
def test_the_method_of_the_last_wavelength_is_compared_again_if_it_has_become_slower(share, reused):
    request = SETUP.request(LENS, 550e-9)
    assert request.most_seconds == MOST_SECONDS == 60
    plan, _ = planner.choose(request.problem, "angular_spectrum")
    fixed = cost.PSF_CALL + window_cost.window_seconds(request.problem)
    former = replace(plan, seconds=fixed + share * (plan.seconds - fixed))
    found = request.after(request, former)
    assert found.like is former
    again, _ = found.planned()
    if reused:
        assert again.method == "angular_spectrum"
        assert "same method as at the previous wavelength" in again.why
        assert "requested" not in again.why
    else:
        assert again == request.planned()[0]


@pytest.mark.parametrize(
    "other",
    [
        {"method": "exact"},
        {"keeps_field": True},
        {"beam": SETUP.request(optics.Pupil(29e-6), 550e-9).beam},
        {"beam": replace(SETUP.request(LENS, 550e-9).beam, distance=3e-4)},
        {"beam": replace(SETUP.request(LENS, 550e-9).beam, source=optics.PointSource(1.0))},
    ],
)
def test_plans_of_other_light_are_not_reused(other):
    request = SETUP.request(LENS, 550e-9)
    plan, _ = request.planned()
    assert request.after(replace(request, **other), plan).like is None
    assert request.after(request, replace(plan, method="fresnel")).like is None
    assert request.after(request, replace(plan, method="low_rank")).like is not None


def test_methods_with_a_field():
    request = Request(None, None, keeps_field=True)
    assert [replace(request, method=method)._methods for method in ("auto", "exact", "hankel")] == [
        "field",
        "field",
        "hankel",
    ]
    assert [replace(request, method=method, keeps_field=False)._methods for method in ("auto", "exact")] == [
        "auto",
        "exact",
    ]


def test_the_place_of_a_sensor():
    lens = optics.Pupil(30e-6, thin_lens_focal_length=240e-6)
    assert sensor_place(lens, 1e-4, math.inf) == 1e-4
    assert sensor_place(lens, None, math.inf) == pytest.approx(240e-6)
    assert sensor_place(lens, None, 480e-6) == pytest.approx(480e-6)
