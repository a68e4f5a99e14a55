"""Viewing directions of ommatidia, and the frames of their facets."""

import math

import numpy as np
import pytest
from scipy.spatial import KDTree

from sim import Mount, hexagonal_patch, whole_head
from sim.eyes.viewing_directions import MOST_OMMATIDIA, facet_frames, unit_directions


def test_angles_and_vectors_describe_the_same_directions():
    degrees = np.array([[90.0, 0.0], [0.0, 90.0], [30.0, -20.0]])
    found = unit_directions("directions", degrees)
    assert found[:2] == pytest.approx(np.array([[0, 1, 0], [0, 0, 1]]), abs=1e-15)
    assert unit_directions("directions", found * (1 + 9e-4)) == pytest.approx(found, abs=1e-15)


def test_facets_are_turned_like_mounts():
    """The frame of a mount's object has the axes ahead, left, up; the frame of an eye right, up, ahead."""
    degrees = np.random.default_rng(0).uniform([-180, -89], [180, 89], (20, 2))
    frames = facet_frames(unit_directions("directions", degrees))
    from_body = np.array([[0, -1, 0], [0, 0, 1], [1, 0, 0]])
    for (azimuth, elevation), frame in zip(degrees.tolist(), frames, strict=True):
        _, expected = Mount("head", azimuth, elevation).local("body")
        assert frame == pytest.approx(from_body @ expected, abs=1e-12)


def test_a_facet_that_looks_straight_up_has_a_frame():
    (frame,) = facet_frames(np.array([[0.0, 0.0, 1.0]]))
    assert frame.T @ frame == pytest.approx(np.eye(3))
    assert frame[:, 2] == pytest.approx([0, 1, 0])


def test_a_hexagonal_patch_has_the_angle_between_neighbours_and_equal_solid_angles():
    patch = hexagonal_patch(15, 4.5, 60.0, 10.0)
    assert len(patch) == 721
    centre = unit_directions("centre", [[60.0, 10.0]])[0]
    distances = np.degrees(np.arccos(np.clip(patch @ centre, -1, 1)))
    assert np.sort(distances)[:7] == pytest.approx([0, *[4.5] * 6], abs=0.01)
    within = np.count_nonzero(distances <= 60)
    assert within * math.sqrt(3) / 2 * math.radians(4.5) ** 2 == pytest.approx(math.pi, rel=0.02)  # 2π (1 - cos 60°)


def test_the_rows_of_a_patch_are_horizontal():
    patch = hexagonal_patch(1, 5.0)
    level = patch[np.abs(patch[:, 2]) < 1e-9]
    assert len(level) == 3
    assert np.degrees(np.arcsin(level[:, 1])) == pytest.approx([5, 0, -5], abs=0.01)


def test_a_whole_head_has_directions_all_around_with_six_neighbours():
    head = whole_head(12.0)
    parts = math.isqrt((len(head) - 2) // 10)
    assert len(head) == 10 * parts**2 + 2
    assert np.linalg.norm(head, axis=1) == pytest.approx(1)
    assert head.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
    near = KDTree(head).query(head, k=7)[0][:, 1:]
    six = near.max(axis=1) < 1.5 * near.min(axis=1)
    assert np.count_nonzero(~six) == 12
    assert math.sqrt(8 * math.pi / math.sqrt(3) / len(head)) <= math.radians(12.0)
    smaller = 10 * (parts - 1) ** 2 + 2
    assert math.sqrt(8 * math.pi / math.sqrt(3) / smaller) > math.radians(12.0)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (np.empty((0, 3)), "no ommatidium: must contain at least one"),
        ([[1.0, 0, 0], [0, 1.01, 0]], r"directions\[1\] has length 1.01: must be a unit vector, within 0.001"),
        ([[0.0, 91.0]], r"directions\[0\]: elevation = 91 degrees: must lie in"),
        ([[np.nan, 0.0]], r"directions\[0\] = \[nan, 0.0\]: must be finite"),
        ([1.0, 0.0, 0.0], r"has shape \(3,\): must be unit vectors"),
        (range(10**7), f"10000000 ommatidia: must be at most {MOST_OMMATIDIA}"),
    ],
)
def test_bad_directions_name_themselves(given, message):
    with pytest.raises(ValueError, match=message):
        unit_directions("directions", given)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: hexagonal_patch(60, 5.0), "interommatidial_deg = 5: must be smaller, 60 rings do not fit"),
        (lambda: hexagonal_patch(2, 5.0, 0.0, 95.0), "elevation_deg"),
        (lambda: whole_head(0.1), r"interommatidial_deg = 0\.1: must lie in \[0\.2302, 180\]"),
        (lambda: whole_head(-1.0), "interommatidial_deg"),
    ],
)
def test_bad_patches_name_themselves(make, message):
    with pytest.raises(ValueError, match=message):
        make()
