"""Maps of compound eyes: the projection, and the ommatidium of every pixel, computed independently."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest

from sim.envs import hexagon_images
from sim.envs.hexagon_images import _margin, _numbers, _palette, _projected, _unprojected, hexagon_map
from sim.scene.color import encode_srgb


def directions(*degrees):
    """Return unit vectors (ahead, left, up) of pairs (azimuth to the left, elevation)."""
    azimuth, elevation = np.radians(np.array(degrees, float)).T
    return np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1
    )


@pytest.mark.parametrize(
    ("azimuth", "elevation", "right", "up"),
    [
        (0, 0, 0, 0),
        (0, 90, 0, math.sqrt(2)),
        (0, -90, 0, -math.sqrt(2)),
        (179.999999, 0, -2 * math.sqrt(2), 0),
        (-179.999999, 0, 2 * math.sqrt(2), 0),
        (90, 0, -2 / math.sqrt(1 + math.sqrt(0.5)), 0),
        (0, 30, 0, 0.5 * math.sqrt(2 / (1 + math.sqrt(0.75)))),
        (
            -120,
            60,
            math.sqrt(2) * math.sqrt(0.75) / math.sqrt(1.25),
            math.sqrt(2) * math.sqrt(0.75) / math.sqrt(1.25),
        ),
    ],
)
def test_points_of_hammers_projection(azimuth, elevation, right, up):
    """The values follow from its formulas by hand (Snyder 1987, page 182, with a radius of 1)."""
    np.testing.assert_allclose(_projected(directions((azimuth, elevation))), [[right, up]], atol=1e-6)


def test_the_projection_is_undone():
    """Points near the edge of the map, which is behind, are included."""
    ways = np.random.default_rng(0).normal(size=(500, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    ways[:5] = directions((0, 0), (179, 0), (-179, 0), (0, 89.9), (30, -89.9))
    back, inside = _unprojected(*_projected(ways).T)
    np.testing.assert_allclose(back, ways, atol=1e-9)
    assert inside.all()


def test_the_projection_keeps_areas():
    """The area of the map of a small square, relative to its area on the sphere, is 1."""
    for azimuth, elevation in ((0, 0), (40, 20), (-150, -50)):
        step = 1e-3
        corner, left, up = _projected(
            directions((azimuth, elevation), (azimuth + step, elevation), (azimuth, elevation + step))
        )
        (a, b), (c, d) = left - corner, up - corner
        area = math.radians(step) ** 2 * math.cos(math.radians(elevation))
        assert abs(a * d - b * c) == pytest.approx(area, rel=1e-3)


def test_the_map_is_an_ellipse():
    """Its semi-axes are 2 sqrt(2) and sqrt(2). Points outside have finite coordinates, too."""
    x, y = np.array([2.82, 2.83, 0, 0, 0, -2.83, 2.1, 1.9, 9]), np.array([0, 0, 1.414, 1.415, -1.414, 0, 1, 1, 9])
    found, inside = _unprojected(x, y)
    assert inside.tolist() == [True, False, True, False, True, False, False, True, False]
    assert np.isfinite(found).all()


def test_margins_fall_from_the_centre_to_the_border():
    """The border between two ommatidia is half way between them."""
    own = np.array([[1.0, 0, 0], [0.8, 0.5, 0.1], [0.9, -0.6, -0.3]])
    number = np.array([0, 0, 1, 2, 0])
    share, second = np.array([0.0, 0.25, 0.4, 0.5, 0.1]), np.array([1, 1, 0, 0, 2])
    ways = own[number] + share[:, None] * (own[second] - own[number])
    asked = []
    tree = SimpleNamespace(query=lambda ways, k: asked.append(k) or (None, second[:, None]))
    np.testing.assert_allclose(_margin(own, tree, ways, number), 1 - 2 * share, atol=1e-12)
    assert asked == [[2]]


class Ommatidia:
    """The directions of a compound eye."""

    def __init__(self, *degrees):
        self.directions = directions(*degrees)

    def __len__(self):
        return len(self.directions)


def expected(eye):
    """Return the ommatidium of each pixel, with all distances computed, and hexagons as documented."""
    own, count = eye.directions, len(eye)
    pairs = np.linalg.norm(own[:, None] - own, axis=2)
    np.fill_diagonal(pairs, np.inf)
    corner = pairs.min(axis=0) / math.sqrt(3) if count > 1 else np.array([0.05])
    places, edge = _projected(own), 2 * corner.max()
    left, bottom = places.min(axis=0) - edge
    right, top = places.max(axis=0) + edge
    scale = min(480 / (top - bottom), 960 / (right - left))
    width, height = round((right - left) * scale), round((top - bottom) * scale)
    x, y = np.meshgrid(left + (np.arange(width) + 0.5) / scale, top - (np.arange(height) + 0.5) / scale)
    ways, inside = _unprojected(x, y)
    distances = np.linalg.norm(ways[..., None, :] - own, axis=3)
    order = np.argsort(distances, axis=2, kind="stable")
    nearest = order[..., 0]
    drawn = inside & (distances.min(axis=2) <= 0.95 * corner[nearest])
    if count > 1:
        first, second = own[nearest], own[order[..., 1]]
        middle, step = (first + second) / 2, second - first
        to_border = ((middle - ways) * step).sum(axis=2) / np.linalg.norm(step, axis=2)
        drawn &= to_border >= 0.07 * np.linalg.norm(step, axis=2) / 2
    return np.where(drawn, nearest, count)


@pytest.mark.parametrize(
    "eye",
    [
        Ommatidia((10, 5)),
        Ommatidia((0, 0), (14, 3)),
        Ommatidia((0, -9), (3, 12)),
        Ommatidia((0, 0), (9, 2), (-4, 11), (-12, -7), (2, -13)),
        Ommatidia((170, 0), (-175, 12), (160, 20)),
    ],
    ids=["one", "wide", "high", "several", "behind"],
)
def test_pixels_show_the_nearest_ommatidium(eye):
    """A map is 480 pixels high or 960 wide, whichever is smaller."""
    numbers, compared = _numbers.__wrapped__(eye), expected(eye)
    assert numbers.shape == compared.shape
    assert (numbers.shape[0] == 480) or (numbers.shape[1] == 960)
    assert (numbers != compared).sum() <= 4, "pixels whose centres are on a border"
    assert set(numbers.ravel()) == set(range(len(eye) + 1))


def test_a_map_is_at_least_one_pixel_high():
    """Pairs of ommatidia lie so close together that their hexagons are smaller than a pixel."""
    assert _numbers.__wrapped__(Ommatidia((-90, 0), (-89.98, 0), (89.98, 0), (90, 0))).shape == (1, 960)


@pytest.mark.parametrize("mounts", [1, 2])
def test_images_have_the_colours_of_signals(monkeypatch, mounts):
    """Two ommatidia have two channels. The gap between the maps of two mounts is 4 pixels wide."""
    palette = np.array([[[1, 0, 0], [0, 0.5, 0]], [[0, 0, 1], [0.5, 0.5, 0.5]]])
    numbers = np.array([[0, 1, 2], [2, 2, 1]])
    monkeypatch.setattr(hexagon_images, "_palette", lambda eye: palette)
    monkeypatch.setattr(hexagon_images, "_numbers", lambda eye: numbers)
    frame = np.array([[0.25, 0.5], [0.125, 0.75], [2.0, -1.0], [0.0, 1.0]])[: 2 * mounts]
    found = hexagon_map(frame, Ommatidia((0, 0), (1, 1)))
    assert (found.dtype, found.shape) == (np.uint8, (2, 3 * mounts + 4 * (mounts - 1), 3))
    linear = [[0.25, 0.25, 0], [0.375, 0.375, 0.5], [1, 0, 0], [0.5, 0.5, 0.5]]
    colours = np.rint(255 * encode_srgb(np.array(linear)))
    for mount, (row, column) in itertools.product(range(mounts), np.ndindex(2, 3)):
        number = numbers[row, column]
        expected_colour = [200] * 3 if number == 2 else colours[2 * mount + number]
        assert found[row, 7 * mount + column].tolist() == list(expected_colour)
    assert (found[:, 3:7] == 200).all()


def test_colours_of_receptor_types():
    """Ommatidia may have receptors of different types. Equal signals of all its receptors give white."""
    kinds = SimpleNamespace(types=[SimpleNamespace(peak_nm=peak) for peak in (560, 430)])

    def palette(channels, types):
        eye = SimpleNamespace(receptors=kinds, channels=channels, types=types, __len__=None)
        return _palette(type("Eye", (), {**vars(eye), "__len__": lambda self: 3})())

    whole = palette(2, None)
    assert whole.shape == (3, 2, 3)
    np.testing.assert_allclose(whole[2], [[1, 0.5, 0], [0, 0.5, 1]])
    np.testing.assert_allclose(palette(1, np.array([[0], [1], [0]]))[:, 0], [[1, 0, 0], [0, 0, 1], [1, 0, 0]])
    mixed = palette(2, np.array([[0, 1], [1, 0], [1, 1]]))
    np.testing.assert_allclose(mixed[1], [[0, 0.5, 1], [1, 0.5, 0]])
    np.testing.assert_allclose(mixed[2], [[0.5, 0.5, 0.5]] * 2)
