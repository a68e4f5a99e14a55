"""Fields of view in the image of a world, against an independent computation pixel by pixel."""

import itertools
import math
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import sim
from sim.envs import field_of_view_overlay as overlay
from sim.eyes.eyes import eye_positions
from sim.scene.cameras import Viewpoint

SIZE = 20, 31  # height and width, which differ
EYES = sim.Eyes(n_eyes=2, resolution=(1, 3), fov_deg=70, placement_range_deg=90)
VIEW = Viewpoint.looking_at(np.array([-1.5, -0.4, 0.9]), np.array([1.0, 0.3, 0.5]), 60.0)


def ray(row, column):
    """Return the direction of the ray through a pixel, of unit depth."""
    half = math.tan(math.radians(VIEW.fovy_deg) / 2)
    right, up = (2 * column + 1 - SIZE[1]) / SIZE[0] * half, (SIZE[0] - 2 * row - 1) / SIZE[0] * half
    return VIEW.rotation @ np.array([right, up, -1.0])


def points():
    """Return depth and position of the point at the eyes' height, for each pixel that shows such a point."""
    found = {}
    for row in range(SIZE[0]):
        for column in range(SIZE[1]):
            direction = ray(row, column)
            depth = (overlay.EYE_HEIGHT - VIEW.position[2]) / direction[2]
            if depth > 0:
                found[row * SIZE[1] + column] = depth, VIEW.position + depth * direction
    return found


def test_points_of_the_plane():
    level, expected = overlay._level(VIEW, SIZE), points()
    assert list(level.pixels) == list(expected)
    assert 0 < len(expected) < SIZE[0] * SIZE[1]
    for i, (depth, point) in enumerate(expected.values()):
        assert level.depth[i] == pytest.approx(depth)
        np.testing.assert_allclose(level.points[i], point[:2], rtol=1e-9)
        assert point[2] == pytest.approx(overlay.EYE_HEIGHT)
        up = np.linalg.norm(VIEW.rotation @ np.array([0, 2 * depth / SIZE[0], 0])) * math.tan(math.radians(30))
        assert level.pixel[i] == pytest.approx(up)


def opacity(ahead, left, width, half):
    """Return the opacity of a point in an eye's frame: of the field, of three receptors' directions, or of its edges.

    Receptors are equally wide on the retina. width: size of a pixel at the point [m]
    """
    found = overlay.FILL if abs(math.atan2(left, ahead)) <= half else 0.0
    centres = [math.atan(part * math.tan(half)) for part in (-2 / 3, 0.0, 2 / 3)]
    for ray, strength in [*((ray, overlay.RAY) for ray in centres), (-half, overlay.RIM), (half, overlay.RIM)]:
        across = abs(left * math.cos(ray) - ahead * math.sin(ray)) / width
        if ahead * math.cos(ray) + left * math.sin(ray) > 0:
            found = max(found, strength * min(1.0, max(0.0, overlay.LINE / 2 + 0.5 - across)))
    return found


@pytest.mark.parametrize("azimuth", [0.4, -2.9])
def test_pixels_within_a_field_of_view(azimuth):
    """A pixel is within the field if its point is in front of the eye and not too far from the axis. Lines with soft
    edges show the field's edges and the receptors' directions.
    """
    eye, half = np.array([0.13, -0.21]), math.radians(EYES.fov_deg) / 2
    field = overlay._field(overlay._level(VIEW, SIZE), EYES, azimuth, eye)
    shown = dict(zip(field.pixels.tolist(), range(len(field.pixels)), strict=True))
    rays = np.linspace(-half, half, overlay.FAN)
    inside = 0
    for pixel, (depth, point) in points().items():
        ahead = np.array([math.cos(azimuth), math.sin(azimuth)]) @ (point[:2] - eye)
        left = np.array([-math.sin(azimuth), math.cos(azimuth)]) @ (point[:2] - eye)
        angle, distance = math.atan2(left, ahead), math.hypot(ahead, left)
        if distance > overlay.FARTHEST:
            assert pixel not in shown
            continue
        width = 2 * depth * math.tan(math.radians(VIEW.fovy_deg) / 2) / SIZE[0]
        expected = opacity(ahead, left, width, half)
        assert (field.opacity[shown[pixel]] if pixel in shown else 0) == pytest.approx(expected, abs=1e-5)
        if abs(angle) < half:
            i, inside = shown[pixel], inside + 1
            assert field.distance[i] == pytest.approx(distance, rel=1e-5)
            assert field.depth[i] == pytest.approx(depth, rel=1e-5)
            near = rays[field.ray[i]] + field.share[i] * (rays[1] - rays[0])
            assert near == pytest.approx(angle, abs=1e-5)
    assert inside > 5


def test_visibility_is_interpolated_between_rays():
    reach = np.arange(overlay.FAN) / 10 + 1.0
    rays, share = np.array([0, 3, 3, overlay.FAN - 2]), np.array([0.5, 0.25, 0.25, 1.0], np.float32)
    end = 1.0 + (rays + share) / 10
    distance = (end + np.array([-1e-3, 1e-3, -1e-3, -1e-3])).astype(np.float32)
    field = overlay._Field(np.arange(4), np.ones(4), np.ones(4), distance, rays, share)
    np.testing.assert_array_equal(field.visible(reach), [True, False, True, True])


@pytest.mark.parametrize("task", ["detection", "maze"])
def test_rays_end_at_the_first_surface_except_the_own_body(task):
    """Single rays of MuJoCo are the reference. In the maze, most of them hit walls."""
    model = sim.build_world(task).model
    data = mujoco.MjData(model)
    data.qpos[:2] += 0.1
    mujoco.mj_forward(model, data)
    eye, azimuths = data.qpos[:2] + np.array([0.05, 0.0]), np.linspace(-3, 3, 40)
    groups, hit = np.array([1, 1, 1, 0, 0, 0], np.uint8), np.zeros(1, np.int32)
    expected = []
    for azimuth in azimuths:
        way = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
        origin = np.array([*eye, overlay.EYE_HEIGHT])
        found = mujoco.mj_ray(model, data, origin, way, groups, 1, model.body("agent").id, hit)
        expected.append(found if 0 <= found <= overlay.FARTHEST else overlay.FARTHEST)
    assert np.ptp(expected) > 1
    np.testing.assert_allclose(overlay._reach(azimuths, eye, model, data), expected, rtol=1e-5)


def test_a_fan_covers_a_field_and_directions_of_many_receptors_are_thinned_out():
    fan = overlay._fan(EYES)
    np.testing.assert_allclose(fan[[0, -1]], np.radians([-35, 35]))
    np.testing.assert_allclose(np.diff(fan), np.radians(70) / (overlay.FAN - 1))
    wide = sim.Eyes(n_eyes=1, resolution=(1, 40), fov_deg=90)
    centres = -np.arctan((2 * np.arange(40) + 1 - 40) / 40)
    np.testing.assert_allclose(overlay._receptor_rays(wide), centres[::3])


def test_colours_repeat():
    for eye in range(3 * len(overlay.COLORS)):
        np.testing.assert_array_equal(overlay._color(eye), overlay.COLORS[eye % len(overlay.COLORS)])


def test_colours_are_those_of_okabe_and_ito():
    """Their palette has these colours and black, which are written here as on their page."""
    palette = ["009E73", "E69F00", "56B4E9", "CC79A7", "F0E442", "0072B2", "D55E00"]
    assert ["".join(f"{value:02X}" for value in color) for color in overlay.COLORS] == palette


@pytest.mark.parametrize("n_eyes", [1, 2, 5, 12, 40])
@pytest.mark.parametrize("placement_range_deg", [60.0, 300.0])
def test_eyes_are_as_large_as_their_distances_allow(n_eyes, placement_range_deg):
    eyes = sim.Eyes(n_eyes=n_eyes, resolution=(1, 3), fov_deg=20, placement_range_deg=placement_range_deg)
    places = eye_positions(eyes.azimuths())
    distances = [math.dist(a, b) for a, b in itertools.combinations(places, 2)]
    assert overlay._radius(eyes) == pytest.approx(min([overlay.IRIS, *(distance / 2 for distance in distances)]))


def test_the_own_body_does_not_hide_an_eye():
    """An eye is drawn if the surface in its pixel is at most one body's width in front of it."""
    dot = overlay._Dot(np.arange(3), np.array([1.0, 1.0, 0.5]), np.array([0.0, 1.0, 0.0]), 4.0)
    end = 4.0 - 2 * overlay.BODY_RADIUS
    for depth, drawn in ((end * 1.01, True), (end * 0.99, False)):
        shown = np.full((4, 3), 100, np.uint8)
        overlay._draw_dot(shown, dot, lambda pixels, z=depth: np.full(len(pixels), 1 / z), np.full(3, 200.0))
        expected = [200, 0, 150, 100] if drawn else [100] * 4
        np.testing.assert_array_equal(shown, np.repeat(np.array(expected)[:, None], 3, axis=1))


def test_an_eye_is_a_disc_of_the_right_size_with_a_soft_edge_one_pixel_wide():
    """The opacities are the fractions of pixels that the disc covers, so that they add up to its area."""
    size, radius = (120, 186), 0.12
    eye = VIEW.position - 1.7 * VIEW.rotation[:, 2] + 0.2 * VIEW.rotation[:, 0]
    dot = overlay._dot(eye, VIEW, size, radius)
    pixel = 2 * 1.7 * math.tan(math.radians(VIEW.fovy_deg) / 2) / size[0]
    assert dot.depth == pytest.approx(1.7)
    for opacity, r in ((dot.iris, radius), (dot.pupil, radius * overlay.PUPIL / overlay.IRIS)):
        assert opacity.sum() * pixel**2 == pytest.approx(math.pi * r**2, rel=0.02)
        soft = ((opacity > 0) & (opacity < 1)).sum()
        assert soft == pytest.approx(2 * math.pi * r / pixel, rel=0.35)  # a ring one pixel wide
    row, column = (np.average(at, weights=dot.iris) for at in np.unravel_index(dot.pixels, size))
    assert row == pytest.approx(size[0] / 2 - 0.5, abs=0.05)
    assert column == pytest.approx(size[1] / 2 - 0.5 + 0.2 / pixel, abs=0.05)


def test_visible_pixels_are_mixed_with_the_colour_of_their_eye(monkeypatch):
    """The field has four pixels. The second is hidden from the eye, and the third from the camera, because a surface is
    as near as the plane. Eyes are drawn after the fields.
    """
    eyes = SimpleNamespace(azimuths=lambda: np.array([0.25]), fov_deg=90)
    fields = overlay.FieldsOfView.__new__(overlay.FieldsOfView)
    visible = np.array([True, False, True, True])
    asked = []
    field = SimpleNamespace(
        visible=lambda reach: asked.append(reach) or visible,
        pixels=np.array([0, 1, 3, 5]),
        depth=np.array([2.0, 2.0, 4.0, 8.0]),
        opacity=np.array([0.25, 0.5, 0.5, 0.75]),
    )
    fields.eyes, fields._fields, fields._dots = eyes, [field], ["dot"]
    monkeypatch.setattr(overlay, "_reach", lambda azimuths, eye, *of: (azimuths, eye, of))
    drawn = []
    monkeypatch.setattr(overlay, "_draw_dot", lambda shown, dot, *_: drawn.append((shown.copy(), dot)))
    model = "model"
    qpos = np.array([1.0, 2.0])
    data = SimpleNamespace(joint=lambda name: SimpleNamespace(qpos=[0.5]), qpos=qpos)
    picture = np.full((2, 3, 3), 100, np.uint8)
    nearness = dict(enumerate([0.49, 0.1, 0.1, 0.25, 0.1, 0.1]))
    shown = fields.draw(picture, lambda pixels: np.array([nearness[int(pixel)] for pixel in pixels]), model, data)
    ((azimuths, eye, of),) = asked
    np.testing.assert_allclose(azimuths[[0, -1]], 0.75 + np.radians([-45, 45]))
    np.testing.assert_allclose(eye, [1 + 0.2 * math.cos(0.75), 2 + 0.2 * math.sin(0.75)])
    assert of == (model, data)
    expected = np.full((6, 3), 100.0)
    for pixel, opacity in ((0, 0.25), (5, 0.75)):
        expected[pixel] += opacity * (overlay.COLORS[0] - 100)
    np.testing.assert_array_equal(shown, np.rint(expected).reshape(2, 3, 3))
    np.testing.assert_array_equal(drawn[0][0].reshape(2, 3, 3), shown)
    assert drawn[0][1] == "dot"
    assert (picture == 100).all()
