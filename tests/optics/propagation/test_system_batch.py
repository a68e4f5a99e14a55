"""Batches of similar systems, and the cost of a step between planes."""

import numpy as np
import pytest

import optics
from optics import FreeSpace, Misaligned, Pupil, propagate_through, propagate_through_batch
from optics.propagation import plane_step, propagate, spectrum_filter, system
from validation.reference import relative_l2

WHERE = {"wavelength": 550e-9, "out_dx": 3e-6, "out_shape": (64, 64)}


def lenses(seed, tilt=0.0):
    """Return a lens of two elements with random errors of decentre, spacing and, unless it is 0, tilt."""
    rng, found = np.random.default_rng(seed), []
    for f, z in ((10e-3, 3e-3), (7e-3, 4e-3)):
        lens = Pupil(0.1e-3, thin_lens_focal_length=f)
        found += [Misaligned(lens, tuple(rng.normal(0, 5e-6, 2)), tuple(tilt * rng.normal(0, 1, 2)))]
        found += [FreeSpace(z + rng.normal(0, 20e-6))]
    return found


@pytest.fixture
def passes(monkeypatch):
    """The margin of each propagation through a whole system."""
    found, passed = [], system._passed

    def counted(stops, field, source, settings, tolerance):
        found.append(settings.margin)
        return passed(stops, field, source, settings, tolerance)

    monkeypatch.setattr(system, "_passed", counted)
    return found


def test_batches_begin_with_the_margin_that_the_last_system_needed(passes):
    systems = [lenses(seed) for seed in range(3)]
    together = propagate_through_batch(systems, **WHERE, tolerance=1e-2)
    sufficient = passes[-1]
    assert passes[-4:] == 2 * [sufficient / 2, sufficient]  # two margins are compared for each later system
    passes.clear()
    alone = [propagate_through(each, **WHERE, tolerance=1e-2) for each in systems]
    assert passes[-1] == sufficient
    for one, other in zip(together, alone, strict=True):
        assert relative_l2(np.abs(one.u) ** 2, np.abs(other.u) ** 2) < one.predicted_error + other.predicted_error
        assert one.predicted_error <= 1e-2
    assert relative_l2(np.abs(together[0].u) ** 2, np.abs(together[1].u) ** 2) > 1e-2  # the systems differ


def test_a_batch_at_a_tight_tolerance_equals_single_systems():
    systems = [lenses(0), lenses(1)]
    for one, each in zip(propagate_through_batch(systems, **WHERE, tolerance=1e-3), systems, strict=True):
        np.testing.assert_array_equal(one.u, propagate_through(each, **WHERE, tolerance=1e-3).u)


@pytest.mark.parametrize(
    ("systems", "message"),
    [
        ("lens", "systems = 'lens': must be a list of systems"),
        ([lenses(0), []], r"systems\[1\]: elements is empty"),
        ([lenses(0), 3], r"systems\[1\]: elements = 3: must be a list"),
        ([[FreeSpace(1e-3)]], r"systems\[0\]: u = None"),
    ],
)
def test_wrong_systems_are_named(systems, message):
    with pytest.raises(ValueError, match=message):
        propagate_through_batch(systems, **WHERE, tolerance=1e-2)


def test_no_system_is_an_empty_batch():
    assert propagate_through_batch([], **WHERE) == []


def test_periods_between_planes_are_whole_numbers_of_both_pitches(monkeypatch):
    """Otherwise sums would need matrices, which take several times as long as transforms."""
    found, filtered = [], propagate.filtered

    def recorded(given, how, *others):
        found.append(how)
        return filtered(given, how, *others)

    monkeypatch.setattr(propagate, "filtered", recorded)
    propagate_through([*lenses(0)[:2], *lenses(1, 0.01)], **WHERE, tolerance=3e-3)
    between = [how for how in found if how.window.shape != (64, 64)]
    assert (len(found), len(between)) == (3, 2)
    assert all(how.back_period.is_integer() and how.window.shape[0] > 100 for how in between)
    # The pitch is at most a few per cent smaller than necessary.
    monkeypatch.setattr(plane_step.StepSettings, "matched", lambda self, field, stop, grid: grid)
    propagate_through([*lenses(0)[:2], *lenses(1, 0.01)], **WHERE, tolerance=3e-3)
    for matched, plain in zip(between, found[3:5], strict=True):
        assert 0.9 * plain.window.dx < matched.window.dx <= plain.window.dx
        assert not plain.back_period.is_integer()


def test_a_step_between_tilted_planes_transforms_once_per_depth(monkeypatch):
    calls, depths, sums = [], [], spectrum_filter.fourier_sum
    monkeypatch.setattr(spectrum_filter, "fourier_sum", lambda *given: calls.append(given[-1]) or sums(*given))
    filtered = propagate.filtered

    def recorded(given, how, types, tilted):
        depths.append([len(end[0]) for end in (tilted.leaving, tilted.arriving)])
        return filtered(given, how, types, tilted)

    monkeypatch.setattr(propagate, "filtered", recorded)
    propagate_through(lenses(2, 0.01), **WHERE, tolerance=1e-3)
    assert max(map(max, depths)) > 1
    expected = [sign for leaving, arriving in depths for sign in leaving * [-1] + arriving * [1]]
    assert calls == expected


@pytest.mark.slow
def test_errors_of_tilted_systems_at_loose_tolerances_are_predicted():
    for seed in range(4):
        elements = lenses(seed, 0.004)
        tight, loose = (propagate_through(elements, **WHERE, tolerance=tolerance) for tolerance in (1e-3, 1e-2))
        error = relative_l2(np.abs(loose.u) ** 2, np.abs(tight.u) ** 2)
        assert 1e-5 < error < loose.predicted_error < 1e-2
        assert optics.StackResult is type(loose)
