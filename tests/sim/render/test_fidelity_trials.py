"""Trials of sampling methods: the populations, the directions of random views, and the light of illuminated bodies."""

import numpy as np
import pytest

import sim
from sim.eyes.depth_layers import ONE_PSF
from sim.render.fidelity_trials import FidelityTrials
from sim.render.random_views import NEAR, near_views, random_views
from sim.render.world_scene import WorldScene
from sim.tracing.lighting import BOUNCE

EYES = sim.Eyes(n_eyes=2, resolution=(1, 4))


def test_only_worlds_with_objects_have_a_population_near_objects():
    scenes = [WorldScene(sim.build_world(task), EYES) for task in ("maze", "detection")]
    maze, detection = (FidelityTrials(scene)._populations(scene.sampling(ONE_PSF)) for scene in scenes)
    assert len(maze) == 1
    everywhere, near = detection
    assert everywhere.counted.all()
    assert not near.counted.all()
    distances = np.linalg.norm(near.views.objects[:, 0, :2] - near.views.position, axis=1)
    assert ((distances > NEAR[0] - 1e-6) & (distances < NEAR[1] + 1e-6)).all()


def test_areas_and_rays_agree_on_bounced_light_in_a_world_without_objects():
    """The agent's own body is then the only body that reflects light. Areas with direct light only differ by 13 %."""
    scene = WorldScene(sim.build_world("maze"), EYES)
    trials, sampling = FidelityTrials(scene), scene.sampling(ONE_PSF)
    assert scene.areas(BOUNCE).places > 0
    receptors = np.arange(4)
    by_areas = trials._signals(scene.area_trial(sampling, 4, receptors), ONE_PSF, BOUNCE, most=1)
    by_rays = trials._signals(sampling.trial(4096, receptors), ONE_PSF, BOUNCE, most=1)
    assert np.sqrt(np.mean((by_areas - by_rays) ** 2)) < 0.02 * by_rays.mean()


@pytest.mark.parametrize("views", [random_views, near_views])
def test_views_have_all_directions(views):
    """The number of views in each quadrant is that of uniform directions, 100, to five standard deviations."""
    headings = views(sim.build_world("detection"), EYES, 400).heading
    quadrants = np.floor(headings / (np.pi / 2)).astype(int) % 4
    assert np.abs(np.bincount(quadrants, minlength=4) - 100).max() < 5 * np.sqrt(75)
