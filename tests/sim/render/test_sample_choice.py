"""The choice of samples: rays, areas, or areas that receptors share."""

from dataclasses import replace

import numpy as np
import pytest

import optics
import sim
from sim.render import eye_renderer
from sim.render.fidelity_stages import CAUTION
from sim.render.sample_choice import PERFECT_LENS_AREA, _fewest
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
    """Two areas would be necessary with the nine slices of narrow areas."""
    world, eyes = (
        sim.build_world("detection"),
        sim.Eyes(n_eyes=4, resolution=(12, 12), fov_deg=45, placement_range_deg=120),
    )
    assert sim.choose_fidelity(world, eyes).rays_per_receptor == 1
    monkeypatch.setattr(sphere_areas, "SIDES_OF_WIDE", sphere_areas.SIDES)
    assert sim.choose_fidelity(world, eyes).rays_per_receptor == 2


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
