"""Rules for eyes on models, rays at edges, populations and bands, from given errors: every limit and reason."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import optics
import sim
from sim.eyes.depth_layers import ONE_PSF
from sim.render import edge_rays, fidelity_stages, model_fidelity, populations, random_views
from sim.render.fidelity import Level
from sim.render.fidelity_trials import FidelityTrials
from sim.render.model_fidelity import ModelStages, Trials, _light, _with, tried
from sim.render.populations import Population
from sim.scene.variant import default_variant, variant

EYE = sim.Eyes(n_eyes=1, resolution=(5, 5)).eye()
BEHIND_A_PUPIL = sim.Eyes(n_eyes=1, resolution=(5, 5), optics=optics.Pupil(1e-4)).eye()


def signals(*values):
    """Return signals (env, eye, channel, height, width) of one receptor after the other."""
    return np.array(values, float).reshape(1, 1, 1, 1, -1)


def test_errors_count_in_receptors_that_the_fewest_rays_do_not_settle():
    """They are those whose error with one ray exceeds a tenth of the allowed one."""
    asked = []

    def seen(rays):
        asked.append(rays)
        return {99: signals(0, 0, 0, 0), 1: signals(0.1, 0.11, 0.5, 0), 2: signals(5, 0.3, 0.4, 5)}[rays]

    found = tried(seen, (1, 2, 4), 99, 1.0)
    assert asked == [99, 1]
    assert found.errors == pytest.approx({1: math.sqrt((0.11**2 + 0.5**2) / 2)})
    assert found.share == 0.5
    asked.clear()
    found = tried(seen, (1, 2), 99, 0.3)
    assert asked == [99, 1, 2]
    assert found.errors == pytest.approx(
        {1: math.sqrt((0.1**2 + 0.11**2 + 0.5**2) / 3), 2: math.sqrt((25 + 0.09 + 0.16) / 3)}
    )


def test_channels_count_with_their_largest_error():
    errors = np.zeros((1, 1, 2, 1, 2))
    errors[0, 0, :, 0, 0] = 0.3, -0.4
    assert tried(lambda rays: errors * (rays == 1), (1,), 9, 0.1).errors == pytest.approx({1: 0.4})


@pytest.mark.parametrize(("errors", "rays", "enough"), [((3, 1.0), 2, True), ((3, 1.01), 2, False), ((1.0,), 1, True)])
def test_rays_of_models(monkeypatch, errors, rays, enough):
    stages = ModelStages(SimpleNamespace(eye=EYE), SimpleNamespace(n=5), 0.25, "direct")
    asked = []

    def fake(seen, ladder, truth, allowed):
        asked.append((ladder, truth, allowed))
        return Trials(dict(enumerate(errors, 1)), 0.125)

    monkeypatch.setattr(model_fidelity, "tried", fake)
    light = Level("light", "bounce", None, "")
    found = stages.samples(ONE_PSF, light, SimpleNamespace(error=1.0))
    assert asked == [((1, 2, 4, 8, 16, 32, 64, 128, 256), 1024, 1.0)]
    assert (found.kind, found.light, found.number, found.enough) == ("rays", light, rays, enough)
    assert (found.level.stage, found.level.level) == ("rays", f"{rays} per receptor")
    assert found.level.predicted_error == errors[-1]
    expected = "fewest for 1.0e+00 over receptors without a uniform field (12% of them, at 5 moments)"
    assert found.level.why == (expected if enough else "the largest number that is tried; 1.0e+00 is allowed")
    assert stages.depth(0.1) == (ONE_PSF, None)
    behind = ModelStages(SimpleNamespace(eye=BEHIND_A_PUPIL), SimpleNamespace(n=5), 0.25, "direct")
    behind.samples(ONE_PSF, light, SimpleNamespace(error=1.0))
    assert asked[1][:2] == ((0.25, 0.5, 1, 2, 4, 8, 16), 64)


def test_bands_of_models():
    stages = ModelStages(SimpleNamespace(eye=EYE, medium=None), None, 0.25, "direct")
    assert stages.bands() == Level("bands", f"{EYE.bands}", None, "the eye's own")
    medium = SimpleNamespace(
        band_error=lambda bands, receptors: 0.125 if (bands, receptors) == (EYE.bands, EYE.receptors) else 9
    )
    found = ModelStages(SimpleNamespace(eye=EYE, medium=medium), None, 0.25, "direct").bands()
    assert (found.stage, found.level, found.predicted_error) == ("bands", f"{EYE.bands}", 0.125 * EYE.throughput)


def test_light_of_models():
    """Receptors count whose bounced light exceeds a tenth of the allowed error."""
    light = {"direct": signals(0, 0, 0), "bounce": signals(0.1, 0.3, 0.4)}
    assert _light("bounce", None, 0.1) == Level("light", "bounce", None, "as requested")
    error = math.sqrt((0.3**2 + 0.4**2) / 2)
    for allowed, level in ((1.0, "direct"), (2.9, "direct")):
        found = _light("auto", light.get, allowed)
        assert (found.level, found.predicted_error) == (level, pytest.approx(error))
    assert _light("auto", light.get, 0.29).level == "bounce"
    alone = {"direct": signals(0.0), "bounce": signals(0.5)}
    assert _light("auto", alone.get, 0.5) == Level(
        "light",
        "direct",
        0.5,
        "direct light misses 5.0e-01 over receptors that bounced light reaches; 5.0e-01 is allowed",
    )
    found = _light("auto", alone.get, 0.49)
    assert (found.level, found.predicted_error) == ("bounce", None)
    assert _light("auto", {"direct": signals(0), "bounce": signals(0)}.get, 1.0).predicted_error == 0


@pytest.mark.parametrize(
    ("rays", "eye", "light", "samples"),
    [
        (256, EYE, "direct", "edges"),
        (2, EYE, "direct", "rays"),
        (1024, EYE, "direct", "rays"),
        (1023, EYE, "direct", "edges"),
        (256, EYE, "bounce", "rays"),
        (16, BEHIND_A_PUPIL, "direct", "rays"),
    ],
)
def test_rays_at_edges(rays, eye, light, samples):
    found = _with(rays, eye, 0.125, light)
    assert (found.rays_per_receptor, found.bands, found.tolerance) == (rays, eye.bands, 0.125)
    assert (found.light, found.samples) == (light, samples)


def test_edges_pay_up_to_half_of_the_rays(monkeypatch):
    monkeypatch.setattr(edge_rays, "beyond_rim_of", lambda resolution: np.ones(resolution[0] * resolution[1] * 2))
    assert edge_rays.edges_pay((3, 4), 16)
    assert not edge_rays.edges_pay((3, 4), 15.99)


def test_differences_up_to_the_noticed_one_are_no_edges():
    beyond = np.ones((3, 4), bool)
    beyond[1:-1, 1:-1] = False
    rays = edge_rays.EdgeRays.__new__(edge_rays.EdgeRays)
    rays._signals, rays._beyond, rays._noticed = [[1.0]], beyond, 0.25
    light = np.zeros((1, 1, 12))
    light[0, 0, 0] = 4.0
    assert not rays._beside_edges(light).any()
    light[0, 0, 0] = 4.001
    assert rays._beside_edges(light).tolist() == [True, True]


def test_errors_of_populations_are_root_mean_squares_over_what_counts():
    counted = np.array([[True, False], [False, True], [True, True]])
    error = np.arange(12.0).reshape(3, 2, 2)
    found = Population(None, np.arange(2), counted)
    assert found.rms(error) == pytest.approx(np.sqrt(np.mean(np.square([0, 2, 5, 7, 8, 10, 9, 11]))))
    assert found.rms(error[:1]) == pytest.approx(np.sqrt(np.mean(np.square([0, 2]))))
    assert Population(None, np.arange(2), ~counted & False).rms(error) == 0


def test_receptors_are_drawn_by_weight():
    weights = np.zeros(40)
    weights[5:35] = 1
    found = populations._drawn(weights)
    assert len(found) == 24
    assert (np.diff(found) > 0).all()
    assert found.min() >= 5
    assert found.max() < 35
    np.testing.assert_array_equal(populations._drawn(np.ones(24)), np.arange(24))


@pytest.mark.parametrize("pupil", [None, "pupil"])
def test_areas_of_a_field(pupil):
    trials = FidelityTrials.__new__(FidelityTrials)
    trials._eye, trials._eyes = SimpleNamespace(pupil=pupil), SimpleNamespace(resolution=(4, 5))
    trials._receptors = np.array([7, 8])

    def trial(sampling, areas, receptors):
        assert (sampling, areas, list(receptors)) == ("sampling", 4, [7])
        return SimpleNamespace(directions=np.zeros((50, 3)))

    trials._scene = SimpleNamespace(area_trial=trial)
    assert trials.areas_of_field("sampling", 4) == (2.5 if pupil else 50)


def test_tolerances_that_an_eye_accepts(monkeypatch):
    asked = []
    eye = SimpleNamespace(throughput=0.5, bands=9)
    monkeypatch.setattr(
        fidelity_stages,
        "replace",
        lambda eye, bands, tolerance: asked.append((bands, tolerance)) or SimpleNamespace(bands=7),
    )
    for allowed in (1e-7, 0.1, 0.5):
        assert fidelity_stages.bands(eye, allowed)[0] == 7
    assert asked == [("auto", 1e-6), ("auto", 0.2), ("auto", 0.5)]


def test_errors_of_own_bands_in_a_medium(monkeypatch):
    monkeypatch.setattr(fidelity_stages, "measured", lambda model, spectra: spectra)
    monkeypatch.setattr(fidelity_stages, "band_error", lambda spectra, receptors, bands: 0.25)
    eye = SimpleNamespace(throughput=0.5, bands=3, receptors="receptors")
    medium = SimpleNamespace(band_error=lambda bands, receptors: 0.125)
    for spectra, medium_, error, why in (
        ((), None, None, "the eyes' own"),
        (("a",), None, 0.125, "measured reflectances in daylight"),
        ((), medium, 0.0625, "white and black in the medium"),
        (("a",), medium, 0.125, "measured reflectances in daylight"),
    ):
        found = fidelity_stages.own_bands(SimpleNamespace(model=None, spectra=spectra, medium=medium_), eye)
        assert (found.level, found.predicted_error) == ("3", error)
        assert why in found.why
        assert ("medium" in found.why) == (medium_ is not None)


class Drawn:
    """A random generator with given values."""

    def __init__(self, *values):
        self.values = list(values)

    def __getattr__(self, name):
        return lambda *args, **options: self.values.pop(0)


def test_views_near_objects_are_beside_them_and_look_at_them(monkeypatch):
    """The second azimuth and distance lead to a cell; the first would be between cells. Heading and the eye's azimuth
    add up to the direction of the object, up to the offset that is drawn last.
    """
    eyes = sim.Eyes(n_eyes=2, resolution=(1, 3), fov_deg=60, placement_range_deg=90)
    world = SimpleNamespace(
        objects=["ball"],
        model=SimpleNamespace(body=lambda name: SimpleNamespace(pos=np.array([0, 0, 0.5]))),
        agent_spawn=np.array([[0.0, 0.0]]),
        object_spawn=np.array([[4.0, 3.0]]),
    )
    drawn = Drawn(np.array([0]), np.array([1]), 0.0, 3.0, math.atan2(-3, -4), 5.5, 0.25)
    monkeypatch.setattr(random_views.np.random, "default_rng", lambda seed: drawn)
    found = random_views.near_views(world, eyes, 1)
    np.testing.assert_allclose(found.objects, [[[4, 3, 0.5]]])
    np.testing.assert_allclose(found.position, [[-0.4, -0.3]], atol=1e-12)
    assert found.heading[0] + eyes.azimuths()[1] == pytest.approx(math.atan2(3, 4) + 0.25)
    assert (found.eye.tolist(), drawn.values) == ([1], [])


def test_a_grazing_ray_does_not_hit_a_ball():
    """A ray beside the eye has no distance along it."""
    views = SimpleNamespace(objects=np.array([[[0.0, 1.0, 0.0]]]))
    ways = np.array([[[1.0, 0, 0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]])
    for radius, expected in ((1.0, [False, True, False]), (1.5, [False, True, False])):
        found = random_views.on_objects(views, np.zeros((1, 3)), ways, np.array([radius]))
        assert found.tolist() == [expected]
    views = SimpleNamespace(objects=np.array([[[2.0, 1.0, 0.0]]]))
    assert not random_views.on_objects(views, np.zeros((1, 3)), ways[:, :1], np.array([1.0])).any()


def test_places_clear_of_objects():
    """The first clear place of a hundred is taken, else the last one."""
    objects, near, far = np.zeros((1, 2)), np.array([0.5, 0.0]), np.array([2.0, 0.0])
    places = iter([near, far, near])
    assert random_views._clear_of(objects, lambda: next(places), 1.0) is far
    count = []
    random_views._clear_of(objects, lambda: count.append(1) or near, 0.5)
    assert len(count) == 100
    assert random_views._clear_of(np.zeros((0, 2)), lambda: near) is near


def test_objects_share_places_only_where_there_are_too_few():
    for places, apart in ((2, True), (1, False)):
        world = SimpleNamespace(
            objects=["a", "b"],
            model=SimpleNamespace(body=lambda name: SimpleNamespace(pos=np.array([9, 9, {"a": 1.0, "b": 2.0}[name]]))),
            object_spawn=np.arange(2.0 * places).reshape(places, 2),
        )
        found = random_views._objects(world, 5, np.random.default_rng(0))
        assert found.shape == (5, 2, 3)
        assert (found[..., 2] == [1, 2]).all()
        assert (found[:, 0, :2] != found[:, 1, :2]).any(axis=1).all() == apart
    world.objects = []
    assert random_views._objects(world, 5, None).shape == (5, 0, 3)


def test_receptors_whose_first_rays_differ_by_the_noticed_amount_are_kept():
    """Rays are traced again in the receptor whose spread is larger; its sums are scaled to four rays."""
    beyond = np.ones((3, 5), bool)
    beyond[1:-1, 1:-1] = False
    rays = edge_rays.EdgeRays.__new__(edge_rays.EdgeRays)
    rays._signals, rays._beyond, rays._noticed, rays._rays = [[0.0]], beyond, 0.25, 8
    rays._fine, rays._along = "fine", edge_rays.KernelInputs(None, None, None, None, None)
    found, asked = np.zeros((2, beyond.size)), []
    found[0, :3], found[1, :3] = (1.0, 2.0, 3.0), (0.25, 0.2501, 0.0)

    def launch(kernel, inputs):
        asked.append((kernel, inputs.lanes.numpy().tolist()))
        return lambda: np.array([[10.0]])

    with variant(default_variant()):
        assert rays._refined(found, launch).tolist() == [1, 5, 3]
    assert asked == [("fine", list(range(8, 16)))]
