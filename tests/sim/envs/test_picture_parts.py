"""Parts of images for people: overlays, cameras and images of eyes, with stand-ins for worlds."""

import math
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import sim
from sim.envs import field_of_view_overlay as overlay
from sim.envs import follow_camera, world_pictures
from sim.envs.follow_camera import FollowCamera
from sim.envs.retina_images import _palette, side_by_side
from sim.envs.world_pictures import _drawn, _Follower, _ModelCameras, _of_all_kinds
from sim.eyes.eyes import EYE_HEIGHT, eye_positions
from sim.physics.mujoco_worlds import MujocoWorlds
from sim.scene.cameras import Viewpoint
from sim.scene.color import encode_srgb
from sim.tasks.built_in import AgentTask

SIZE = 20, 31
EYES = sim.Eyes(n_eyes=3, resolution=(1, 3), fov_deg=70, placement_range_deg=90)
VIEW = Viewpoint.looking_at(np.array([-1.5, -0.4, 0.9]), np.array([1.0, 0.3, 0.5]), 60.0)

# --- fields of view


def test_fields_and_dots_are_prepared_for_every_eye():
    """Fields lie in the horizontal plane through the eyes."""
    fields, level = overlay.FieldsOfView(EYES, VIEW, SIZE), overlay._level(VIEW, SIZE)
    azimuths = EYES.azimuths()
    assert len(fields._fields) == len(fields._dots) == 3
    for azimuth, place, field, dot in zip(azimuths, eye_positions(azimuths), fields._fields, fields._dots, strict=True):
        for one, other in ((field, overlay._field(level, EYES, azimuth, place[:2])),):
            for name, array in vars(one).items():
                np.testing.assert_array_equal(array, getattr(other, name))
        expected = overlay._dot(np.array([*place[:2], place[2] + EYE_HEIGHT]), VIEW, SIZE, overlay._radius(EYES))
        assert dot.depth == pytest.approx(expected.depth)
        np.testing.assert_allclose(dot.iris, expected.iris)
    assert eye_positions(azimuths)[:, 2].tolist() == [0, 0, 0]


def test_only_visible_pixels_of_a_field_are_stored():
    """Pixels beyond the edges of a field belong to its outermost rays."""
    field = overlay._field(overlay._level(VIEW, SIZE), EYES, 0.4, np.array([0.13, -0.21]))
    assert (field.opacity > 0).all()
    assert field.share.min() >= 0
    assert field.share.max() <= 1
    assert (field.ray.min(), field.ray.max()) == (0, 62)


def test_opacities_and_widths_of_lines():
    """Lines are 1.2 pixels wide; a field is drawn up to 30 m, with at most 15 receptors and 64 rays."""
    points = np.array([[10.0, 0], [10.0, 0.05], [30.0, 0], [30.1, 0]])
    level = overlay._Level(np.arange(4), np.ones(4), points, np.full(4, 0.1))
    one = sim.Eyes(n_eyes=1, resolution=(1, 1), fov_deg=70)
    field = overlay._field(level, one, 0.0, np.zeros(2))
    assert field.pixels.tolist() == [0, 1, 2]
    np.testing.assert_allclose(field.opacity, [0.55, 0.55 * (1.2 / 2 + 0.5 - 0.5), 0.55], rtol=1e-4)
    assert field.visible(np.full(64, 30.0)).all(), "the surface itself is visible"
    edge = overlay._Level(
        np.arange(2),
        np.ones(2),
        10 * np.array([[math.cos(a), math.sin(a)] for a in np.radians([35, 20])]),
        np.full(2, 0.1),
    )
    np.testing.assert_allclose(overlay._field(edge, one, 0.0, np.zeros(2)).opacity, [0.95, 0.22], rtol=1e-6)
    counts = [len(overlay._receptor_rays(sim.Eyes(n_eyes=1, resolution=(1, n), fov_deg=70))) for n in (15, 16, 31)]
    assert counts == [15, 8, 11]
    assert len(overlay._fan(one)) == 64
    assert overlay._radius(one) == 0.07
    dot = overlay._dot(np.zeros(3), Viewpoint.looking_at(np.array([-1.0, 0, 0]), np.zeros(3), 20.0), (200, 200), 0.07)
    assert dot.pupil.sum() / dot.iris.sum() == pytest.approx((0.045 / 0.07) ** 2, rel=0.02)


def test_the_plane_is_not_visible_from_within_it_or_beyond_the_horizon():
    """The central row of an image with an odd number of rows looks along the horizon."""
    level_view = np.column_stack([[0, -1.0, 0], [0, 0, 1.0], [-1.0, 0, 0]])  # columns (right, up, back)
    above, within = (Viewpoint(np.array([0, 0, EYE_HEIGHT + h]), level_view, 60.0) for h in (1.0, 0.0))
    assert overlay._level(above, (5, 3)).pixels.tolist() == list(range(9, 15))
    assert overlay._level(within, (5, 3)).pixels.tolist() == []


def test_dots_are_mixed_with_the_image():
    """The pupil is black. An eye as far behind a surface as its body is wide is hidden."""
    dot = overlay._Dot(np.arange(2), np.array([0.5, 1.0]), np.array([0.0, 0.5]), 2.0 + 2 * overlay.BODY_RADIUS)
    for nearness, expected in ((0.4999, [150, 100]), (0.5, [100, 100])):
        shown = np.full((2, 3), 100, np.uint8)
        overlay._draw_dot(shown, dot, lambda pixels, value=nearness: np.full(len(pixels), value), np.full(3, 200.0))
        assert shown[:, 0].tolist() == expected


BOXES = """
<mujoco><worldbody>
  {boxes}
  <body name="agent" pos="0 0 {height}"><freejoint/><geom type="sphere" size=".3" mass="1"/></body>
</worldbody></mujoco>
"""


def test_rays_hit_visible_groups_of_geoms():
    """Boxes of the groups 0 to 5 stand around the agent. MuJoCo shows the first three groups."""
    azimuths = np.radians(np.arange(6) * 60.0)
    box = '<geom type="box" size=".1 .1 2" group="{}" pos="{} {} 0"/>'
    boxes = [box.format(k, 5 * math.cos(a), 5 * math.sin(a)) for k, a in enumerate(azimuths)]
    model = mujoco.MjModel.from_xml_string(BOXES.format(boxes="".join(boxes), height=EYE_HEIGHT))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = overlay._reach(azimuths, np.zeros(2), model, data)
    assert (found[:3] < 5).all()
    assert (found[3:] == 30).all()


# --- a camera behind the agent


def test_slow_images_use_wavelengths_in_nanometres(monkeypatch):
    asked = []
    monkeypatch.setattr(
        follow_camera, "preview", lambda radiance, nm: asked.append(nm) or np.full((2, 3, 3), (-1.0, 0.5, 3.0))
    )
    scene = SimpleNamespace(
        sync=lambda data: None, render=lambda *_, **__: None, render_depth=lambda *_: np.full((2, 3), 4.0)
    )
    camera = SimpleNamespace(samples=4, _data="data")
    picture, nearness = FollowCamera._slow_image(camera, scene, "view", (2, 3))
    np.testing.assert_allclose(asked[0], np.linspace(430, 660, 8))
    assert picture[0, 0].tolist() == [0, np.rint(255 * encode_srgb(0.5)), 255]
    assert nearness(np.array([1])).tolist() == [0.25]


def test_images_are_480_pixels_wide_and_show_the_first_world(monkeypatch):
    posed, sizes = [], []
    monkeypatch.setattr(follow_camera, "pose", lambda *given: posed.append(given[3]))
    camera = FollowCamera.__new__(FollowCamera)
    camera.world, camera.eyes, camera._data, camera._mirror = None, None, None, None
    rendered = SimpleNamespace(picture="picture", inverse_distance=None)
    camera._quick = SimpleNamespace(render=lambda data, view, width, height: sizes.append((width, height)) or rendered)
    state = SimpleNamespace(position=np.zeros((2, 2)), heading=np.zeros(2))
    assert camera.picture(state) == "picture"
    assert (posed, sizes) == ([0], [(480, 360)])


# --- images of worlds


def test_a_built_in_task_has_a_following_camera(monkeypatch):
    """The first of several kinds of eyes is drawn."""
    monkeypatch.setattr(
        world_pictures,
        "FollowCamera",
        lambda world, eyes: SimpleNamespace(picture=lambda state, index: (world, eyes, state, index)),
    )
    task = AgentTask.__new__(AgentTask)
    task.world = "world"
    animals = SimpleNamespace(simulation=SimpleNamespace(task=task, state="state"))
    for eyes, drawn in ((EYES, EYES), (None, None), ({"a": EYES, "b": None}, EYES)):
        task.eyes = eyes
        assert _Follower(animals)(4) == ("world", drawn, "state", 4)
        pictures = world_pictures.WorldPictures(animals, "rgb_array")
        assert isinstance(pictures._made(), _Follower)


@pytest.mark.parametrize("camera", [None, "own"])
def test_a_model_is_drawn_with_the_eyes_of_all_agents(monkeypatch, camera):
    """Edges of fields of view are 0.15 times as long as the model's extent."""
    marked, views = [], []
    monkeypatch.setattr(world_pictures, "with_eyes", lambda *given: marked.append(given) or f"{given[0]}+")
    monkeypatch.setattr(world_pictures, "Poses", SimpleNamespace(from_data=lambda datas: ("poses", *datas)))
    monkeypatch.setattr(world_pictures, "_overview", lambda model: "overview")

    def sight(name):
        renderer = SimpleNamespace(
            eye=SimpleNamespace(fov_deg=len(name)), eye_frames=lambda poses: ([(name, poses), "b"], ["c", "d"])
        )
        return SimpleNamespace(renderer=renderer)

    seeing = [SimpleNamespace(sights={"a": sight("x"), "b": sight("yy")}), SimpleNamespace(sights={"a": sight("zzz")})]
    physics = MujocoWorlds.__new__(MujocoWorlds)
    physics.model, physics.datas = SimpleNamespace(stat=SimpleNamespace(extent=20)), ["first", "second"]
    simulation = SimpleNamespace(physics=physics, task=SimpleNamespace(camera=camera))
    cameras = _ModelCameras(SimpleNamespace(simulation=simulation, seeing=seeing))
    quick = SimpleNamespace(
        picture=lambda *given: views.append(given) or "picture",
        mirror=SimpleNamespace(viewpoint=lambda name: f"view of {name}"),
    )
    cameras._camera_of = lambda world, physics: quick if world == 1 else None
    assert cameras(1) == "picture+++"
    named = camera or "overview"
    assert views == [("second", named, 480, 360)]
    assert [given[0] for given in marked] == ["picture", "picture+", "picture++"]
    poses = ("poses", "second")
    eyes = [((name, poses), "c") for name in ("x", "yy", "zzz")]
    assert [given[1:] for given in marked] == [(f"view of {named}", pair, k + 1, 3.0) for k, pair in enumerate(eyes)]


def test_a_camera_uses_the_spectra_of_the_first_learner(monkeypatch):
    monkeypatch.setattr(world_pictures, "QuickCamera", lambda model, spectra: spectra)
    learners = [SimpleNamespace(renderer=SimpleNamespace(spectra=name)) for name in ("first", "second")]
    model = SimpleNamespace(geom_size=np.zeros(1), geom_rgba=np.zeros(1), geom_matid=np.zeros(1))
    physics = SimpleNamespace(bodies=SimpleNamespace(models=[model], varied=False))
    cameras = _ModelCameras(SimpleNamespace(learners=learners, simulation=SimpleNamespace(physics=physics)))
    assert cameras._camera_of(0, physics) == "first"


def test_images_of_all_kinds_of_eyes(monkeypatch):
    """Each world has an image with a row for each kind."""
    monkeypatch.setattr(world_pictures, "_drawn", lambda frame, eye: np.full((1, 2, 3), frame + eye))

    def sight(frames, eye):
        return SimpleNamespace(memory=SimpleNamespace(newest=frames), renderer=SimpleNamespace(eye=eye))

    senses = SimpleNamespace(sights={"a": sight([1, 2], 10), "b": sight([3, 4], 20)})
    first, second = _of_all_kinds(senses)
    assert [image[[0, -1], 0, 0].tolist() for image in (first, second)] == [[11, 23], [12, 24]]


def test_compound_eyes_are_drawn_as_hexagons(monkeypatch):
    """Channels of motion detectors are not drawn."""

    class Compound(SimpleNamespace):
        def as_frames(self, frame):
            return f"list of {frame}"

    monkeypatch.setattr(world_pictures, "CompoundEye", Compound)
    monkeypatch.setattr(world_pictures, "hexagon_map", lambda frame, eye: (frame, eye))
    monkeypatch.setattr(world_pictures, "side_by_side", lambda frame, eye: frame)
    for rows, shown in ((None, "frame"), (2, "list of frame")):
        eye = Compound(rows=rows)
        assert _drawn("frame", eye) == (shown, eye)
    frame = np.arange(12).reshape(1, 6, 1, 2)
    np.testing.assert_array_equal(_drawn(frame, SimpleNamespace(channels=3)), frame[:, :3])


# --- images of eyes


def kinds(*peaks):
    return SimpleNamespace(types=[SimpleNamespace(peak_nm=peak) for peak in peaks])


def test_receptors_of_uneven_density_have_their_places():
    asked = []
    numbers = np.array([[0, 5, 5], [3, 3, 2]])
    lattice = SimpleNamespace(receptors_at=lambda size: asked.append(size) or numbers)
    eye = SimpleNamespace(white_signal=2.0, resolution=(2, 3), lattice=lattice, mosaic=None, receptors=kinds(500))
    signals = np.linspace(0, 2, 12).reshape(2, 1, 2, 3)
    lattice.receptors_at = lambda size: asked.append(size) or np.resize(numbers, size)
    found = side_by_side(signals, eye)
    assert asked == [(2 * 120, 3 * 120)]
    assert found.shape == (240, 724, 3)
    grey = np.rint(255 * encode_srgb(signals.reshape(2, 6) / 2))
    np.testing.assert_array_equal(found[:, :360, 0], grey[0][np.resize(numbers, (240, 360))])
    np.testing.assert_array_equal(found[:, 364:, 2], grey[1][np.resize(numbers, (240, 360))])


def test_receptors_of_a_mosaic_have_the_colour_of_their_type():
    eye = SimpleNamespace(resolution=(1, 3), mosaic=np.array([[1, 0, 1]]), receptors=kinds(560, 430))
    assert _palette(eye).tolist() == [[[[0, 0, 1], [1, 0, 0], [0, 0, 1]]]]
    eye.mosaic = None
    found = _palette(eye)
    assert found.shape == (2, 1, 3, 3)
    np.testing.assert_allclose(found[:, 0, 2], [[1, 0.5, 0], [0, 0.5, 1]])
