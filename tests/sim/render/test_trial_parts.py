"""Trials of sampling methods, from given signals: references, differences and numbers of views."""

import math
from dataclasses import dataclass
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import optics
import sim
from sim.eyes.depth_layers import DepthLayers
from sim.eyes.sampling import BoxSampling
from sim.render import fidelity_trials, prepared_scene
from sim.render.fidelity_trials import FidelityTrials, _in_fours, _rms, _summed
from sim.render.populations import Population
from sim.render.prepared_scene import PreparedScene

RNG = np.random.default_rng(4)
PERFECT = BoxSampling(sim.Eyes(n_eyes=1, resolution=(5, 5)).eye())


def trials(pupil=None, **changes):
    found = FidelityTrials.__new__(FidelityTrials)
    found._eye = SimpleNamespace(pupil=pupil, bands=2, lattice=None)
    found._eyes, found._receptors = SimpleNamespace(resolution=(4, 5)), np.arange(3)
    vars(found).update(changes)
    return found


@dataclass(frozen=True)
class Trial:
    weights: np.ndarray
    rays: float = 0.0
    receptors: object = None


def test_fewer_layers_use_the_weights_of_their_nodes():
    """One layer uses the middle one of nine nodes, and three use the ends and the middle."""
    weights = RNG.random((9 * 2, 3, 7))
    finest = DepthLayers(20.0, 1.0, 9)
    asked = []

    def trial(rays, receptors):
        asked.append((rays, receptors))
        return Trial(weights)

    def signals(trial, depth, light):
        assert light == "direct"
        return np.array([trial.weights.sum(), depth.count])

    found = trials(_scene=SimpleNamespace(camera_sampling=lambda depth: SimpleNamespace(trial=trial)), _signals=signals)
    errors = found.errors_of_layers(finest, (1, 3, 9))
    assert asked == [(4096 / 20, found._receptors)]
    nodes = weights.reshape(9, 2, 3, 7)
    for n, chosen in ((1, [4]), (3, [0, 4, 8]), (9, list(range(9)))):
        off = [nodes[chosen].sum() - nodes.sum(), n - 9]
        assert errors[n] == pytest.approx(math.sqrt((off[0] ** 2 + off[1] ** 2) / 2))


def test_references_of_areas(monkeypatch):
    """A reference has at most 2^21 rays in 48 views; behind a pupil its weights are limited, too."""
    asked = []
    monkeypatch.setattr(
        type(PERFECT), "trial", lambda self, rays, receptors: asked.append(rays) or "trial", raising=False
    )
    for receptors, rays in ((1, 8192), (20, 2**21 // 48 // 20), (24, 2**21 // 48 // 24), (100, 1024)):
        assert trials()._truth(PERFECT, np.arange(receptors)) == "trial"
        assert asked.pop() == rays

    @dataclass(frozen=True)
    class Blurred:
        depth: object
        fields: object

        def trial(self, rays, receptors):
            asked.append((rays, self.fields))
            return "trial"

    fields = SimpleNamespace(drawn_for=lambda receptors: f"fields of {len(receptors)}")
    for layers, rays in ((1, 2**21 // 48), (64, 2**23 // (64 * 2 * 3)), (4096, 4096)):
        sampling = Blurred(SimpleNamespace(count=layers), fields)
        assert trials()._truth(sampling, np.arange(3)) == "trial"
        assert asked.pop() == (pytest.approx(rays / 20), "fields of 3")


def test_reflected_light():
    """Both populations are tried; the one with more light after a second reflection counts."""
    light = {"direct": 1.0, "bounce": 1.5, "all": 1.8}
    populations = [Population(f"views {k}", np.arange(k), np.ones((2, k), bool)) for k in (1, 2)]
    asked = []

    def signals(trial, depth, level, views=None):
        asked.append((trial, depth, level, views))
        scale = trial.receptors if isinstance(trial, Trial) else 1
        return np.full((2, 1, scale), light[level] * scale)

    sampling = SimpleNamespace(depth="depth", trial=lambda rays, receptors: Trial(None, rays, len(receptors)))
    scene = SimpleNamespace(area_trial=lambda sampling, areas, receptors: ("areas", areas, receptors))
    found = trials(_signals=signals, _scene=scene, _populations=lambda sampling: populations)
    assert found.reflected_twice(sampling) == (pytest.approx(1.0), pytest.approx(2.0))
    assert [one[1:] for one in asked] == [
        ("depth", level, f"views {k}") for k in (1, 2) for level in ("direct", "bounce")
    ]
    assert asked[0][0].rays == 4096 / 20
    asked.clear()
    assert found.reflected_more_often(sampling) == pytest.approx(0.3)
    assert [one[1:3] for one in asked] == [("depth", "bounce"), ("depth", "all")]
    assert asked[0][0][:2] == ("areas", 1)


def test_errors_of_areas_are_those_of_the_worse_population():
    populations = [
        Population(SimpleNamespace(take=lambda n, k=k: (k, n)), np.arange(k), np.ones((4, k), bool)) for k in (1, 2)
    ]
    asked = []

    def signals(trial, depth, light, views, most):
        asked.append((trial, depth, light, views, most))
        kind, areas, receptors = trial
        return np.full((4, 1, receptors), receptors / areas if kind == "areas" else 0.0)

    scene = SimpleNamespace(area_trial=lambda sampling, areas, receptors: ("areas", areas, len(receptors)))
    found = trials(
        _signals=signals,
        _scene=scene,
        _populations=lambda sampling: populations,
        _truth=lambda sampling, receptors: ("truth", 1, len(receptors)),
    )
    error = found.area_errors(SimpleNamespace(depth="depth"), "bounce")
    assert len(asked) == 2
    assert error(8) == pytest.approx(2 / 8)
    assert asked[2:] == [(("areas", 8, k), "depth", "bounce", (k, 4), 2**21) for k in (1, 2)]


@pytest.mark.parametrize(("lattice", "known", "possible"), [(None, 2, True), (None, 1, False), ("lattice", 2, False)])
def test_areas_are_possible_in_all_light_or_not(lattice, known, possible):
    def areas(light):
        if light not in ("bounce", "all")[:known]:
            raise ValueError(light)

    found = trials(_scene=SimpleNamespace(areas=areas))
    found._eye.lattice = lattice
    assert found.have_areas("bounce", "all") is possible


@pytest.mark.parametrize(("rays", "most", "views"), [(10, 400, 40), (10, 100, 12), (1, 400, 96), (10, 9, 12)])
@pytest.mark.parametrize("extent", [None, (0.1, 0.1)])
def test_trials_have_as_many_views_as_their_rays_allow(monkeypatch, rays, most, views, extent):
    """There are 12 to 96 views. Signals are sums over layers, components and rays."""
    taken, light = [], RNG.random((2 * 3, views * rays))
    own = SimpleNamespace(take=lambda n: taken.append(n) or np.zeros(n))
    weights = RNG.random((2 * 4, 5, rays))
    trial = SimpleNamespace(directions=np.zeros((rays, 3)), extent=extent, weights=weights)
    factors = RNG.random((2, 3, 4))
    found = trials(
        _views=own,
        _see_areas=lambda views, trial, light_, depth: list(light),
        _trace=lambda views, trial, level: ([np.ones(1)] * 3, np.ones(1)),
        _factors=lambda level, trial: factors,
        _scene=SimpleNamespace(variant="variant"),
    )
    monkeypatch.setattr(fidelity_trials, "variant", lambda name: pytest.MonkeyPatch.context())
    monkeypatch.setattr(fidelity_trials.dr, "rcp", lambda z: z)
    rows = list(light.reshape(2, 3, -1))
    depth = SimpleNamespace(count=2, shares=lambda near: [Share(row) for row in rows])
    signals = found._signals(trial, depth, "direct", most=most)
    assert taken == [views]
    planes = weights.reshape(2, 4, 5, rays)
    layers = light.reshape(2, 3, views, rays)
    expected = np.einsum("ckb,lbrp,lkvp->vcr", factors, planes, layers)
    np.testing.assert_allclose(signals, expected, rtol=1e-5)


class Share:
    """The share of a layer, whose products with the three components are given in their order."""

    def __init__(self, rows):
        self.rows = iter(rows)

    def __mul__(self, component):
        return next(self.rows)


def test_sums_and_root_mean_squares():
    weights, layers = RNG.random((2, 3, 4, 5, 6)), RNG.random((3, 4, 7, 6))
    np.testing.assert_allclose(_summed(weights, layers), np.einsum("clkrp,lkvp->vcr", weights, layers))
    assert _rms(np.array([[3.0, 4.0]])) == pytest.approx(math.sqrt(12.5))
    bounce = RNG.random((5, 2))
    found = _in_fours(SimpleNamespace(bounce_samples=bounce))
    np.testing.assert_array_equal(found, np.concatenate([bounce, np.random.default_rng(3).random((5, 2))], axis=1))


def test_distances_are_sorted():
    asked = []

    def trace(views, trial, light):
        asked.append((views, len(trial.directions), light))
        return None, [3.0, 1.0, math.inf]

    found = trials(_views="views", _trace=trace)
    found._eye = PERFECT.eye
    assert found.distances().tolist() == [1, 3, math.inf]
    assert asked == [("views", 12, "direct")]


def test_populations_near_objects_are_drawn_once_for_each_depth(monkeypatch):
    asked = []
    monkeypatch.setattr(
        fidelity_trials, "near_objects", lambda *arguments: asked.append(arguments) or f"near {len(asked)}"
    )
    scene = SimpleNamespace(world=SimpleNamespace(objects=["ball"]))
    found = trials(_scene=scene, _everywhere="everywhere", _known={})
    one, other = SimpleNamespace(depth="one"), SimpleNamespace(depth="other")
    assert found._populations(one) == ["everywhere", "near 1"]
    assert found._populations(one) == ["everywhere", "near 1"]
    assert found._populations(other) == ["everywhere", "near 2"]
    assert asked[0] == (scene, one, 96, 4096)
    scene.world.objects = []
    assert found._populations(one) == ["everywhere"]


@pytest.mark.parametrize(("depth", "refused"), [(0.0, False), (-1.0, False), (1e-3, True)])
def test_eyes_on_the_surface_are_not_inside(monkeypatch, depth, refused):
    """The second eye is compared with the second geom."""
    scene = SimpleNamespace()
    scene.model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body name="a"><geom name="g" size="1"/><geom name="h" size="1"/></body></worldbody>'
        "</mujoco>"
    )
    scene.places = SimpleNamespace(frames=lambda poses: (np.array([[[1, 2, 3], [4.0, 5.0, 6.0]]]), None))
    scene.mounts, scene.scene = [SimpleNamespace(on="x"), SimpleNamespace(on="y")], SimpleNamespace(geoms=[0, 1])
    monkeypatch.setattr(
        prepared_scene, "depth_inside", lambda model, data, geom, pupil: depth if (geom, pupil[0]) == (1, 4.0) else -1.0
    )
    if not refused:
        PreparedScene._refuse_eyes_inside(scene)
        return
    reason = (
        r"mounts\[1\] on 'y': in the reference pose of the model, the eye at \(4, 5, 6\) m of the world is inside geom "
    )
    with pytest.raises(ValueError, match=rf"{reason}'h' of body 'a', 0\.001 m below its surface"):
        PreparedScene._refuse_eyes_inside(scene)


def test_photons_of_frames():
    """The mixing weights of an eye multiply the bands of each component."""
    eye = optics.Eye(resolution=(2, 2), bands=3)
    basis = RNG.random((4, 3))
    scene = SimpleNamespace(
        areas=lambda light: SimpleNamespace(basis=2 * basis),
        tracers=SimpleNamespace(tracer_for=lambda light: SimpleNamespace(basis=basis)),
    )
    found = trials(_scene=scene)
    found._eye = eye
    for extent, scale in ((None, 1), ((1, 1), 2)):
        factors = found._factors("direct", SimpleNamespace(extent=extent))
        expected = eye.aperture_throughput * eye.spectral_bands.weights[:, None] * scale * basis[None]
        np.testing.assert_allclose(factors, expected)
