"""Trials of sampling methods: the populations, the directions of random views, and the light of illuminated bodies."""

from types import SimpleNamespace

import numpy as np
import pytest

import sim
from sim.eyes.depth_layers import ONE_PSF
from sim.eyes.eyes import BODY_RADIUS, EYE_HEIGHT
from sim.render.fidelity_trials import FidelityTrials
from sim.render.random_views import NEAR, RandomViews, near_views, on_objects, random_views
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
    """The agent's own body is then the only body that reflects light. Areas in direct light would differ by 13 %."""
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


def some_views(n, rng):
    """Return views of two objects at random places around the agents."""
    heading, eye = rng.uniform(-np.pi, np.pi, n), rng.integers(EYES.n_eyes, size=n)
    return RandomViews(rng.uniform(-3, 3, (n, 2)), heading, rng.uniform(-4, 4, (n, 2, 3)), eye)


def test_eyes_are_on_the_body_and_look_outwards():
    """Axis, right and up of an eye follow from the heading and the eye's azimuth."""
    views = some_views(50, np.random.default_rng(7))
    angle = views.heading + EYES.azimuths()[views.eye]
    cos, sin, zero = np.cos(angle), np.sin(angle), np.zeros(50)
    ahead, right, up = np.stack([cos, sin, zero], 1), np.stack([sin, -cos, zero], 1), np.array([0.0, 0.0, 1.0])
    origins, directions = views.in_agents(EYES, np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8]]))
    expected = BODY_RADIUS * ahead + np.column_stack([views.position, np.full(50, EYE_HEIGHT)])
    np.testing.assert_allclose(origins, expected, atol=1e-12)
    for k, way in enumerate((ahead, 0.6 * right + 0.8 * ahead, 0.6 * up + 0.8 * ahead)):
        np.testing.assert_allclose(directions[:, k], way, atol=1e-12)
    few = views.take(3)
    for name in ("position", "heading", "objects", "eye"):
        np.testing.assert_array_equal(getattr(few, name), getattr(views, name)[:3])
    assert len(few) == 3


def test_rays_hit_a_ball_if_they_pass_its_centre_within_its_radius_and_in_front():
    rng, radii = np.random.default_rng(8), (0.4, 1.7)
    views, origins, ways = some_views(40, rng), rng.uniform(-1, 1, (40, 3)), rng.normal(size=(40, 200, 3))
    ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
    expected = np.zeros((40, 200), bool)
    for k, radius in enumerate(radii):
        towards = (views.objects[:, k] - origins)[:, None]
        passes = np.linalg.norm(np.cross(ways, towards), axis=-1)
        expected |= (passes < radius) & (np.sum(ways * towards, axis=-1) > 0)
    assert 0.02 < expected.mean() < 0.5
    np.testing.assert_array_equal(on_objects(views, origins, ways, radii), expected)


class Counted:
    """A population of signals whose error is that of the number of rays, and which counts its trials."""

    views = "views"

    def __init__(self, receptors):
        self.receptors = receptors

    def rms(self, difference):
        return float(np.abs(difference).max())


@pytest.mark.parametrize(
    ("pupil", "bands", "references"),
    [
        (None, 4, {1: 16, 2: 16, 3: 64, 300: 4096, 1e5: 4**9}),
        ("pupil", 4, {1: 256, 20: 256, 40: 1024, 1e5: 4**9}),
        (None, 2**20, {1: 4, 3: 16}),
        (None, 2**15, {1: 16}),
        ("pupil", 2**15, {1: 4}),
    ],
)
def test_references_have_several_times_as_many_rays_and_are_computed_once(pupil, bands, references):
    """Their number is a power of four. It is at least 8 times that of the trial (behind a pupil, at least 4096 rays),
    but needs no more than 2^23 weights unless it would be less than twice that of the trial."""
    trials, asked = FidelityTrials.__new__(FidelityTrials), []
    trials._eye = SimpleNamespace(pupil=pupil, bands=bands)
    trials._eyes, trials._receptors = SimpleNamespace(resolution=(4, 5)), np.arange(3)
    populations = [Counted(np.arange(3)), Counted(np.arange(2))]
    trials._populations = lambda sampling: populations

    def trial(rays, receptors):
        asked.append((rays, len(receptors)))
        return SimpleNamespace(directions=np.zeros((7, 3)), rays=rays, receptors=len(receptors))

    sizes = []

    def signals(one, depth, light, views, size=None):
        assert (depth, light, views) == (sampling.depth, "bounce", "views")
        sizes.append(size)
        return np.full(5, one.receptors / one.rays)

    trials._signals = signals
    sampling = SimpleNamespace(depth=SimpleNamespace(count=2), trial=trial)
    error = trials.errors(sampling, "bounce")
    known = set()
    for rays, reference in references.items():
        assert error(rays) == pytest.approx(3 * abs(1 / rays - 1 / reference))
        expected = [] if reference in known else [(reference, 3), (reference, 2)]
        known.add(reference)
        assert asked == [*expected, (rays, 3), (rays, 2)]
        assert sizes == [None] * len(expected) + [35, 35]
        asked.clear()
        sizes.clear()
