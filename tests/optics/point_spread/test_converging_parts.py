"""Choices and errors of vector foci, from given fields."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from optics.elements.ray_field import SCALAR
from optics.methods.smythe import ALONG_X
from optics.numerics.accuracy import AccuracyError, Plan
from optics.numerics.grid import Grid
from optics.point_spread import converging
from optics.point_spread.converging import Converging, VectorFocus

RNG = np.random.default_rng(7)
WINDOW = Grid((3, 4), 0.5, (1.0, -2.0))
FIELDS = RNG.random((7, 3, 4)) + 1j * RNG.random((7, 3, 4))


def light(aplanatic=False, tolerance=1e-2, angle=(0.0, 0.0), jones=((1.0, 0.0),), distance=4.0):
    pupil = SimpleNamespace(radius=3.0, area=4.0, index_before=lambda wavelength: 1.2)
    beam = SimpleNamespace(
        pupil=pupil, source=SimpleNamespace(angle=angle), wavelength=0.5, index=1.5, distance=distance
    )
    return Converging(beam, aplanatic, np.array(jones), (1.0, 0.5, 0.0, 0.0), tolerance)


def test_images_obey_snells_law():
    x, y = light(angle=(0.4, -0.3)).image
    across = np.tan((0.4, -0.3))
    sine = math.sin(math.atan(math.hypot(*across))) * 1.2 / 1.5
    assert math.hypot(x, y) == pytest.approx(4 * math.tan(math.asin(sine)))
    assert x / y == pytest.approx(across[0] / across[1])
    assert light().image == (0, 0)


def test_images_of_totally_reflected_light():
    """The axial part of a direction is at least 0.001."""
    one = light(angle=(1.5, 0.0))
    one.beam.pupil.index_before = lambda wavelength: 2.0
    assert one.image[0] == pytest.approx(4 * 2 / 1.5 * math.sin(1.5) * 1000)


def test_cutoffs():
    """The sine of an aplanatic lens is R/z, and that of a flat pupil R/√(R² + z²)."""
    assert light().cutoff == pytest.approx(2 * 0.6 * 1.5 / 0.5)
    assert light(True).cutoff == pytest.approx(2 * 0.75 * 1.5 / 0.5)


@pytest.mark.parametrize("jones", [((0.6, 0.8j),), ((0.5, 0.0), (0.0, 0.25))])
@pytest.mark.parametrize("way", ["aplanatic", "plane waves", "exact"])
def test_fields_are_combined_by_jones_vectors(monkeypatch, jones, way):
    monkeypatch.setattr(Converging, "_aplanatic", lambda self, window: (FIELDS, "aplanatic"))
    monkeypatch.setattr(
        Converging, "_plane_waves", lambda self, window: (FIELDS, "plane waves") if way == "plane waves" else None
    )
    monkeypatch.setattr(Converging, "_exact", lambda self, window: (FIELDS, "exact"))
    checked = []
    monkeypatch.setattr(converging, "check_window", lambda *given, **named: checked.append((given, named)))
    one = light(way == "aplanatic", jones=jones)
    found = one.onto(WINDOW)
    assert checked == [((WINDOW, "float64"), {"arrays": 28})]
    parts = [a * FIELDS[:3] + b * FIELDS[3:6] for a, b in jones]
    np.testing.assert_allclose(found.parts, parts)
    np.testing.assert_allclose(found.intensity, sum(np.abs(part) ** 2 for part in parts))
    np.testing.assert_allclose(found.scalar, np.abs(FIELDS[6]) ** 2)
    assert (found.field is None) == (len(jones) == 2)
    if found.field is not None:
        np.testing.assert_allclose(found.field, parts[0])
    assert (found.dx, found.centre, found.polarization, found.plan) == (0.5, (1.0, -2.0), (1.0, 0.5, 0.0, 0.0), way)
    assert found.towards is one


def summing(monkeypatch, nodes):
    rules = []

    def rule(*given):
        rules.append(given)
        return SimpleNamespace(nodes=nodes, components=lambda: FIELDS)

    monkeypatch.setattr(converging, "VectorSum", rule)
    return rules


def test_sums_behind_aplanatic_lenses(monkeypatch):
    one = light(True, 1e-8)
    rules = summing(monkeypatch, 400_000)
    found, plan = one._aplanatic(WINDOW)
    assert found is FIELDS
    assert rules == [(one.beam, WINDOW, True)]
    assert (plan.method, plan.samples, plan.dtype, plan.predicted_error) == (
        "plane_waves",
        (400_000, 1),
        "float64",
        1e-8,
    )
    with pytest.raises(AccuracyError, match=r"^tolerance = 9e-09: must be at least 1e-08 for an aplanatic lens$"):
        light(True, 9e-9)._aplanatic(WINDOW)
    summing(monkeypatch, 400_001)
    with pytest.raises(AccuracyError, match=r"^the window reaches 1.* m from the image: must be smaller"):
        one._aplanatic(WINDOW)


@pytest.mark.parametrize(
    ("nodes", "error", "crossed", "distance", "used"),
    [
        (400_000, 4e-3, 6e-3, 4.0, True),
        (400_001, 4e-3, 6e-3, 4.0, False),
        (9, 4e-3, 6.1e-3, 4.0, False),
        (9, None, 0.0, 4.0, False),
        (9, 4e-3, 0.0, 1.0, False),  # the window is wider than the distance
        (9, 4e-3, 0.0, WINDOW.own_half_diagonal, True),
    ],
)
def test_plane_waves_are_used_if_a_check_confirms_them(monkeypatch, nodes, error, crossed, distance, used):
    one, asked = light(distance=distance), []
    summing(monkeypatch, nodes)

    def errors(self, problem, fields):
        asked.append(problem)
        assert list(fields) == [SCALAR, ALONG_X]
        np.testing.assert_array_equal(fields[SCALAR], FIELDS[6])
        np.testing.assert_array_equal(fields[ALONG_X], FIELDS[0])
        return error

    monkeypatch.setattr(Converging, "_behind", lambda self, weights: ("behind", weights))
    monkeypatch.setattr(Converging, "_errors", errors)
    monkeypatch.setattr(Converging, "_crossed", lambda self, scalar, window: crossed if scalar is not None else None)
    monkeypatch.setattr(converging, "Problem", SimpleNamespace(from_beam=lambda *given: given))
    found = one._plane_waves(WINDOW)
    if asked:
        assert asked == [(("behind", SCALAR), WINDOW, 1e-2, "float64")]
    if not used:
        assert found is None
        return
    fields, plan = found
    assert fields is FIELDS
    assert (plan.method, plan.samples, plan.predicted_error) == (
        "plane_waves",
        (nodes, 1),
        pytest.approx(error + crossed),
    )


def test_light_that_crosses_planes_of_polarisation():
    """The bend of the phase is π n s²/(λ z) times the squared distance from the image, weighted with the light."""
    one, bright = light(angle=(0.4, -0.3)), np.abs(FIELDS[6]) ** 2
    x, y = one.image
    squared = (3 + math.hypot(x, y)) ** 2
    squared /= squared + 16
    off = (WINDOW.x - x) ** 2 + (WINDOW.y[:, None] - y) ** 2
    mean = math.sqrt((bright * off**2).sum() / bright.sum())
    expected = math.pi * 1.5 / 0.5 * squared / 4 * mean * squared / 2
    assert one._crossed(FIELDS[6], WINDOW) == pytest.approx(expected)


@pytest.mark.parametrize(("errors", "tries"), [((1e-2,), 1), ((1.01e-2, 0.9e-2), 2), ((2e-2, 1.01e-2), 0)])
def test_smaller_tolerances_are_tried_once(monkeypatch, errors, tries):
    """The second tolerance is a quarter of the first."""
    asked = []

    def smythe(self, window, tolerance):
        asked.append(tolerance)
        return FIELDS, Plan("fft", (1, 1), "float32", errors[len(asked) - 1], "")

    monkeypatch.setattr(Converging, "_smythe", smythe)
    if tries:
        assert light()._exact(WINDOW)[1].predicted_error == errors[-1]
        assert asked == [1e-2, 2.5e-3][:tries]
        return
    with pytest.raises(AccuracyError, match=r"^tolerance = 0\.01: a check finds an error of 0\.0101.* in Ex"):
        light()._exact(WINDOW)


@pytest.mark.parametrize(("tolerance", "dtype"), [(1e-4, "float32"), (0.99e-4, "float64")])
@pytest.mark.parametrize(("checked", "error"), [(5e-3, 5e-3), (None, 1e-3), (1e-4, 1e-3)])
def test_fields_of_smythes_integral(monkeypatch, tolerance, dtype, checked, error):
    """Each part is divided by the square root of the area. The plan takes seven times as long as a scalar field."""
    plan = Plan("fft", (8, 8), dtype, 1e-3, "the method", 2.0, scalar_error=0.5)

    def field(beam, problem):
        assert (beam, problem) == ("beam", "problem")
        return SimpleNamespace(numpy=lambda: 6 * FIELDS[0])

    def smythe(beam, window, propagated):
        np.testing.assert_allclose(propagated("beam"), 3 * FIELDS[0])
        return FIELDS[:6]

    def scalar(self, window, own, within):
        assert (own, within) == (dtype, tolerance)
        sampled = SimpleNamespace(numpy=lambda: FIELDS[6])
        return SimpleNamespace(sampling=SimpleNamespace(field=field), problem="problem", plan=plan, field=sampled)

    def errors(self, problem, fields):
        assert (problem, list(fields)) == ("problem", [ALONG_X])
        return checked

    monkeypatch.setattr(converging, "smythe", smythe)
    monkeypatch.setattr(Converging, "_scalar", scalar)
    monkeypatch.setattr(Converging, "_errors", errors)
    found, made = light()._smythe(WINDOW, tolerance)
    np.testing.assert_array_equal(found, FIELDS)
    assert (made.predicted_error, made.seconds, made.scalar_error) == (error, 14.0, 0.0)
    assert made.why == "Smythe's integral; the method"


@pytest.mark.parametrize("failing", [(), ("float32",), ("float32", "float64")])
def test_scalar_fields_in_double_precision_where_single_is_too_coarse(monkeypatch, failing):
    asked = []

    def pictures(requests):
        [request] = requests
        asked.append(request.problem)
        assert (request.beam, request.keeps_field) == ("behind", True)
        assert request.most_seconds == pytest.approx(60 / 7)
        if request.problem[-1] in failing:
            raise AccuracyError("too coarse")
        return ["picture"]

    monkeypatch.setattr(converging, "pictures", pictures)
    monkeypatch.setattr(Converging, "_behind", lambda self, weights: "behind" if weights is SCALAR else None)
    monkeypatch.setattr(converging, "Problem", SimpleNamespace(from_beam=lambda *given: given))
    if len(failing) == 2:
        with pytest.raises(AccuracyError, match=r"^too coarse$"):
            light()._scalar(WINDOW, "float32", 1e-3)
    else:
        assert light()._scalar(WINDOW, "float32", 1e-3) == "picture"
    types = ["float32", "float64"][: max(1, len(failing) + (len(failing) == 1))]
    assert asked == [("behind", WINDOW, 1e-3, dtype) for dtype in types]


@pytest.mark.parametrize(("given", "expected"), [((1e-3, 2e-3), 2e-3), ((2e-3, 1e-3), 2e-3), ((None, 1.0), None)])
def test_the_largest_error_of_a_check(monkeypatch, given, expected):
    asked, known = [], iter(given)

    def check(beam, problem, image, seconds):
        asked.append((beam, problem, seconds))
        np.testing.assert_allclose(image, np.abs(FIELDS[len(asked) - 1].ravel()) ** 2)
        return next(known)

    monkeypatch.setattr(converging, "spot_check", check)
    monkeypatch.setattr(Converging, "_behind", lambda self, weights: f"behind {weights}")
    found = light()._errors("problem", {"one": FIELDS[0], "other": FIELDS[1]})
    assert found == expected
    assert asked == [("behind one", "problem", 0.5), ("behind other", "problem", 0.5)]


def test_what_a_focus_reports():
    intensity, scalar = RNG.random((3, 3, 4)), RNG.random((3, 4))
    plan = Plan("fft", (8, 8), "float64", 2e-3, "")
    one = VectorFocus(intensity, scalar, 0.5, None, np.zeros((2, 3, 3, 4)), (1.0, -2.0), (1, 0, 0, 0), plan)
    total = intensity.sum(axis=0)
    np.testing.assert_allclose(one.psf, total)
    assert one.grid == WINDOW
    error = np.linalg.norm(scalar - total) / np.linalg.norm(total)
    assert one.scalar_error == pytest.approx(error)
    assert repr(one) == f"<VectorFocus 3 x 4 samples 0.5 m apart, predicted error 2.0e-03, scalar error {error:.1e}>"
    assert one.towards is None
