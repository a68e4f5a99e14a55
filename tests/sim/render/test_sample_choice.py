"""The choice of samples: rays, areas, or areas that receptors share."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest

import optics
import sim
from sim.eyes.sampling import BoxSampling
from sim.render import eye_renderer
from sim.render.fidelity import Level
from sim.render.fidelity_choice import Allowed
from sim.render.fidelity_stages import CAUTION
from sim.render.populations import everywhere
from sim.render.populations import near_objects as near_population
from sim.render.random_views import on_objects
from sim.render.sample_choice import (
    HARDLY_MORE,
    NUMBERS_OF_AREAS,
    PERFECT_LENS_AREA,
    PERFECT_LENS_RAYS,
    _fewest,
    fewest_samples,
)
from sim.render.world_scene import WorldScene
from sim.tracing.areas import sphere_areas
from tests.sim.render.test_fidelity import DETECTION, behind_lens, near_objects, signals
from tests.sim.tracing.area_views import ROW


@pytest.mark.parametrize(
    ("task", "eyes"),
    [
        ("detection", sim.Eyes()),
        ("maze", ROW),
        ("navigation", ROW),
        ("detection", behind_lens(DETECTION, 0.6)),
        ("maze", behind_lens(ROW, 0.6)),
    ],
)
def test_eyes_see_by_areas_where_rays_would_be_many(task, eyes, recwarn):
    """The error with areas, over all receptors and over receptors that see a near object, is within the prediction. It
    is measured in bounced light, for which many rays are the reference.
    """
    world = sim.build_world(task)
    fidelity = sim.choose_fidelity(world, eyes, bands="own")
    assert (fidelity.samples, fidelity.light) == ("areas", "all")
    assert fidelity.predicted_error <= fidelity.tolerance == 0.005
    assert not recwarn
    state, seen = near_objects(world, eyes)
    by_areas = signals(world, eyes, state, replace(fidelity, light="bounce"), fidelity.rays_per_receptor)
    rays = sim.Fidelity(1, eyes.bands, light="bounce")
    finely = 256 if eyes.optics else 1024
    truth = signals(world, eyes, state, rays, finely if world.objects else 8 * finely)
    for error in (by_areas - truth, (by_areas - truth)[seen]):
        assert np.sqrt(np.mean(error**2)) < eyes.noise_sigma / 2 if error.size else not world.objects


def test_one_wide_area_does_where_it_cuts_spheres_finely_enough(monkeypatch):
    """The error would be larger with the nine slices of narrow areas."""
    world, eyes = (
        sim.build_world("detection"),
        sim.Eyes(n_eyes=4, resolution=(12, 12), fov_deg=45, placement_range_deg=120),
    )
    wide = sim.choose_fidelity(world, eyes)
    assert wide.rays_per_receptor == 1
    monkeypatch.setattr(sphere_areas, "SIDES_OF_WIDE", sphere_areas.SIDES)
    assert sim.choose_fidelity(world, eyes).predicted_error > 1.1 * wide.predicted_error


def test_rays_are_kept_where_few_will_do():
    """A ray costs less than an area."""
    fidelity = sim.choose_fidelity(sim.build_world("detection"), replace(DETECTION, noise_sigma=0.2), bands="own")
    assert fidelity.samples == "rays"
    assert fidelity.rays_per_receptor <= PERFECT_LENS_AREA


def test_behind_a_pupil_an_area_costs_less_than_three_rays():
    """Three rays would be accurate enough here, but are slower: they reach 0.74 of an area's speed."""
    eyes = behind_lens(sim.Eyes(n_eyes=2, resolution=(15, 15), noise_sigma=0.01), 0.25)
    fidelity = sim.choose_fidelity(sim.build_world("detection"), eyes, bands="own")
    assert (fidelity.samples, fidelity.light, fidelity.rays_per_receptor) == ("areas", "direct", 1)


@pytest.mark.parametrize(("a", "most"), [(0.9, 1 / 4), (0.3, 4 / 9)])
def test_receptors_share_areas_behind_a_hole(a, most):
    """The pinhole's blur is wider than a receptor. The error is within the prediction, over all receptors and over
    receptors that see a near object, and the renderer reports its number of areas.
    """
    eyes = sim.Eyes(n_eyes=2, resolution=(15, 15), noise_sigma=0.003, placement_range_deg=45.0)
    eyes = replace(eyes, optics=optics.Pupil(a * eyes.sensor_width / 2))
    world = sim.build_world("detection")
    fidelity = sim.choose_fidelity(world, eyes, bands="own")
    assert (fidelity.samples, fidelity.light) == ("areas", "all")
    assert fidelity.rays_per_receptor <= most
    assert fidelity.predicted_error <= fidelity.tolerance
    state, seen = near_objects(world, eyes)
    bounced = replace(fidelity, light="bounce")
    assert sim.BatchedRenderer(world, eyes, 1, bounced).fidelity.rays_per_receptor == fidelity.rays_per_receptor
    by_areas = signals(world, eyes, state, bounced, fidelity.rays_per_receptor)
    truth = signals(world, eyes, state, sim.Fidelity(1, eyes.bands, light="bounce"), 128)
    for error in (by_areas - truth, (by_areas - truth)[seen]):
        assert np.sqrt(np.mean(error**2)) < fidelity.tolerance


@pytest.mark.parametrize(("resolution", "a", "sigma"), [((15, 15), 0.4, 0.003), ((1, 4), 0.25, 0.01)])
def test_receptors_behind_a_lens_in_focus_keep_their_own(resolution, a, sigma):
    """One area per receptor is enough for the first eye; the error of fewer areas does not predict that of more. If
    four receptors shared two areas, they would have the same signals in pairs.
    """
    eyes = sim.Eyes(n_eyes=2, resolution=resolution, noise_sigma=sigma, placement_range_deg=45.0)
    fidelity = sim.choose_fidelity(sim.build_world("detection"), behind_lens(eyes, a), bands="own")
    assert fidelity.rays_per_receptor >= 1
    assert fidelity.samples == "rays" or fidelity.rays_per_receptor == 1


def test_memory_is_reckoned_with_the_areas_around_the_receptors(monkeypatch):
    """A wide pinhole needs several areas per receptor."""
    asked = []
    monkeypatch.setattr(eye_renderer, "check_memory", lambda demand: asked.append(demand.rays_per_receptor))
    world, eyes = sim.build_world("detection"), sim.Eyes(n_eyes=1, resolution=(5, 5), bands=3)
    eyes = replace(eyes, optics=optics.Pupil(0.8 * eyes.sensor_width / 2))
    renderer = sim.BatchedRenderer(world, eyes, 1, sim.Fidelity(1, 3, samples="areas")).resized(2)
    per_receptor = len(renderer.sensor.directions) / 25
    assert asked == [1, per_receptor, per_receptor]
    assert per_receptor > 2


def test_a_tolerance_reaches_the_areas_around_the_receptors():
    world, eyes = sim.build_world("detection"), sim.Eyes(n_eyes=1, resolution=(9, 9), bands=3)
    eyes = replace(eyes, optics=optics.Pupil(0.6 * eyes.sensor_width / 2))

    def areas(tolerance):
        fidelity = sim.Fidelity(1, 3, tolerance=tolerance, samples="areas")
        return len(sim.BatchedRenderer(world, eyes, 1, fidelity).sensor.directions)

    assert areas(1e-5) > areas(None) == areas(0.005) > 81


def test_what_cannot_be_lessened_costs_no_more_than_it_must():
    """The smallest number of areas with almost the same error is chosen if the error reaches a floor. The largest
    number is chosen if the error keeps falling.
    """
    floor, falls = {1: 0.6, 2: 0.54, 4: 0.52, 6: 0.505, 9: 0.5}, {1: 0.9, 2: 0.8, 4: 0.7, 6: 0.6, 9: 0.5}
    for errors, number in ((floor, 2), (falls, 9)):
        found, level, enough = _fewest(lambda n, errors=errors: errors[n], tuple(errors), 0.49, "areas")
        assert (found, enough) == (number, False)
        assert level.predicted_error == CAUTION * errors[number]
    assert _fewest(lambda n: falls[n], tuple(falls), 0.85 * CAUTION, "areas")[::2] == (2, True)


class FormulaTrials:
    """Trials whose errors are formulas of the number n of samples: rays / n, and for areas a floor plus areas / n."""

    def __init__(self, rays, areas, floor):
        self._rays, self._areas, self._floor = rays, areas, floor

    def errors(self, sampling, light):
        return lambda n: self._rays / n

    def area_errors(self, sampling, light):
        return lambda n: self._floor + self._areas / n

    def may_share(self, sampling, number):
        return False

    def areas_of_field(self, sampling, number):
        return number

    def have_areas(self, *lights):
        return True

    def reflected_more_often(self, sampling):
        return 0.001


def chosen(trials, eye, left_out, tolerance=0.005):
    """Return the samples that are chosen if rays leave out light with this error."""
    spent = 0.35**2
    allowed = Allowed(
        tolerance * math.sqrt(1 - spent - min(left_out / tolerance, 0.5) ** 2), tolerance * math.sqrt(1 - spent)
    )
    return fewest_samples(trials, BoxSampling(eye), Level("light", "bounce", left_out, ""), allowed), allowed


def test_light_that_rays_leave_out_counts():
    """One detection eye of 64 x 64 over 45° had these errors. Areas exceed the tolerance by a fifth. Rays meet it by
    themselves, but not with the light that they leave out, and they would be 75 times slower."""
    samples, _ = chosen(FormulaTrials(0.38, 0.0, 0.006 / CAUTION), sim.Eyes().eye(), 0.031)
    assert (samples.kind, samples.number) == ("areas", 1)
    few_reflections, _ = chosen(FormulaTrials(0.38, 0.0, 0.006 / CAUTION), sim.Eyes().eye(), 0.0)
    assert few_reflections.kind == "rays"  # they meet the tolerance, and areas do not


def test_nothing_slower_and_less_accurate_is_chosen():
    """No other number of rays or areas has a lower cost and a lower error, up to the share that counts as close. Where
    any number meets the tolerance, the chosen one does.
    """
    rng, eye = np.random.default_rng(0), sim.Eyes().eye()
    for rays, areas, floor, left_out in np.exp(rng.uniform(np.log(1e-4), np.log(1), (400, 4))) * (1, 0.1, 0.05, 0.05):
        samples, allowed = chosen(FormulaTrials(rays, areas, floor), eye, left_out)
        others = [(n, math.hypot(CAUTION * rays / n, left_out)) for n in PERFECT_LENS_RAYS]
        others += [(PERFECT_LENS_AREA * n, CAUTION * (floor + areas / n)) for n in NUMBERS_OF_AREAS]
        cost = samples.number * (PERFECT_LENS_AREA if samples.kind == "areas" else 1)
        assert not any(c < cost and HARDLY_MORE * e < samples.error for c, e in others if e > allowed.error)
        met = any(e <= allowed.error for _, e in others)
        assert samples.enough >= met
        assert samples.error <= (allowed.without_light if met else math.inf)


def cost_of(fidelity):
    return fidelity.rays_per_receptor * (PERFECT_LENS_AREA if fidelity.samples == "areas" else 1)


def error_of(fidelity):
    """Return the predicted error, without the bound for the eyes' own bands."""
    return math.hypot(*(level.predicted_error or 0 for level in fidelity.levels[1:]))


@pytest.mark.parametrize(
    ("task", "resolution", "fov", "n_eyes"),
    [("detection", 64, 45, 1), ("detection", 16, 150, 1), ("maze", 11, 70, 1), ("maze", (1, 8), 110, 3)],
)
def test_eyes_that_fell_back_to_rays(task, resolution, fov, n_eyes):
    """The automatic choice gave these eyes 96 to 256 rays with one bounce."""
    resolution = (resolution, resolution) if isinstance(resolution, int) else resolution
    eyes = sim.Eyes(n_eyes=n_eyes, resolution=resolution, fov_deg=fov)
    fidelity = sim.choose_fidelity(sim.build_world(task), eyes, bands="own")
    assert (fidelity.samples, fidelity.light) == ("areas", "all")
    assert fidelity.rays_per_receptor <= 4
    assert error_of(fidelity) <= fidelity.tolerance


@pytest.mark.parametrize("seed", range(4))
def test_neighbouring_settings_cost_about_the_same(seed):
    """Tasks, resolutions, fields of view and numbers of eyes are drawn at random.

    The predicted error is within the tolerance. One more receptor, or a field that is 5 % wider, changes the cost per
    receptor by at most a factor of three.
    """
    rng = np.random.default_rng(seed)
    task = ("detection", "maze", "navigation", "tracking")[seed % 4]
    across, fov, n_eyes = int(np.exp(rng.uniform(np.log(4), np.log(90)))), rng.uniform(10, 140), int(rng.integers(1, 5))
    row = task in ("maze", "navigation") and rng.random() < 0.6
    across = min(across, 30) if row else across
    world, costs = sim.build_world(task), []
    for more, wider in ((0, 1), (1, 1), (0, 1.05)):
        rows = 1 if row else across + more
        eyes = sim.Eyes(n_eyes=n_eyes, resolution=(rows, across + more), fov_deg=fov * wider)
        with warnings.catch_warnings():
            warnings.simplefilter("error", sim.FidelityWarning)
            fidelity = sim.choose_fidelity(world, eyes, bands="own")
        assert error_of(fidelity) <= fidelity.tolerance
        costs.append(cost_of(fidelity))
    assert max(costs) <= 3 * min(costs)


@pytest.mark.parametrize(("resolution", "fov"), [((48, 48), 90), ((16, 16), 150)])
def test_trials_near_objects_use_receptors_that_see_them(resolution, fov):
    """Five times as many pairs of views and receptors count in wide eyes as with receptors drawn evenly. All draws are
    the same every time.
    """
    scene = WorldScene(sim.build_world("detection"), sim.Eyes(n_eyes=1, resolution=resolution, fov_deg=fov))
    sampling = BoxSampling(scene.eye)
    evenly, drawn, again = (
        everywhere(scene, 96).receptors,
        *(near_population(scene, sampling, 96, 4096) for _ in range(2)),
    )
    pairs = on_objects(drawn.views, *drawn.views.in_agents(scene.eyes, sampling.trial(1, evenly).directions), [0.5] * 3)
    assert drawn.counted.sum() > 5 * pairs.sum()
    np.testing.assert_array_equal(drawn.receptors, again.receptors)
    np.testing.assert_array_equal(drawn.counted, again.counted)
