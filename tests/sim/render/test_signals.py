"""Signals, places in random sequences, labels and areas of renderers, from given numbers."""

import math
import warnings
from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

import optics
import sim
from sim.eyes.eyes import BODY_RADIUS
from sim.render import batched_renderer, eye_renderer, fidelity_trials
from sim.render.batched_renderer import BatchedRenderer
from sim.render.eye_renderer import EyeRenderer
from sim.render.fidelity import Fidelity
from sim.render.fidelity_trials import FidelityTrials
from sim.render.labels import Labels
from sim.render.light_factors import LightFactors
from sim.render.optic_flow import flow_between
from sim.render.prepared_scene import PreparedScene
from sim.render.random_views import RandomViews
from sim.render.receptor_noise import Normals
from sim.scene.variant import default_variant, variant
from sim.worlds.state import WorldState

RNG = np.random.default_rng(6)


def white_in(*lights, veil=None):
    """Return the radiance of white in a scene with these lights and this veiling light."""
    scene = PreparedScene.__new__(PreparedScene)
    found = [SimpleNamespace(kind=kind, level=np.array(level)) for kind, level in lights]
    medium = None if veil is None else SimpleNamespace(veil=np.array(veil))
    scene.eye = SimpleNamespace(bands=2)
    scene.scene = SimpleNamespace(lights=SimpleNamespace(found=found), medium=medium)
    return scene.white


def test_the_radiance_of_white():
    """A surface reflects 1/π of its irradiance. Veiling light counts where it is brighter."""
    suns = ("directional", [1.0, 2.0]), ("point", [50.0, 60.0]), ("directional", [3.0, 1.0])
    np.testing.assert_allclose(white_in(*suns), np.array([4, 3]) / math.pi)
    np.testing.assert_allclose(white_in(*suns, veil=[1.0, 2.0]), [4 / math.pi, 2])
    np.testing.assert_array_equal(white_in(), [0, 0])


def renderer(mosaic=None, basis=None, channels=3):
    """Return a renderer of two worlds with three eyes of 2 x 2 receptors, and the arguments of its sums."""
    found, asked = EyeRenderer.__new__(EyeRenderer), []
    found.n_envs, found.mounts, found._mosaic = 2, range(3), mosaic
    found.eye = SimpleNamespace(resolution=(2, 2), bands=2)
    found._mixing = RNG.random((channels, 2))
    found.tracer = SimpleNamespace(basis=np.array([[0.25, 0.75]]) if basis is None else basis)

    def sums(name):
        def of(layers):
            asked.append((name, layers))
            return np.arange(2.0 * 3 * channels * 4)

        return of

    found.sensor = SimpleNamespace(depth=SimpleNamespace(count=2), receptor_sums=lambda mixing, basis: sums("bands"))
    found._receptor_sums = sums("components")
    return found, asked


def test_signals_are_arranged_by_world_and_eye():
    """Two layers with one component, for six views of five samples."""
    one, asked = renderer()
    light = RNG.random(2 * 1 * 6 * 5)
    signals = one._signals(light, None)
    np.testing.assert_array_equal(signals, np.arange(72.0).reshape(2, 3, 3, 2, 2))
    [(name, layers)] = asked
    assert name == "components"
    np.testing.assert_array_equal(layers, light.reshape(2, 6, 5))


def test_mosaics_select_a_channel_for_each_receptor():
    types = np.array([[0, 2], [1, 0]])
    one, _ = renderer(types)
    every = np.arange(72.0).reshape(2, 3, 3, 2, 2)
    signals = one._signals(np.zeros(60), None)
    assert signals.shape == (2, 3, 1, 2, 2)
    for i, j in np.ndindex(2, 2):
        np.testing.assert_array_equal(signals[:, :, 0, i, j], every[:, :, types[i, j], i, j])


@pytest.mark.parametrize("traced", ["components", "bands"])
@pytest.mark.parametrize("same", [True, False])
def test_factors_of_light(traced, same):
    """A common factor multiplies the signals of components. All other factors multiply the light in the bands."""
    one, asked = renderer(basis=np.eye(2) if traced == "bands" else None)
    factors = LightFactors.from_light(np.array([[2.0, 2], [3, 3]] if same else [[2.0, 2], [3, 4]]), (2, 2))
    light = RNG.random((2, len(one.tracer.basis), 30)).astype(np.float32)
    signals = one._signals(light.ravel(), factors)
    [(name, layers)] = asked
    every = np.arange(72.0).reshape(2, 3, 3, 2, 2)
    if same and traced == "components":
        assert name == "components"
        np.testing.assert_allclose(signals, every * np.array([2, 3])[:, None, None, None, None])
        return
    assert name == "bands"
    np.testing.assert_array_equal(signals, every)
    inbands = light if traced == "bands" else light * np.array([0.25, 0.75])[:, None]
    worlds = np.repeat(factors.bands.T, 15, axis=1)
    np.testing.assert_allclose(layers, (inbands * worlds).reshape(4, 6, 5), rtol=1e-5)


def test_radiance_of_receptors_and_of_rays():
    """Components become bands, and layers are added up along rays."""
    one, _ = renderer()
    light = RNG.random((2, 1, 24)).astype(np.float32)
    one._rays, asked = "rays", []
    one._launched = lambda *given: asked.append(given) or SimpleNamespace(wait=light.ravel)
    rays = one.radiance("poses")
    inbands = light.reshape(2, 2, 3, 4)[..., None] * np.array([0.25, 0.75])
    np.testing.assert_allclose(rays, inbands.sum(axis=0), rtol=1e-6)
    one.sensor.receptor_radiance = lambda sums: asked.append(sums) or np.arange(48.0)
    found = one.receptor_radiance("poses")
    np.testing.assert_array_equal(found, np.arange(48.0).reshape(2, 2, 3, 2, 2))
    assert asked[:2] == [("poses", "rays"), ("poses",)]
    np.testing.assert_allclose(asked[2].reshape(2, 2, 2, 3, 4), np.moveaxis(inbands, -1, 1), rtol=1e-6)


def test_old_names_of_launches():
    one, _ = renderer()
    one.launch, one.launch_some = lambda: "all", lambda: "some"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        assert (one.begin(), one.begin_some()) == ("all", "some")


def test_numbers_of_worlds(monkeypatch):
    """Memory is checked for rays, weights behind pupils, and planes of components and layers."""
    asked = []
    monkeypatch.setattr(eye_renderer, "check_memory", asked.append)
    monkeypatch.setattr(eye_renderer, "FieldSampling", SimpleNamespace)
    one, _ = renderer()
    one.fidelity = SimpleNamespace(depth=SimpleNamespace(count=5))
    for sampling, weights in ((None, 0), (SimpleNamespace(), 10)):
        one._sampling = sampling
        one._check_memory(4, 1.5)
        demand = asked.pop()
        assert (demand.rays_per_receptor, demand.worlds, demand.eyes, demand.resolution) == (1.5, 4, 3, (2, 2))
        assert (demand.planes, demand.weights) == (5, weights)
    one._check_memory(2**31 - 1, 1.0)
    for wrong in (0, 2**31):
        with pytest.raises(ValueError, match=r"^n_envs = "):
            one._check_memory(wrong, 1.0)
    one.sensor.directions = np.zeros((6, 3))
    assert one._samples_per_receptor == 1.5


def test_resized_renderers_have_their_own_buffers(monkeypatch):
    one, _ = renderer()
    one.sensor.directions = np.zeros((6, 3))
    checked, widths = [], []
    monkeypatch.setattr(EyeRenderer, "_check_memory", lambda self, *given: checked.append(given))
    monkeypatch.setattr(EyeRenderer, "_set_width", lambda self, n: widths.append((self, n)))
    vars(one).update(_few="few", labels="labels")
    other = one.resized(7)
    assert checked == [(7, 1.5)]
    assert widths == [(other, 7)]
    assert other is not one
    assert not {"_few", "labels"} & set(vars(other))
    assert (one._few, one.labels) == ("few", "labels")
    del one._few
    assert one._few is not other
    assert widths[-1] == (one._few, 8)


def test_the_place_in_a_random_sequence():
    """Each world has a key and a number of frames, which can be restored."""
    normals = Normals(np.array([7, 8, 9], np.uint64), (2, 3))
    first = normals.launch().wait()
    second = normals.launch(np.array([0, 2])).wait()
    place = normals.place
    assert place.dtype == np.uint64
    np.testing.assert_array_equal(place, [[7, 2], [8, 1], [9, 2]])
    third = normals.launch().wait()
    other = Normals(np.zeros(3, np.uint64), (2, 3))
    other.go_on_from(place)
    np.testing.assert_array_equal(other.launch().wait(), third)
    other.restart(np.array([7, 8, 9], np.uint64))
    np.testing.assert_array_equal(other.launch().wait(), first)
    np.testing.assert_array_equal(other.launch().wait()[[0, 2]], second)
    assert first.shape == (3, 2, 3)
    assert len({*first.ravel(), *second.ravel(), *third.ravel()}) == 18 + 12 + 18


def test_recordings_of_labels():
    labels = Labels.__new__(Labels)
    labels._distances, labels._hits = SimpleNamespace(n_recordings=2), SimpleNamespace(n_recordings=30)
    assert labels.recordings == 32


@pytest.mark.parametrize("fidelity", [None, Fidelity(4, bands=7)])
def test_eyes_have_the_bands_of_the_fidelity(monkeypatch, fidelity):
    eyes, asked = sim.Eyes(n_eyes=1, resolution=(1, 2), bands=3), []
    monkeypatch.setattr(batched_renderer, "WorldScene", lambda *given: asked.append(given) or "scene")
    monkeypatch.setattr(batched_renderer, "chosen_fidelity", lambda scene: f"chosen for {scene}")
    monkeypatch.setattr(BatchedRenderer, "_open", lambda self, *given: asked.append(given))
    here = sim.build_world("detection")
    BatchedRenderer(here, eyes, 5, fidelity, "mitsuba")
    (world, own, tracer), opened = asked
    assert (world, own.bands, tracer) == (here, 3 if fidelity is None else 7, "mitsuba")
    assert opened == ("scene", 5, "chosen for scene" if fidelity is None else fidelity)
    with pytest.raises(ValueError, match=r"^fidelity = 4: must be a kind of Fidelity, such as"):
        BatchedRenderer(here, eyes, 5, 4)


@pytest.mark.parametrize("worlds", [2, 3])
def test_states_have_the_renderer_s_number_of_worlds(monkeypatch, worlds):
    one = BatchedRenderer.__new__(BatchedRenderer)
    one.n_envs = 2
    monkeypatch.setattr(EyeRenderer, "_launched", lambda self, poses, frozen: (poses, frozen))
    state = WorldState.__new__(WorldState)
    monkeypatch.setattr(WorldState, "n", worlds, raising=False)
    if worlds == 2:
        assert one._launched(state, "kernel") == (state, "kernel")
        return
    with pytest.raises(ValueError, match=r"^state has 3 worlds, this renderer was built for n_envs = 2$"):
        one._launched(state)


def test_flow_needs_no_second_geom():
    """A receptor without a hit has no geom to move with."""
    eye = optics.Eye(resolution=(1, 2), fov_deg=90)
    moment = SimpleNamespace(geom_xpos=np.zeros((1, 1, 3)), geom_xmat=np.tile(np.eye(3), (1, 1, 1, 1)))
    frames = (np.zeros((1, 1, 3)), np.eye(3).reshape(1, 1, 3, 3))
    ids, depth = np.array([[[[0, -1]]]]), np.array([[[[2.0, np.inf]]]])
    found = flow_between(eye, depth, ids, (moment, moment), (frames, frames))
    np.testing.assert_allclose(found[0, 0, :, 0], [[0, np.nan], [0, np.nan]], atol=1e-6)


def test_flow_in_receptors_that_are_not_square():
    """A point at the depth 2 m moves by 0.4 m to the right and 0.6 m up, in receptors of the tangents 1 x 1.732."""
    eye = optics.Eye(resolution=(2, 2), fov_deg=90, vertical_fov_deg=120)
    turns = np.tile(np.eye(3), (1, 1, 1, 1))
    moments = tuple(SimpleNamespace(geom_xpos=np.array([[at]]), geom_xmat=turns) for at in ([0.0, 0, 0], [0.4, 0.6, 0]))
    frames = (np.zeros((1, 1, 3)), np.eye(3).reshape(1, 1, 3, 3))
    found = flow_between(eye, np.full((1, 1, 2, 2), 2.0), np.zeros((1, 1, 2, 2), int), moments, (frames, frames))
    np.testing.assert_allclose(found[0, 0, 0], np.full((2, 2), 0.2), rtol=1e-5)
    np.testing.assert_allclose(found[0, 0, 1], np.full((2, 2), -0.3 / math.sqrt(3)), rtol=1e-5)


def test_areas_of_views(monkeypatch):
    """Each area has the ray and the axis of its view's eye, and the bodies of its view."""
    eyes = sim.Eyes(n_eyes=2, resolution=(1, 2), placement_range_deg=90)
    views = RandomViews(RNG.random((3, 2)), RNG.random(3), RNG.random((3, 1, 3)), np.array([0, 1, 1]))
    directions, asked = RNG.normal(size=(4, 3)), {}
    trials = FidelityTrials.__new__(FidelityTrials)
    trials._eyes = eyes

    class Tracer:
        inputs = "inputs"
        places = 0

        def border_faces(self, area, inputs):
            return "faces" if (area, inputs) == ("area", "inputs") else None

        def radiance(self, area, faces, state, depth):
            asked["bodies"] = [np.array([b.x, b.y, b.z]) for b in state.bodies]
            asked["world"] = state.world.numpy().tolist()
            assert (area, faces, depth) == ("area", "faces", "depth")
            return [mi.Float(1.0), mi.Float(2.0)]

    def from_extent(ray, axis, extent):
        asked["origin"], asked["way"], asked["axis"] = (np.array(part) for part in (ray.o, ray.d, axis))
        asked["extent"] = [float(side[0]) for side in extent]
        return "area"

    trials._scene = SimpleNamespace(
        areas=lambda light: Tracer() if light == "light" else None, variant=default_variant()
    )
    monkeypatch.setattr(fidelity_trials, "Area", SimpleNamespace(from_extent=from_extent))
    trial = SimpleNamespace(directions=directions, extent=(0.5, 0.25))
    with variant(default_variant()):
        found = trials._see_areas(views, trial, "light", "depth")
    assert [one.tolist() for one in found] == [[1.0], [2.0]]
    angle = views.heading + eyes.azimuths()[views.eye]
    axis = np.repeat([np.cos(angle), np.sin(angle)], 4, axis=1)
    np.testing.assert_allclose(asked["axis"], axis, atol=1e-5)
    origins, ways = views.in_agents(eyes, directions)
    np.testing.assert_allclose(asked["origin"], np.repeat(origins, 4, axis=0).T, rtol=1e-5)
    np.testing.assert_allclose(asked["way"], ways.reshape(12, 3).T, rtol=1e-5)
    np.testing.assert_allclose(
        asked["origin"][:2] - BODY_RADIUS * axis, np.repeat(views.position, 4, axis=0).T, atol=1e-5
    )
    assert asked["extent"] == [0.5, 0.25]
    assert asked["world"] == [0] * 4 + [1] * 4 + [2] * 4
    for body, centre in zip(asked["bodies"], (views.objects[:, 0], views.agents), strict=True):
        np.testing.assert_allclose(body, np.repeat(centre, 4, axis=0).T, rtol=1e-6)
