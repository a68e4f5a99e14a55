"""Rays of eyes, sums of kernels, optic flow and pictures of the reference, from given numbers."""

import math
from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import optics
import sim
from sim.eyes.depth_layers import ONE_PSF
from sim.render import reference_renderer
from sim.render.batched_renderer import in_whole_rays
from sim.render.eye_rays import Counts, FreeEyes, Lane, UprightEyes
from sim.render.fidelity import Fidelity
from sim.render.optic_flow import flow_between, receptor_centres
from sim.render.ray_kernel import RayKernel
from sim.render.reference_renderer import ReferenceRenderer
from sim.scene.device_arrays import counted
from sim.scene.variant import default_variant, variant

RNG = np.random.default_rng(5)
ANGLES = np.array([0.3, -2.0])


def turns(angles):
    cos, sin, zero = np.cos(angles), np.sin(angles), 0 * angles
    rows = [[cos, -sin, zero], [sin, cos, zero], [zero, zero, zero + 1]]
    return np.moveaxis(np.array(rows), -1, 0)


def lanes(worlds, eyes, samples):
    """Return the numbers of world, eye and sample of each lane, and the lanes."""
    world, eye, sample = (part.ravel() for part in np.indices((worlds, eyes, samples)))
    with variant(default_variant()):
        device = [mi.UInt32(part.astype(np.uint32)) for part in (world, eye, sample, world * eyes + eye)]
    return world, eye, sample, Lane(*device)


def test_numbers_of_lanes():
    with variant(default_variant()):
        found = Lane.from_index(counted(24), Counts.from_numbers(4, 3))
        expected = [part.ravel() for part in np.indices((2, 3, 4))]
        for got, right in zip((found.world, found.eye, found.sample), expected, strict=True):
            np.testing.assert_array_equal(got.numpy(), right)
        np.testing.assert_array_equal(found.row.numpy(), np.repeat(np.arange(6), 4))


@pytest.mark.parametrize("radius", [None, 0.2])
def test_rays_of_upright_eyes(radius):
    """The body is turned and moved; the axis of an eye on a round body is its place on it."""
    azimuths = np.array([0.4, -0.9, 2.0])
    rotations = turns(azimuths)
    origins = (radius or 1.0) * rotations[:, :, 0] if radius else RNG.random((3, 3))
    stand = SimpleNamespace(body=4, height=0.25, origins=origins, rotations=rotations, radius=radius)
    ways = RNG.normal(size=(2, 3))
    places, frames = RNG.random((2, 3)), turns(ANGLES)
    with variant(default_variant()):
        eyes = UprightEyes(stand, 2)
        eyes.fill(SimpleNamespace(frames=lambda kind, body: (places, frames) if (kind, body) == ("body", 4) else None))
        world, eye, sample, lane = lanes(2, 3, 2)
        ray = eyes.ray(eyes.array(), eyes.directions(ways), lane, mi.UInt32(2))
        found = [np.array(part).T for part in (ray.ray.o, ray.ray.d, ray.axis, ray.body)]
        cosine = ray.cosine.numpy()
    body = np.column_stack([places[:, :2], [0.25, 0.25]])[world]
    offset = np.einsum("nij,nj->ni", frames[world], origins[eye])
    way = np.einsum("nij,njk,nk->ni", frames[world], rotations[eye], ways[sample])
    axis = offset / radius if radius else np.einsum("nij,nj->ni", frames[world], rotations[eye][:, :, 2])
    for got, right in zip(found, (body + offset, way, axis, body), strict=True):
        np.testing.assert_allclose(got, right, atol=1e-6)
    np.testing.assert_allclose(cosine, ways[sample, 2], rtol=1e-6)


@pytest.mark.parametrize("starts", [None, RNG.random((2, 3))])
def test_rays_of_free_eyes(starts):
    ways, pupils, axes = RNG.normal(size=(2, 3)), RNG.random((2, 3, 3)), RNG.normal(size=(2, 3, 3, 3))

    class Places(list):
        def frames(self, poses):
            return pupils, axes

    with variant(default_variant()):
        eyes = FreeEyes(Places([1, 2, 3]), 2)
        eyes.fill(None)
        world, eye, sample, lane = lanes(2, 3, 2)
        ray = eyes.ray(eyes.array(), eyes.directions(ways, starts), lane, mi.UInt32(2))
        found = [np.array(part).T for part in (ray.ray.o, ray.ray.d, ray.axis, ray.body)]
        cosine = ray.cosine.numpy()
    pupil, frame = pupils[world, eye], axes[world, eye]
    start = pupil if starts is None else pupil + np.einsum("nij,nj->ni", frame, starts[sample])
    for got, right in zip(
        found, (start, np.einsum("nij,nj->ni", frame, ways[sample]), frame[:, :, 2], pupil), strict=True
    ):
        np.testing.assert_allclose(got, right, atol=1e-5)
    np.testing.assert_allclose(cosine, ways[sample, 2], rtol=1e-6)


class Traced:
    """A kernel whose light is given: its components, at a distance of 2 m along the rays."""

    light, inputs = "bounce", "tables"

    def __init__(self, components):
        self.components, self.samples = components, None

    def around(self, scenes, things, tables, world):
        return scenes, things, tables

    def radiance(self, seen, there, samples):
        assert there == ("scenes", "things", "tables")
        self.samples = samples
        return [mi.Float(one) for one in self.components], mi.Float(2.0)


@pytest.mark.parametrize("components", [1, 3, 5])
@pytest.mark.parametrize("count", [1, 2])
def test_light_is_weighted_and_divided_among_layers(components, count):
    """Samples have weights for each component. At a depth of 1 m, the second layer receives half of the light."""
    light, weights = RNG.random((components, 12)).astype(np.float32), RNG.random((3, components))
    depth = SimpleNamespace(count=count, shares=lambda near: [0.75, near / 2])
    with variant(default_variant()):
        tracer = Traced(light)
        eyes = SimpleNamespace(
            directions=lambda ways, origins: None, ray=lambda *_: SimpleNamespace(cosine=mi.Float(0.5))
        )
        kernel = RayKernel(tracer, eyes, 2, 2, ONE_PSF if count == 1 else depth)
        bounces = RNG.random((3, 2))
        inputs = kernel.inputs(np.zeros((3, 3)), bounces, SimpleNamespace(origins=None, weights=weights))
        frame = SimpleNamespace(eyes=None, things="things")
        layers = [one.numpy() for one in kernel.layers("scenes", frame, inputs)]
        sums = kernel.sums("scenes", frame, inputs, 12, 3).numpy()
        each = kernel.sums("scenes", frame, inputs, 12, 1).numpy()
        samples = np.array(tracer.samples).T
    second = np.random.default_rng(3).random((3, 2))
    np.testing.assert_allclose(samples, np.tile(np.concatenate([bounces, second], axis=1), (4, 1)), rtol=1e-6)
    weighted = light * np.tile(weights.T, 4)
    expected = np.concatenate([weighted * share for share in ((1.0,) if count == 1 else (0.75, 0.5))])
    np.testing.assert_allclose(layers, expected, rtol=1e-5)
    np.testing.assert_allclose(each, expected.ravel(), rtol=1e-5)
    np.testing.assert_allclose(sums, expected.reshape(-1, 3).sum(axis=1), rtol=1e-5)
    tracer.light = "direct"
    assert kernel.inputs(np.zeros((3, 3)), bounces).bounces is None


def test_kernels_do_not_divide_numbers_of_lanes():
    """Such divisions are not vectorised, and took a seventh of the time of rendering."""
    eyes = SimpleNamespace(directions=lambda *_: None, ray=lambda *_: SimpleNamespace(cosine=mi.Float(1.0)))
    with variant(default_variant()), dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        kernel = RayKernel(Traced([np.ones(12)]), eyes, 2, 2, ONE_PSF)
        inputs = kernel.inputs(np.zeros((3, 3)), None, SimpleNamespace(origins=None, weights=np.ones((3, 1))))
        dr.kernel_history_clear()
        dr.eval(kernel.layers("scenes", SimpleNamespace(eyes=None, things="things"), inputs))
        (launched,) = dr.kernel_history([dr.KernelType.JIT])
    assert "gather" in launched["ir"].getvalue()
    assert "udiv" not in launched["ir"].getvalue()


PERFECT = sim.Eyes(n_eyes=1, resolution=(2, 2)).eye()
BLURRED = sim.Eyes(n_eyes=1, resolution=(2, 2), optics=optics.Pupil(1e-4)).eye()


@pytest.mark.parametrize(
    ("asked", "samples", "eye", "expected"),
    [
        (2.4, "rays", PERFECT, 2),
        (0.2, "rays", PERFECT, 1),
        (2.6, "rays", PERFECT, 3),
        (2.4, "rays", BLURRED, 2.4),
        (0.2, "areas", BLURRED, 0.2),
        (1.4, "areas", BLURRED, 1),
        (1.0, "areas", BLURRED, 1),
    ],
)
def test_samples_that_are_not_shared_are_whole_numbers(asked, samples, eye, expected):
    assert in_whole_rays(Fidelity(asked, 4, samples=samples), eye).rays_per_receptor == expected


def test_centres_of_receptors():
    eye = SimpleNamespace(resolution=(2, 3))
    expected = [[-1, -0.5], [0, -0.5], [1, -0.5], [-1, 0.5], [0, 0.5], [1, 0.5]]
    np.testing.assert_array_equal(receptor_centres(eye), expected)


def test_flow_of_geoms_and_eyes_that_move():
    """Two worlds with one eye each. A geom moves by one receptor; the eye of the second world moves instead.

    Geom 0 rests. Receptors without a hit, and points behind the eye, have no flow.
    """
    eye = optics.Eye(resolution=(1, 4), fov_deg=90)
    frame = np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]])
    still = np.tile(np.eye(3), (2, 2, 1, 1))
    depth, ids = np.full((2, 1, 1, 4), 2.0), np.array([[[[1, 1, 0, -1]]], [[[0, 0, 0, 0]]]])
    before, after = np.zeros((2, 2, 3)), np.zeros((2, 2, 3))
    after[0, 1, 0] = 1.0  # a receptor is 2 / 4 of the tangent plane's unit, and the depth is 2 m
    moments = tuple(SimpleNamespace(geom_xpos=place, geom_xmat=still) for place in (before, after))
    eyes, later = np.zeros((2, 1, 3)), np.zeros((2, 1, 3))
    later[1, 0, 0] = 0.5
    frames = tuple((places, np.tile(frame, (2, 1, 1, 1))) for places in (eyes, later))
    found = flow_between(eye, depth, ids, moments, frames)
    assert found.shape == (2, 1, 2, 1, 4)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found[0, 0, 0, 0], [1, 1, 0, np.nan], atol=1e-6)
    np.testing.assert_allclose(found[1, 0, 0, 0], [-0.5] * 4, atol=1e-6)
    np.testing.assert_allclose(found[1, 0, 1, 0], 0, atol=1e-6)
    later[1, 0] = 0, 0, 2.0
    assert np.isnan(flow_between(eye, depth, ids, moments, frames)[1]).all()
    later[1, 0] = 0, 0, 1.0
    centres = np.array([-1.5, -0.5, 0.5, 1.5])
    np.testing.assert_allclose(flow_between(eye, depth, ids, moments, frames)[1, 0, 0, 0], centres, atol=1e-5)


def reference(pixels=(2, 3), cells=2, resolution=(3, 4), sides=((5, 5), (2, 7))):
    found = ReferenceRenderer.__new__(ReferenceRenderer)
    found.samples_per_receptor, found._pixels = cells, pixels
    kernels = {k: np.zeros((1, *side)) for k, side in enumerate(sides)}
    found.sight = SimpleNamespace(kernels=kernels)
    found.eye = SimpleNamespace(resolution=resolution, receptor_size=(3e-6, 2e-6), sensor_distance=2e-5)
    found.bands = SimpleNamespace(wavelengths="wavelengths")
    found._integrator, found._spp, found._sampler, found.seed = "path", 7, "independent", 11
    return found


def test_images_of_the_reference_cover_all_kernels():
    """Cells beside the receptors: half of the largest kernel's side, 5 and 7, on both sides."""
    assert reference().shape == (3 * 2 + 2 * 2, 4 * 2 + 2 * 3)


def test_cells_of_the_reference_are_means_over_pixels():
    found = reference()
    height, width = found.shape
    fine = RNG.random((4, height * 2, width * 3))
    asked = []
    found._mirror = SimpleNamespace(render=lambda *arguments: asked.append(arguments) or fine)
    picture = found._picture("view")
    assert asked == [("view", width * 3, height * 2, "path", 7, "wavelengths", 11, "independent")]
    assert picture.shape == (4, height, width)
    for row, column in ((0, 0), (3, 5), (height - 1, width - 1)):
        part = fine[:, 2 * row : 2 * row + 2, 3 * column : 3 * column + 3]
        np.testing.assert_allclose(picture[:, row, column], part.mean(axis=(1, 2)))
    found.pictures = lambda state: np.arange(24.0).reshape(1, 2, 3, 2, 2)
    radiance = found.radiance(None)
    assert radiance.shape == (1, 2, 4, 3)
    np.testing.assert_array_equal(radiance[0, 1, :, 2], [20, 21, 22, 23])


@pytest.mark.parametrize("has_depth", [False, True])
def test_depths_of_the_reference_are_those_of_the_middle_pixels(has_depth):
    found = reference()
    height, width = found.shape
    found._has_depth, found._picture = has_depth, lambda view: f"picture of {view}"
    rows, columns = np.indices((height * 2, width * 3))
    depth = 1000.0 * rows + columns
    found._mirror = SimpleNamespace(render_depth=lambda view, w, h: depth if (w, h) == (width * 3, height * 2) else 0)
    asked = []
    found.eye.see = lambda *arguments, **options: asked.append((arguments, options)) or np.ones(3)
    assert found._signals("view").dtype == np.float32
    ((arguments, options),) = asked
    assert arguments == ("picture of view", 2)
    assert options["sight"] is found.sight
    if has_depth:
        expected = 1000.0 * (2 * np.arange(height)[:, None] + 1) + 3 * np.arange(width) + 1
        np.testing.assert_array_equal(options["z"], expected)
    else:
        assert options["z"] == math.inf


def test_views_of_the_reference(monkeypatch):
    """The height of an image, in receptors' heights, defines the field of view."""
    found, calls = reference(), []
    found.world, found._data = "world", "data"
    found.eyes = sim.Eyes(n_eyes=2, resolution=(1, 3), placement_range_deg=90)
    found._mirror = SimpleNamespace(sync=lambda data: calls.append(("sync", data)))
    monkeypatch.setattr(reference_renderer, "pose", lambda *arguments: calls.append(arguments))
    state = SimpleNamespace(position=np.array([[9.0, 9], [1.0, 2.0]]), heading=np.array([7.0, 0.5]), n=2)
    views = found._views(state, 1)
    assert calls == [("data", "world", state, 1), ("sync", "data")]
    for view, azimuth in zip(views, found.eyes.azimuths() + 0.5, strict=True):
        ahead = np.array([math.cos(azimuth), math.sin(azimuth), 0])
        np.testing.assert_allclose(-view.rotation[:, 2], ahead, atol=1e-12)
        np.testing.assert_allclose(view.position - 0.2 * ahead, [1, 2, reference_renderer.EYE_HEIGHT], atol=1e-9)
        half = 10 / 2 * 3e-6 / 2
        assert math.tan(math.radians(view.fovy_deg) / 2) == pytest.approx(half / 2e-5)
    found._picture = lambda view: [view.position[0]]
    assert found.pictures(state).shape == (2, 2, 1)
