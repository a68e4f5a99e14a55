"""Parts of the spot check, from given numbers."""

from types import SimpleNamespace

import numpy as np
import pytest

from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.point_spread import spot_check as module
from optics.point_spread.spot_check import _DirectSum, spot_check

RNG = np.random.default_rng(4)
IMAGE = np.full(4, 10.0)


def checked(monkeypatch, exact, points=9, dtype="float64", image=IMAGE, **problem):
    """Return the estimated error of an image, of which all points are compared, and the arguments of its parts."""
    asked = {}

    def darkness(beam, problem, mean):
        asked["mean"] = mean
        return 0.5

    def affordable(beam, problem, darkness, seconds):
        asked.update(problem=problem, darkness=darkness, seconds=seconds)
        return SimpleNamespace(points=points)

    def own(problem, reference, darkness):
        assert (reference.points, darkness) == (points, 0.5)
        return 1e-3

    given = SimpleNamespace(
        **({"reach": None, "knots": None, "dtype": dtype, "window": "window", "tolerance": 1e-2} | problem)
    )
    monkeypatch.setattr(module, "_darkness", darkness)
    monkeypatch.setattr(module, "_affordable", affordable)
    monkeypatch.setattr(module, "_own_error", own)
    monkeypatch.setattr(
        module, "_drawn", lambda problem, image, count: (np.arange(len(image)), np.full(len(image), 1 / len(image)))
    )
    monkeypatch.setattr(module, "_exact", lambda beam, problem, reference, drawn: np.asarray(exact, float)[drawn])
    return spot_check("beam", given, image, 7.0), asked


def test_the_estimate_is_relative_to_the_image(monkeypatch):
    found, asked = checked(monkeypatch, [10.5, 9.5, 10.5, 9.5])
    assert found == pytest.approx(3.5 * 0.05 + 3e-13 + 1e-3, rel=1e-12)
    assert (asked["mean"], asked["darkness"], asked["seconds"]) == (10.0, 0.5, 7.0)
    single, _ = checked(monkeypatch, [10.0] * 4, dtype="float32")
    assert single == pytest.approx(np.finfo(np.float32).eps + 1e-3, rel=1e-9)
    assert checked(monkeypatch, [10.0] * 4)[0] == pytest.approx(3e-13 + 1e-3, rel=1e-15)


def test_large_errors_are_relative_to_the_exact_psf(monkeypatch):
    """Beyond a tenth, if the exact PSF is darker than the image."""
    assert checked(monkeypatch, [9.0] * 4)[0] == pytest.approx(3.5 * 0.1 + 1e-3)
    assert checked(monkeypatch, [8.0] * 4)[0] == pytest.approx(3.5 * 2 / 8 + 1e-3)
    assert checked(monkeypatch, [12.0] * 4)[0] == pytest.approx(3.5 * 2 / 10 + 1e-3)


def test_checks_that_are_impossible(monkeypatch):
    assert checked(monkeypatch, [10.0] * 4, points=3)[0] is None
    assert checked(monkeypatch, [10.0] * 4, points=4)[0] is not None
    many = np.full(20, 10.0)
    assert checked(monkeypatch, many, points=7, image=many)[0] is None
    assert checked(monkeypatch, many, points=8, image=many)[0] is not None
    assert checked(monkeypatch, [10.0] * 4, reach=1e-5)[0] is None
    assert checked(monkeypatch, [0.0] * 4, image=np.zeros(4))[0] is None


def test_problems_with_derivatives_are_checked_without_them(monkeypatch):
    def from_beam(beam, *given, derivatives):
        assert (beam, given, derivatives) == ("beam", ("window", 1e-2, "float64"), False)
        return SimpleNamespace(dtype="float64", plain=True)

    monkeypatch.setattr(module, "Problem", SimpleNamespace(from_beam=from_beam))
    _, asked = checked(monkeypatch, [10.0] * 4, knots=5)
    assert asked["problem"].plain
    _, asked = checked(monkeypatch, [10.0] * 4)
    assert not hasattr(asked["problem"], "plain")


def test_errors_of_the_reference():
    """The amplitude's error is 10^-digits of the amplitude in phase, and the intensity's relative error twice that."""
    problem = SimpleNamespace(waves=1e4, wavelength=5e-7, distance=2e-3)
    assert module.path_rounding(problem, 3.0) == pytest.approx(1.1e-9)
    assert module._own_error(problem, _DirectSum(9, 1.0, 7.0), 3.0) == pytest.approx(2e-4 + 1.1e-9, rel=1e-9)
    beam = SimpleNamespace(pupil=SimpleNamespace(area=1e-8))
    in_phase = 1e-8 / (5e-7 * 2e-3) ** 2
    assert module._darkness(beam, problem, in_phase / 1e4) == pytest.approx(2.0)
    assert module._darkness(beam, problem, 2 * in_phase) == 0


def test_finer_detail_than_the_psf_resolves():
    asked = []
    pupil = SimpleNamespace(bandwidth=lambda *given: asked.append(given) or 5e4)
    beam = SimpleNamespace(pupil=pupil, wavelength=5e-7)
    problem = SimpleNamespace(radius=1e-3, detail=2e4, tolerance=1e-2)
    assert module._finer_detail(beam, problem) == pytest.approx(30)
    assert asked == [(5e-7, pytest.approx(1e-5))]
    problem.detail = 6e4
    assert module._finer_detail(beam, problem) == 0


def affordable(
    monkeypatch, nodes, pairs, samples=60, symmetric=False, tolerance=1e-2, darkness=0.1, seconds=1.0, detail=3.0
):
    """Return the direct sum and the cycles and digits that were tried, with given numbers of nodes."""
    asked = []

    def count(aperture, cycles, digits):
        asked.append((cycles, digits))
        return nodes[len(asked) - 1]

    monkeypatch.setattr(module, "_finer_detail", lambda beam, problem: detail)
    monkeypatch.setattr(module, "turns", lambda problem, digits: digits)
    monkeypatch.setattr(module, "stepped_up", lambda cycles: 10 * cycles)
    monkeypatch.setattr(module, "node_count", count)
    monkeypatch.setitem(module.PAIRS_PER_SECOND, "float32", pairs)
    window = SimpleNamespace(shape=(samples // 6, 6), centre=(1.0, 0.0))
    problem = SimpleNamespace(window=window, symmetric=symmetric, tolerance=tolerance, aperture=None)
    return module._affordable(None, problem, darkness, seconds), asked


def test_the_first_affordable_accuracy_is_used(monkeypatch):
    """7 or 4 spare digits, each with or without the finer detail; 40 points are wanted. Wished digits of 9.1 and 6.1
    are rounded up to multiples of 0.25.
    """
    tried = [(122.5, 9.25), (92.5, 9.25), (92.5, 6.25), (62.5, 6.25)]
    for number in range(4):
        nodes = [8.0] * number + [7.5] + [1.0] * 3
        found, asked = affordable(monkeypatch, nodes, 1000.0)
        assert asked == tried[: number + 1]
        assert found == _DirectSum(40, *tried[number])
    found, asked = affordable(monkeypatch, [8.0, 9.0, 10.0, 12.5], 1000.0)
    assert found == _DirectSum(24, *tried[3])
    assert asked == tried
    assert affordable(monkeypatch, [1.0, 1.0], 1e6, detail=0.0)[1] == [(92.5, 9.25)]
    assert len(affordable(monkeypatch, [1e9] * 4, 1e3, detail=0.0)[1]) == 2


@pytest.mark.parametrize(
    ("samples", "seconds", "symmetric", "points"),
    [
        (54, 1.0, False, 30),  # 0.3 of the time of the PSF
        (48, 0.25, False, 25),  # all of the time, because there are fewer than 54 samples
        (54, 0.25, False, 7),
        (54, 1e-6, False, 0),  # at least 3 ms
        (54, 0.25, True, 15),
    ],
)
def test_the_time_of_a_check(monkeypatch, samples, seconds, symmetric, points):
    found, _ = affordable(monkeypatch, [10.0] * 4, 1000.0, samples, symmetric, seconds=seconds)
    assert found.points == points
    if points == 0:
        assert affordable(monkeypatch, [1.0] * 4, 1000.0, samples, seconds=seconds)[0].points == 3


def test_the_largest_number_of_digits(monkeypatch):
    found, _ = affordable(monkeypatch, [1.0] * 4, 1e6, tolerance=1e-9, darkness=4.0)
    assert found.digits == module.MOST_DIGITS < 20


def test_points_are_drawn_at_even_steps_of_the_chances(monkeypatch):
    chances = np.array([0.05, 0.3, 0.05, 0.2, 0.1, 0.3])
    monkeypatch.setattr(module, "_chances", lambda image, window: chances)
    problem = SimpleNamespace(window=Grid((2, 3), 1.0, (0.0, 0.0)), symmetric=False)
    drawn, chance = module._drawn(problem, np.ones(6), 4)
    assert drawn.tolist() == [1, 2, 4, 5]  # levels of 1/8, 3/8, 5/8 and 7/8
    np.testing.assert_array_equal(chance, chances[drawn])
    every, even = module._drawn(problem, np.ones(6), 6)
    assert every.tolist() == list(range(6))
    np.testing.assert_allclose(even, 1 / 6)
    # From the axis outwards, the order is 4, 1, 3, 5, 0, 2.
    radial = SimpleNamespace(window=problem.window, symmetric=True)
    drawn, chance = module._drawn(radial, np.ones(6), 4)
    assert drawn.tolist() == [1, 1, 5, 5]
    np.testing.assert_array_equal(chance, chances[drawn])
    monkeypatch.setattr(module, "_chances", lambda image, window: 0.7 * chances)
    assert module._drawn(problem, np.ones(6), 2)[0].tolist() == [2, 5]


def test_order_by_the_distance_from_the_axis():
    window = Grid((3, 4), 0.1, (0.1, -0.2))
    squared = np.add.outer(np.round(window.y / 0.1) ** 2, np.round(window.x / 0.1) ** 2).ravel()
    found = module._by_radius(window)
    assert sorted(found) == list(range(12))
    assert (np.diff(squared[found]) >= 0).all()
    same = np.diff(squared[found]) == 0
    assert (np.diff(found)[same] > 0).all(), "equal radii keep their order"
    np.testing.assert_array_equal(module._in_order(window), found)


@pytest.mark.parametrize("symmetric", [True, False])
def test_exact_points(monkeypatch, symmetric):
    """Points are read row by row. A symmetric PSF is computed on the positive x axis, with half of the nodes."""
    asked = {}

    def direct_sum(beam, rule, x, y, types):
        asked.update(rule=rule, x=x.numpy(), y=y.numpy())
        return SimpleNamespace(intensity=types.Float64(4.0) * x)

    monkeypatch.setattr(module, "direct_sum", direct_sum)
    window = Grid((3, 4), 0.5, (10.0, 20.0))
    problem = SimpleNamespace(window=window, symmetric=symmetric, aperture="aperture")
    beam = SimpleNamespace(pupil=SimpleNamespace(area=2.0))
    drawn = np.array([0, 5, 11])
    found = module._exact(beam, problem, _DirectSum(3, 2.5, 6.0), drawn)
    x, y = np.array([9.0, 9.5, 10.5]), np.array([19.5, 20.0, 20.5])
    if symmetric:
        x, y = np.hypot(x, y), 0 * y
    np.testing.assert_allclose(asked["x"], x)
    np.testing.assert_allclose(asked["y"], y)
    np.testing.assert_allclose(found, 2 * x)
    assert asked["rule"] == ("aperture", 2.5, 6.0, symmetric)
    assert precision("float64").Float64(found).numpy().dtype == np.float64


@pytest.mark.parametrize("shape", [(3, 5), (1, 6), (4, 1)])
def test_nearness_to_sides_and_corners(shape):
    """Half of the sides' weight is for the outermost samples alone. Both pairs of sides have equal weight."""
    height, width = shape
    y, x = (np.linspace(-1, 1, n) if n > 1 else np.ones(1) for n in shape)
    sides, corners = np.zeros(shape), np.zeros(shape)
    for i, j in np.ndindex(*shape):
        for fall in (lambda u: u**24, lambda u: float(abs(u) == 1)):
            sides[i, j] += fall(x[j]) / sum(map(fall, x)) / height + fall(y[i]) / sum(map(fall, y)) / width
        corners[i, j] = ((y[i] ** 2 + x[j] ** 2) / 2) ** 12
    expected = (sides / 4 + corners / corners.sum()).ravel()
    rim, fixed = module._fixed_chances(shape, (0.0, 0.0))
    np.testing.assert_allclose(rim, expected)
    np.testing.assert_allclose(fixed, expected + 1 / expected.size)
    assert rim.sum() == pytest.approx(2)


def test_chances_of_dark_windows():
    """Without light at the rim, the fixed chances count a third more."""
    window = Grid((3, 3), 1.0, (2.0, 3.0))
    bright = np.zeros(9)
    bright[4] = 2.0
    rim, fixed = module._fixed_chances((3, 3), (2.0, 3.0))
    assert rim[4] == 0
    found = module._chances(bright, window)
    np.testing.assert_allclose(found, (4 / 3 * fixed + bright / 2 + 1 / 9) / 6)
    assert found.sum() == pytest.approx(1)


@pytest.mark.parametrize("large", [False, True])
def test_arrays_of_large_windows_are_cached_once(monkeypatch, large):
    assert module.LARGE == 2**18
    monkeypatch.setattr(module, "LARGE", 11 if large else 12)
    window = Grid((3, 4), 1.0, (0.0, 0.0))
    for name in ("chances", "order"):
        for size in ("small", "large"):
            cached = getattr(module, f"_{size}_{name}")
            assert cached.cache_parameters()["maxsize"] == (1 if size == "large" else 16)
            used = (size == "large") == large
            answer = (np.ones(12), np.ones(12)) if name == "chances" else "order"
            monkeypatch.setattr(module, f"_{size}_{name}", (lambda *_, of=answer: of) if used else None)
    assert module._in_order(window) == "order"
    assert module._chances(np.ones(12), window).shape == (12,)
