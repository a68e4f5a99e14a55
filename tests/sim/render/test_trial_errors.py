"""Errors of rays, traced rays and illuminated bodies of trials, from given signals."""

from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

import sim
from sim.render import populations, random_views
from sim.render.fidelity_trials import FidelityTrials
from sim.render.populations import Population, everywhere, near_objects
from sim.render.random_views import RandomViews
from sim.scene.variant import default_variant, variant

RNG = np.random.default_rng(8)


def trials(**given):
    found = FidelityTrials.__new__(FidelityTrials)
    vars(found).update(given)
    return found


@pytest.mark.parametrize(
    ("pupil", "layers", "rays", "reference"),
    [
        # 8 times as many rays, rounded up to a power of 4; a perfect lens has at least 8
        (None, 1, 1, 16),
        (None, 1, 2, 16),
        (None, 1, 3, 64),
        (None, 1, 8, 64),
        (None, 1, 8.5, 256),
        (None, 1, 0.1, 16),
        # the reference has at most 2^23 weights, here 2^23 / (layers · 2 · 3 · 3), but at least twice as many rays
        (None, 2**23 // 18 // 200, 100, 256),
        (None, 2**23 // 18 // 200, 120, 256),
        (None, 2**23 // 18 // 200, 129, 1024),
        (None, 2**23 // 18 // 300, 100, 1024),
        # behind a pupil, there are at least 4096 rays for 20 receptors, and weights for each receptor
        ("pupil", 1, 1, 256),
        ("pupil", 1, 32, 256),
        ("pupil", 1, 33, 1024),
        ("pupil", 2**23 // 120 // 60, 1, 64),
        ("pupil", 2**23 // 120 // 70, 1, 256),
    ],
)
def test_references_of_rays(pupil, layers, rays, reference):
    drawn = [
        SimpleNamespace(receptors=f"receptors {k}", views=f"views {k}", rms=lambda error: float(error[0]))
        for k in (1, 2)
    ]
    asked, depth = [], SimpleNamespace(count=layers)

    def trial(rays, receptors):
        asked.append((rays, receptors))
        return SimpleNamespace(directions=range(5), rays=rays, receptors=receptors)

    def signals(trial, own, light, views, most=None):
        assert (own, light) == (depth, "bounce")
        assert views == trial.receptors.replace("receptors", "views")
        assert most == (None if trial.rays == reference else 5 * 3)
        return np.full(3, 0.0 if trial.rays == reference else 1 / rays + int(views[-1]))

    found = trials(
        _eye=SimpleNamespace(pupil=pupil, bands=2),
        _eyes=SimpleNamespace(resolution=(4, 5)),
        _receptors=np.arange(3),
        _populations=lambda sampling: drawn,
        _signals=signals,
    )
    error = found.errors(SimpleNamespace(depth=depth, trial=trial), "bounce")
    assert error(rays) == pytest.approx(1 / rays + 2)
    assert asked == [(one, f"receptors {k}") for one in (reference, rays) for k in (1, 2)]
    asked.clear()
    assert error(rays) == pytest.approx(1 / rays + 2)
    assert [one for one, _ in asked] == [rays, rays], "a reference serves several trials"


EYES = sim.Eyes(n_eyes=2, resolution=(1, 2), placement_range_deg=90)
VIEWS = RandomViews(RNG.random((3, 2)), RNG.random(3), RNG.random((3, 1, 3)), np.array([0, 1, 1]))


@pytest.mark.parametrize("light", ["direct", "bounce"])
def test_rays_of_views(light):
    """Distances are measured along the eye's axis. Samples for reflections are the same in all views."""
    directions, bounces, asked = RNG.normal(size=(4, 3)), RNG.random((4, 2)), {}

    class Tracer:
        inputs, scene = "inputs", "scene"

        def buffers(self, n):
            asked["worlds"] = n
            return SimpleNamespace(fill=lambda poses: asked.update(poses=poses), arrays=lambda: "arrays")

        def around(self, scene, arrays, inputs, lanes):
            assert (scene, arrays, inputs) == ("scene", "arrays", "inputs")
            asked["lanes"] = lanes.numpy().tolist()
            return "there"

        def radiance(self, seen, there, samples):
            assert there == "there"
            asked.update(origin=np.array(seen.ray.o), way=np.array(seen.ray.d), agent=np.array(seen.body))
            asked["samples"] = np.array(samples)
            return [mi.Float(1.0)], mi.Float(np.arange(12.0))

    scene = SimpleNamespace(
        tracers=SimpleNamespace(tracer_for=lambda level: Tracer() if level == light else None),
        variant=default_variant(),
        poses_at=lambda *given: given,
    )
    trial = SimpleNamespace(directions=directions, bounce_samples=bounces)
    components, z = trials(_scene=scene, _eyes=EYES)._trace(VIEWS, trial, light)
    assert [one.numpy().tolist() for one in components] == [[1.0]]
    np.testing.assert_allclose(z.numpy(), np.arange(12) * np.tile(directions[:, 2], 3), rtol=1e-6)
    origins, ways = VIEWS.in_agents(EYES, directions)
    np.testing.assert_allclose(asked["origin"], np.repeat(origins, 4, axis=0).T, rtol=1e-6)
    np.testing.assert_allclose(asked["way"], ways.reshape(12, 3).T, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(asked["agent"], np.repeat(VIEWS.agents, 4, axis=0).T, rtol=1e-6)
    assert (asked["worlds"], asked["lanes"]) == (3, [0] * 4 + [1] * 4 + [2] * 4)
    for given, expected in zip(asked["poses"], (VIEWS.position, VIEWS.heading, VIEWS.objects), strict=True):
        assert given is expected
    if light == "direct":
        assert not asked["samples"].any()
        return
    second = np.random.default_rng(3).random((4, 2))
    np.testing.assert_allclose(
        asked["samples"], np.tile(np.concatenate([bounces, second], axis=1), (3, 1)).T, rtol=1e-6
    )


@pytest.mark.parametrize("places", [0, 3])
def test_bodies_that_reflect_light(places):
    """Each place is a point on the bodies of a view."""
    asked, bodies = {}, [RNG.random((2, 3)), RNG.random((2, 3))]

    def body_light(place, centres, inputs):
        asked.update(place=place.numpy().tolist(), inputs=inputs, centres=[np.array(one) for one in centres])
        return "light"

    tracer = SimpleNamespace(places=places, body_light=body_light, inputs="inputs")
    with variant(default_variant()):
        found = trials()._lit(tracer, bodies)
    if places == 0:
        assert found == []
        return
    assert found == "light"
    assert (asked["place"], asked["inputs"]) == ([0, 1, 2, 0, 1, 2], "inputs")
    for centre, body in zip(asked["centres"], bodies, strict=True):
        np.testing.assert_allclose(centre, np.repeat(body, 3, axis=0).T, rtol=1e-6)


def test_receptors_near_objects(monkeypatch):
    """A receptor counts in a view if an object fills more than 0.02 of its field."""
    middles = np.zeros((3, 6), bool)
    middles[:, 2] = True
    rays = np.array([[1, 0, 0], [1, 1, 0], [0, 0, 0]], bool)
    asked = []
    weights = np.array([[[0.02, 0.5, 0.48], [0.0201, 0.0, 0.9799]], [[0.02, 0.5, 0.48], [0.0201, 0.0, 0.9799]]])

    def on_objects(scene, views, trial):
        asked.append((scene, views, trial))
        return middles if trial == "middles" else rays

    class Box:
        def __init__(self, eye):
            self.eye = eye

        def trial(self, rays, receptors):
            assert (self.eye, rays, receptors.tolist()) == ("eye", 1, list(range(6)))
            return "middles"

    scene = SimpleNamespace(world="world", eyes=SimpleNamespace(resolution=(2, 3)), eye="eye")
    monkeypatch.setattr(populations, "near_views", lambda *given: given)
    monkeypatch.setattr(populations, "random_views", lambda *given: given)
    monkeypatch.setattr(populations, "BoxSampling", Box)
    monkeypatch.setattr(populations, "_on_objects", on_objects)
    monkeypatch.setattr(populations, "_drawn", lambda weights: asked.append(weights) or np.array([1, 4]))

    def trial(rays, receptors):
        asked.append((rays, receptors.tolist()))
        return SimpleNamespace(weights=weights)

    found = near_objects(scene, SimpleNamespace(trial=trial), 3, 60)
    views = ("world", scene.eyes, 3)
    assert found.views == views
    assert found.receptors.tolist() == [1, 4]
    np.testing.assert_array_equal(found.counted, [[False, True], [True, True], [False, False]])
    np.testing.assert_allclose(asked[1], [0.001, 0.001, 3.001, 0.001, 0.001, 0.001])
    assert asked[2] == (10, [1, 4])
    assert asked[0] == (scene, views, "middles")
    all_ = everywhere(scene, 5)
    assert all_.views == ("world", scene.eyes, 5)
    np.testing.assert_array_equal(all_.counted, np.ones((5, 2), bool))
    np.testing.assert_array_equal(asked[-1], np.ones(6))
    assert isinstance(all_, Population)


def test_places_beside_the_middle_of_a_cell():
    assert random_views._stray(SimpleNamespace(uniform=lambda *given: given)) == (-0.75, 0.75, 2)
