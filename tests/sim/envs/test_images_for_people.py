"""Cameras and images for human viewers, with stand-ins for worlds and eyes."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from sim.envs import follow_camera, world_pictures
from sim.envs.follow_camera import WAVELENGTHS, FollowCamera, _behind, _follow, _sampler, check_render_mode
from sim.envs.hexagon_images import _margin, _numbers
from sim.envs.retina_images import hues_of, one_above_another, shares_of, side_by_side
from sim.envs.world_pictures import WorldPictures, _ModelCameras, _overview
from sim.scene.color import encode_srgb


@pytest.mark.parametrize("heading", [0.0, 1.1, -2.5])
def test_a_following_camera_is_behind_and_above_and_looks_ahead(heading):
    """It is 4 m behind and 5 m above the agent, and aimed at the floor 3 m ahead of it."""
    ahead, place = np.array([math.cos(heading), math.sin(heading)]), np.array([0.4, -1.3])
    state = SimpleNamespace(position=np.array([[9.0, 9.0], place]), heading=np.array([7.0, heading]))
    for view in (_behind(place, heading), _follow(state, 1)):
        np.testing.assert_allclose(view.position, [*(place - 4 * ahead), 5])
        gaze = -view.rotation[:, 2]
        np.testing.assert_allclose(gaze, np.array([*(7 * ahead), -5]) / math.hypot(7, 5), atol=1e-12)
        assert view.rotation[2, 0] == pytest.approx(0), "the horizon is level"
        assert view.fovy_deg == 50


def test_samplers_whose_grid_fits():
    fit = [n for n in range(1, 26) if _sampler(n) == "multijitter"]
    assert fit == [1, 2, 3, 4, 6, 8, 9, 12, 15, 16, 20, 24, 25]
    assert {_sampler(n) for n in range(1, 26)} == {"multijitter", "independent"}


@pytest.mark.parametrize("samples", [0, -1, 1.5, True])
def test_bad_numbers_of_samples_are_refused(samples):
    with pytest.raises(ValueError, match=rf"samples = {samples}: must be a whole number, at least 1, or None"):
        FollowCamera(None, samples=samples)


def test_render_modes():
    for mode in ("rgb_array", "eyes", None):
        check_render_mode(mode)
    with pytest.raises(ValueError, match=r"render_mode = 'human': must be one of 'rgb_array', 'eyes' or None"):
        check_render_mode("human")


def test_slow_images():
    """Light brighter than white is white. The wavelengths are 430 to 660 nm."""
    calls = []

    class Scene:
        def sync(self, data):
            calls.append(data)

        def render(self, view, width, height, **options):
            calls.append((view, width, height, options))
            return np.array([0, 1e9])[:, None] * np.ones((8, 2, 3))

        def render_depth(self, view, width, height):
            return np.arange(1.0, 7.0).reshape(2, 3)

    camera = SimpleNamespace(samples=6, _data="data")
    picture, nearness = FollowCamera._slow_image(camera, Scene(), "view", (2, 3))
    assert calls[0] == "data"
    view, width, height, options = calls[1]
    assert (view, width, height) == ("view", 3, 2)
    assert (options["spp"], options["sampler"]) == (6, "multijitter")
    assert (WAVELENGTHS[0], WAVELENGTHS[-1], len(WAVELENGTHS)) == (430e-9, 660e-9, 8)
    assert options["wavelengths"] is WAVELENGTHS
    assert picture.dtype == np.uint8
    assert (picture[0] == 0).all()
    assert (picture[1] == 255).all()
    np.testing.assert_array_equal(nearness(np.array([0, 4])), [1, 1 / 5])


def receptors(*peaks):
    return SimpleNamespace(types=[SimpleNamespace(peak_nm=peak) for peak in peaks])


def test_types_have_colours_by_wavelength():
    red, green, blue, yellow, cyan = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0.5, 0.5, 0), (0, 0.5, 0.5)
    for peaks, expected in (
        ((500,), [(1, 1, 1)]),
        ((430, 560), [blue, red]),
        ((560, 430, 530), [red, blue, green]),
        ((400, 450, 500, 550, 600), [blue, cyan, green, yellow, red]),
    ):
        np.testing.assert_allclose(hues_of(receptors(*peaks)), expected)
    np.testing.assert_allclose(shares_of(np.array([red, blue])), [[1, 0.5, 0], [0, 0.5, 1]])
    np.testing.assert_allclose(shares_of(np.array([yellow, red])), [[1 / 3, 1, 0.5], [2 / 3, 0, 0.5]])


@pytest.mark.parametrize(
    ("eyes", "height", "width", "scale"),
    [
        (1, 1, 1, 240),
        (2, 1, 2, 239),
        (2, 10, 20, 23),
        (3, 5, 4, 48),
        (4, 2, 60, 3),
        (1, 300, 10, 1),
        (1, 2, 2000, 1),
        (1, 241, 1, 1),
    ],
)
def test_images_of_eyes_are_as_large_as_possible(eyes, height, width, scale):
    """An image has at most 240 x 960 pixels, and gaps of 4 pixels between eyes."""
    eye = SimpleNamespace(
        white_signal=2.0, resolution=(height, width), lattice=None, mosaic=None, receptors=receptors(500)
    )
    signals = np.random.default_rng(0).random((eyes, 1, height, width)) * 3
    found = side_by_side(signals, eye)
    assert found.shape == (height * scale, eyes * width * scale + 4 * (eyes - 1), 3)
    linear = encode_srgb(np.minimum(signals / 2, 1))
    for k in range(eyes):
        left = k * (width * scale + 4)
        part = found[::scale, left : left + width * scale : scale, 1]
        np.testing.assert_array_equal(part, np.rint(255 * linear[k, 0]))
        assert (found[:, left + width * scale : left + width * scale + 4] == 200).all()


def test_images_one_above_another_have_the_same_width():
    small, large = np.zeros((2, 3, 3), np.uint8), np.ones((4, 5, 3), np.uint8)
    found = one_above_another([small, large])
    assert found.shape == (2 + 4 + 4, 5, 3)
    assert (found[:2, :3] == 0).all()
    assert (found[:2, 3:] == 200).all()
    assert (found[2:6] == 200).all()
    assert (found[6:] == 1).all()


def test_the_only_ommatidium_has_no_border():
    assert (_margin(np.array([[1.0, 0, 0]]), None, np.zeros((4, 3)), np.zeros(4, int)) == 1).all()


def test_an_overview_shows_the_whole_model():
    view = _overview(SimpleNamespace(stat=SimpleNamespace(center=[1, 2, 3], extent=2.0)))
    np.testing.assert_allclose(view.position, [1 - 1.8, 2 - 3.2, 3 + 2.4])
    gaze = np.array([0.9, 1.6, -1.2])
    np.testing.assert_allclose(-view.rotation[:, 2], gaze / np.linalg.norm(gaze))
    assert view.fovy_deg == 45


def test_images_as_the_mode_selects(monkeypatch):
    animals = SimpleNamespace(learners=["a", "b"], simulation=SimpleNamespace(n=3, task=None))
    monkeypatch.setattr(world_pictures, "_of_all_kinds", lambda senses: [f"{senses} {world}" for world in range(3)])
    monkeypatch.setattr(world_pictures, "_ModelCameras", lambda animals: lambda world: f"world {world}")
    assert WorldPictures(animals, None).taken() == []
    assert WorldPictures(animals, "eyes").taken() == ["a 0", "a 1", "a 2", "b 0", "b 1", "b 2"]
    pictures = WorldPictures(animals, "rgb_array")
    assert pictures.taken() == ["world 0", "world 1", "world 2"]
    camera = pictures._photographer
    pictures.taken()
    assert pictures._photographer is camera, "a camera is built once"


@pytest.mark.parametrize("varied", [False, True])
def test_cameras_are_shared_by_equal_worlds(monkeypatch, varied):
    built = []
    monkeypatch.setattr(world_pictures, "QuickCamera", lambda model, spectra: built.append(model) or len(built))
    models = [
        SimpleNamespace(geom_size=np.array([1.0]), geom_rgba=np.array([0.5]), geom_matid=np.array([k % 2]))
        for k in range(3)
    ]
    if not varied:
        models = models[:1] * 3
    physics = SimpleNamespace(bodies=SimpleNamespace(models=models, varied=varied))
    learner = SimpleNamespace(renderer=SimpleNamespace(spectra=None))
    cameras = _ModelCameras(SimpleNamespace(learners=[learner], simulation=SimpleNamespace(physics=physics)))
    found = [cameras._camera_of(world, physics) for world in (0, 1, 2, 0, 1, 2)]
    assert found == ([1, 2, 3] * 2 if varied else [1] * 6)
    for name in ("geom_size", "geom_rgba", "geom_matid"):
        setattr(models[0], name, getattr(models[0], name) + 1)
        assert cameras._camera_of(0, physics) == len(built)
    assert len(built) == (6 if varied else 4)


@pytest.mark.parametrize("slow", [False, True])
def test_images_of_a_following_camera(monkeypatch, slow):
    """A size is height and width. Fields of view are prepared once for each size."""
    calls, prepared = [], []
    monkeypatch.setattr(follow_camera, "pose", lambda *arguments: calls.append(arguments))
    state = SimpleNamespace(position=np.zeros((3, 2)), heading=np.array([0.0, 0.0, 0.5]))
    picture, nearness = np.zeros((4, 6, 3), np.uint8), object()

    def quick(data, view, width, height):
        calls.append((data, view.fovy_deg, width, height))
        return SimpleNamespace(picture=picture, inverse_distance=nearness)

    class Fields:
        def __init__(self, eyes, view, size):
            prepared.append((eyes, size))
            np.testing.assert_allclose(view.position, [-4, 0, 5])

        def draw(self, *arguments):
            return arguments

    monkeypatch.setattr(follow_camera, "FieldsOfView", Fields)
    camera = FollowCamera.__new__(FollowCamera)
    camera.world, camera._data = SimpleNamespace(model="model"), "data"
    camera.eyes, camera._fields, camera._mirror = None, {}, "mirror" if slow else None
    camera._quick = SimpleNamespace(render=quick)
    camera._slow_image = lambda scene, view, size: calls.append((scene, size)) or (picture, nearness)
    assert camera.picture(state, 2, (4, 6)) is picture
    looked = ("mirror", (4, 6)) if slow else ("data", 50, 6, 4)
    assert calls == [("data", camera.world, state, 2), looked]
    camera.eyes = "eyes"
    for size in ((4, 6), (4, 6), (2, 3)):
        assert camera.picture(state, 2, size) == (picture, nearness, "model", "data")
    assert prepared == [("eyes", (4, 6)), ("eyes", (2, 3))]


class Ommatidia:
    """Seven ommatidia: one ahead, and six around it, above and below the horizon alike."""

    directions = np.array(
        [
            [1.0, 0, 0],
            *([math.cos(0.2), 0.2 * math.cos(k * math.pi / 3), 0.2 * math.sin(k * math.pi / 3)] for k in range(6)),
        ]
    )

    def __len__(self):
        return 7


def test_hexagons_are_in_the_middle_of_their_image():
    """The image of a symmetric pattern is symmetric: each ommatidium and its mirror image have the same pixels."""
    eye = Ommatidia()
    eye.directions = eye.directions / np.linalg.norm(eye.directions, axis=1)[:, None]
    numbers = _numbers.__wrapped__(eye)
    assert set(numbers.ravel()) == set(range(8))
    upside_down, mirrored = np.array([0, 1, 6, 5, 4, 3, 2, 7]), np.array([0, 4, 3, 2, 1, 6, 5, 7])
    np.testing.assert_array_equal(upside_down[numbers[::-1]], numbers)
    assert (mirrored[numbers[:, ::-1]] != numbers).mean() < 5e-3, "its width is rounded to whole pixels"
    left, up = (numbers == 1).nonzero()[1].mean(), (numbers == 2).nonzero()[0].mean()
    assert left < numbers.shape[1] / 2
    assert up < numbers.shape[0] / 2


@pytest.mark.parametrize("samples", [None, 1, 2.0])
def test_good_numbers_of_samples(monkeypatch, samples):
    """Without samples, images are fast; with them, Mitsuba renders a mirror of the model."""
    monkeypatch.setattr(follow_camera.mujoco, "MjData", lambda model: f"data of {model}")
    monkeypatch.setattr(follow_camera, "QuickCamera", lambda model, spectra: ("quick", model, spectra))
    monkeypatch.setattr(follow_camera, "mirror", lambda model, spectra: ("mirror", model, spectra))
    camera = FollowCamera(SimpleNamespace(model="model", spectra="spectra"), samples=samples)
    assert camera._quick == (("quick", "model", "spectra") if samples is None else None)
    assert camera._mirror == (None if samples is None else ("mirror", "model", "spectra"))
