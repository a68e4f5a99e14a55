"""Single rays, the reference's settings and prepared scenes, from given parts."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import optics
import sim
from sim.eyes.depth_layers import DepthLayers
from sim.eyes.sampling import BoxSampling
from sim.render import one_ray, prepared_scene, reference_renderer
from sim.render.prepared_scene import PreparedScene
from sim.render.reference_renderer import ReferenceRenderer
from sim.scene.moved_bodies import MovedBodies
from sim.scene.poses import Poses

RNG = np.random.default_rng(9)


@pytest.mark.parametrize("azimuth", [0.0, 2.0])
def test_directions_of_receptors(azimuth):
    """Receptors are even on the tangent plane, with the first one at the top left."""
    eyes = sim.Eyes(n_eyes=1, resolution=(2, 4), fov_deg=90)
    axis, left = (np.array([math.cos(at), math.sin(at), 0]) for at in (azimuth, azimuth + math.pi / 2))
    for row, column in np.ndindex(2, 4):
        expected = axis + (1.5 - column) / 2 * left + np.array([0, 0, 0.5 - row]) / 2
        found = one_ray.receptor_direction(eyes, axis, row, column)
        np.testing.assert_allclose(found, expected / np.linalg.norm(expected), atol=1e-12)


def test_cosines_are_not_negative():
    assert one_ray.cosine([0, 0.6, 0.8], [0, 0, 1]) == pytest.approx(0.8)
    assert one_ray.cosine([0, 0.6, 0.8], [0, 0, -1]) == 0


@pytest.mark.parametrize("valid", [True, False])
def test_radiance_along_a_ray(monkeypatch, valid):
    """Lamps of irradiances 2λ and 3λ at incidences of cos θ = 0.5 and 1; the second one is blocked at 600 nm."""
    monkeypatch.setattr(one_ray, "mi", SimpleNamespace(Spectrum=float, Point2f=float))
    scene = SimpleNamespace()

    class Hit:
        n = np.array([0.0, 0, 1])

        def is_valid(self):
            return valid

        def spawn_ray(self, towards):
            return towards

        def bsdf(self):
            return SimpleNamespace(eval_diffuse_reflectance=lambda hit: [hit.wavelengths / 1000])

    def lamp(scale, towards):
        def sample(hit, at):
            assert at == 0.5
            return SimpleNamespace(d=np.array(towards)), [scale * hit.wavelengths]

        return SimpleNamespace(sample_direction=sample)

    hit = Hit()
    scene.ray_intersect = lambda ray: hit
    scene.emitters = lambda: [lamp(2, [math.sqrt(0.75), 0, 0.5]), lamp(3, [0.0, 0, 1])]
    scene.ray_test = lambda towards: hit.wavelengths == 600 and towards[2] == 1
    found = one_ray.radiance(scene, "ray", np.array([500.0, 600.0]))
    expected = np.array([0.5 * (2 * 500 * 0.5 + 3 * 500), 0.6 * 2 * 600 * 0.5]) / math.pi
    np.testing.assert_allclose(found, expected if valid else [0, 0])


def test_pictures_of_single_rays(monkeypatch):
    """A ray leaves the skin of the agent, whose radius is 0.2, and each band has a weight."""
    eyes, rays = sim.Eyes(n_eyes=2, resolution=(1, 2), bands=3, placement_range_deg=90), []
    world = SimpleNamespace(medium=None, model=sim.build_world("maze").model, spectra="spectra")
    state = SimpleNamespace(position=np.array([[9.0, 9], [1, 2]]), heading=np.array([7.0, 0.5]))
    monkeypatch.setattr(one_ray, "pose", lambda data, *given: rays.append(given))
    monkeypatch.setattr(one_ray, "mirror", lambda model, data, **given: SimpleNamespace(scene=given))

    def radiance(scene, ray, nm):
        assert scene == {"variant": "scalar_spectral", "spectra": "spectra"}
        rays.append((np.array(ray.o), np.array(ray.d)))
        return nm * len(rays)

    monkeypatch.setattr(one_ray, "radiance", radiance)
    found = one_ray.see(world, eyes, state, 1)
    assert rays.pop(0) == (world, state, 1)
    bands = eyes.eye().spectral_bands
    for k, (eye, column) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        azimuth = 0.5 + eyes.azimuths()[eye]
        axis = np.array([math.cos(azimuth), math.sin(azimuth), 0])
        origin, way = rays[k]
        np.testing.assert_allclose(origin - 0.20001 * axis, [1, 2, one_ray.EYE_HEIGHT], atol=1e-6)
        np.testing.assert_allclose(way, one_ray.receptor_direction(eyes, axis, 0, column), atol=1e-6)
        np.testing.assert_allclose(found[eye, :, 0, column], bands.weights @ (1e9 * bands.wavelengths) * (k + 2))
    rays.clear()
    one_ray.see(world, eyes, state)
    assert rays[0] == (world, state, 0)
    for given, name in (
        (sim.Eyes(n_eyes=1, resolution=(1, 2), density=optics.Fovea()), "eyes: their density"),
        (SimpleNamespace(density=None, ommatidium=1), "eyes: their ommatidium"),
    ):
        with pytest.raises(ValueError, match=f"^{name} must be None"):
            one_ray.see(world, given, state)
    with pytest.raises(ValueError, match=r"^world: its medium must be None"):
        one_ray.see(SimpleNamespace(medium=1), eyes, state)


@pytest.mark.parametrize(
    ("optional", "given", "cells"),
    [({}, None, 1), ({"optics": optics.Pupil(1e-5)}, None, 4), ({}, 3, 3), ({"optics": optics.Pupil(1e-5)}, 2, 2)],
)
@pytest.mark.parametrize("depths", [None, (0.5, 3.0)])
def test_settings_of_the_reference(monkeypatch, optional, given, cells, depths):
    eyes, asked, lit = sim.Eyes(n_eyes=1, resolution=(1, 4), **optional), {}, []

    def sight(self, samples, z, layers, light_from):
        asked.update(samples=samples, z=z, layers=layers, light_from=light_from)
        return "sight"

    def in_bands(model, spectra, *rest):
        lit.append(spectra)
        return "in bands", ["a lamp"]

    world = sim.build_world("maze")
    monkeypatch.setattr(optics.Eye, "sight", sight)
    monkeypatch.setattr(reference_renderer, "replace", lambda found, **given: (found, given))
    monkeypatch.setattr(reference_renderer, "lights_in_bands", in_bands)
    monkeypatch.setattr(reference_renderer, "mirror", lambda model, **given: given)
    with pytest.warns(sim.MirrorWarning, match="^a lamp$") as warned:
        found = ReferenceRenderer(
            world,
            eyes,
            "direct",
            7,
            samples_per_receptor=given,
            depths=depths,
            depth_layers=5,
            sampler="multijitter",
            variant="variant",
            seed=11,
        )
    assert warned[0].filename == __file__
    assert found.samples_per_receptor == asked["samples"] == cells
    assert (asked["layers"], asked["light_from"], found.seed) == (5, "centres", 11)
    assert asked["z"] == math.inf if depths is None else asked["z"].tolist() == [0.5, 3]
    assert found.sight == ("sight", {"parallax": 0.0})
    assert found._mirror == {"variant": "variant", "spectra": "in bands"}
    assert lit == [world.spectra]
    assert (found._integrator, found._spp, found._sampler, found._has_depth) == (
        "direct",
        7,
        "multijitter",
        bool(depths),
    )
    assert found.bands is found.eye.spectral_bands


def test_the_reference_has_camera_eyes():
    facet = optics.FacetLens(25e-6, 30e-6)
    eyes = sim.Eyes(n_eyes=1, resolution=(4, 4), ommatidium=optics.Ommatidium(facet, optics.Waveguide(2e-6)))
    with pytest.raises(ValueError, match=r"^eyes: their ommatidium must be None"):
        ReferenceRenderer(sim.build_world("detection"), eyes)


def test_signals_of_the_reference():
    found = ReferenceRenderer.__new__(ReferenceRenderer)
    found._views = lambda state, i: [f"{i}{k}" for k in range(3)]
    found._signals = lambda view: np.full((1, 2, 2), float(view))
    signals = found.signals(SimpleNamespace(n=2))
    assert signals.shape == (2, 3, 1, 2, 2)
    np.testing.assert_array_equal(signals[:, :, 0, 0, 0], [[0, 1, 2], [10, 11, 12]])


def prepared(**given):
    found = PreparedScene.__new__(PreparedScene)
    vars(found).update(given)
    return found


def test_samplings_are_computed_once(monkeypatch):
    """Each number of layers has its own; the tolerance only concerns eyes with a pupil."""
    computed, deep = [], DepthLayers(20.0, 1.0, 3)
    monkeypatch.setattr(
        prepared_scene, "eye_sampling", lambda eye, depth: computed.append((eye, depth)) or SimpleNamespace()
    )
    scene = prepared(eye="eye", _samplings={})
    first = scene.sampling(deep, 0.1)
    assert scene.sampling(deep, 0.2) is first
    scene.sampling(DepthLayers())
    assert computed == [("eye", deep), ("eye", DepthLayers())]
    monkeypatch.setattr(prepared_scene, "FieldSampling", SimpleNamespace)
    monkeypatch.setattr(prepared_scene, "replace", lambda found, **given: (found, given))
    assert scene.sampling(deep, 0.2) == (first, {"tolerance": 0.2})
    assert scene.sampling(deep) == (first, {"tolerance": None})


@pytest.mark.parametrize(
    ("spheres", "upright", "rows"), [((), True, False), (("ball",), True, True), ((), False, False)]
)
def test_areas_have_rows_where_there_are_spheres(monkeypatch, spheres, upright, rows):
    monkeypatch.setattr(prepared_scene, "UprightScene", SimpleNamespace)
    closed = SimpleNamespace(spheres=spheres) if upright else ValueError("none")
    asked = []
    scene = prepared(tracers=SimpleNamespace(upright=closed, areas=lambda light: f"areas in {light}"))
    sampling = SimpleNamespace(
        areas=lambda *given, in_rows: asked.append((given, in_rows)) or "sensor",
        area_trial=lambda *given, in_rows: asked.append((given, in_rows)) or "trial",
        may_share=lambda *given, in_rows: asked.append((given, in_rows)) or True,
    )
    assert scene.area_sensor(sampling, 4) == "sensor"
    assert scene.area_trial(sampling, 4, [1, 2]) == "trial"
    assert scene.may_share(sampling, 0.25) is False
    monkeypatch.setattr(prepared_scene, "FieldSampling", SimpleNamespace)
    assert scene.may_share(sampling, 0.25) is True
    assert asked == [((4,), rows), ((4, [1, 2]), rows), ((0.25,), rows)]
    assert scene.areas("direct") == "areas in direct"
    if upright:
        assert scene.upright is closed
    else:
        with pytest.raises(ValueError, match=r"^none$"):
            _ = scene.upright


def test_eyes_in_the_form_of_their_tracer(monkeypatch):
    monkeypatch.setattr(prepared_scene, "UprightEyes", lambda *given: ("upright", *given))
    monkeypatch.setattr(prepared_scene, "FreeEyes", lambda *given: ("free", *given))
    monkeypatch.setattr(prepared_scene, "ClosedForm", SimpleNamespace)
    monkeypatch.setattr(PreparedScene, "upright", SimpleNamespace(stand="stand"))
    scene = prepared(places="places")
    assert scene.eye_rays(SimpleNamespace(), 3) == ("upright", "stand", 3)
    assert scene.eye_rays("other", 3) == ("free", "places", 3)


def test_warnings_appear_once():
    asked = []
    scene = prepared(_has_warned=False, scene=SimpleNamespace(warn_of_missing=asked.append, variant="variant"))
    scene.warn_once("direct")
    scene.warn_once("bounce")
    assert asked == ["direct"]
    assert scene.variant == "variant"


@pytest.mark.parametrize(
    ("bodies", "sizes", "bad", "reason"),
    [
        (5, None, False, None),
        (5, "sizes", False, None),
        (4, None, False, "poses of another model"),
        (5, None, True, "poses of world 1 are not finite"),
    ],
)
def test_moved_bodies_are_checked(bodies, sizes, bad, reason):
    """Only sizes can differ from the model."""
    compared = []
    poses = MovedBodies.__new__(MovedBodies)
    positions = np.zeros((2, 3, 3))
    positions[1, 2, 0] = np.nan if bad else 0
    for name, value in (
        ("positions", positions),
        ("reference", SimpleNamespace(n_bodies=bodies)),
        ("geom_size", sizes),
    ):
        poses.__dict__[name] = value
    scene = prepared(
        model=SimpleNamespace(nbody=5),
        scene=SimpleNamespace(as_built=SimpleNamespace(refuse_differences=compared.append)),
    )
    if reason is None:
        scene.check_poses(poses, 2)
        assert compared == ([poses] if sizes else [])
    else:
        with pytest.raises(ValueError, match=f"^{reason}$"):
            scene.check_poses(poses, 2)


def test_poses_as_arrays(monkeypatch):
    poses = Poses.__new__(Poses)
    monkeypatch.setattr(Poses, "from_data", classmethod(lambda cls, given: ("from", given)))
    assert prepared().placed(poses) is poses
    assert prepared().placed("data") == ("from", "data")


def test_box_sampling_is_no_field_sampling():
    """Receptors with a perfect lens share no areas."""
    assert prepared().may_share(BoxSampling(sim.Eyes(n_eyes=1, resolution=(1, 2)).eye()), 0.25) is False
