"""Apertures made of several shapes: areas and spectra in closed form, edges that coincide, and bad input."""

import math

import numpy as np
import pytest

from optics import (
    Annulus,
    Circle,
    Combined,
    Disk,
    Oblong,
    Polygon,
    Pupil,
    Rings,
    Slit,
    Spider,
    difference,
    hexagonal_segments,
    intersection,
    psf,
    union,
)
from tests.optics.apertures.test_aperture import at, frequencies, grid_spectrum
from validation.reference.apertures import disk_spectrum, polygon_spectrum

TELESCOPE = difference(Annulus(0.3), Spider(4, 0.04, 20))
OVERLAPPING = union(Disk(0.5, (-0.3, 0.1)), Disk(0.5, (0.3, 0.1)))
BEYOND = intersection(Disk(0.8, (0.5, 0.0)), Polygon.regular(5))
SEGMENTS = hexagonal_segments(2, gap=0.04, without=(0, 5))


def disk_at(radius, centre, fx, fy):
    return radius**2 * disk_spectrum(radius * fx, radius * fy) * np.exp(-2j * np.pi * (fx * centre[0] + fy * centre[1]))


def vane(n):
    """Return the outline of the part of a vane that lies in the ring. Its ends are arcs, approximated by n points
    each.
    """
    ends = []
    for radius, way in ((1.0, 1), (0.3, -1)):
        half = math.asin(0.02 / radius)
        angle = np.linspace(-half, half, n)[::way] + math.radians(20)
        ends.append(radius * np.column_stack([np.cos(angle), np.sin(angle)]))
    return np.concatenate(ends)


def vanes(fx, fy):
    found = 0
    for turn in np.exp(0.5j * np.pi * np.arange(4)):
        corners = (vane(400) @ [1, 1j]) * turn
        found = found + polygon_spectrum(fx, fy, np.column_stack([corners.real, corners.imag]))
    return found


CLOSED = {
    "stop off the axis": (
        difference(Circle(), Disk(0.2, (0.3, -0.4))),
        lambda fx, fy: disk_spectrum(fx, fy) - disk_at(0.2, (0.3, -0.4), fx, fy),
    ),
    "two holes": (
        union(Disk(0.3, (-0.6, 0.0)), Disk(0.25, (0.55, 0.3))),
        lambda fx, fy: disk_at(0.3, (-0.6, 0.0), fx, fy) + disk_at(0.25, (0.55, 0.3), fx, fy),
    ),
    "telescope": (
        TELESCOPE,
        lambda fx, fy: disk_spectrum(fx, fy) - disk_at(0.3, (0, 0), fx, fy) - vanes(fx, fy),
    ),
    "segments": (SEGMENTS, lambda fx, fy: sum(polygon_spectrum(fx, fy, part.vertices) for part in SEGMENTS.shapes)),
    "rings": (
        Rings([0.0, 0.2, 0.5, 0.6, 0.9, 1.0]),
        lambda fx, fy: sum(
            sign * disk_at(r, (0, 0), fx, fy) for r, sign in ((1, 1), (0.9, -1), (0.6, 1), (0.5, -1), (0.2, 1))
        ),
    ),
}


@pytest.mark.parametrize("name", CLOSED)
def test_soft_spectrum_and_nodes_are_the_closed_form(name):
    shape, closed = CLOSED[name]
    ripple, passband = 1e-7, 5.0
    soft = shape.soften(passband, ripple)
    fx, fy = frequencies(1e-3, passband, 30)
    error = grid_spectrum(soft, fx, fy, soft.passband + soft.stopband) - closed(fx, fy)
    assert np.abs(error).max() < ripple * shape.area
    nodes = shape.nodes(passband, 8.0)
    sums = np.exp(-2j * np.pi * (np.outer(fx, nodes.x) + np.outer(fy, nodes.y))) @ nodes.weight
    assert np.abs(sums - closed(fx, fy)).max() < 1e-8 * shape.area
    assert shape.contains(nodes.x, nodes.y).all()


@pytest.mark.parametrize("shape", [OVERLAPPING, BEYOND], ids=["overlapping", "beyond the pupil"])
def test_soft_edge_and_nodes_agree_where_edges_cross(shape):
    """Two independent methods agree: integrals along the edge, and sums over the inside."""
    soft = shape.soften(4.0, 1e-7)
    fx, fy = frequencies(1e-3, 4.0, 30)
    nodes = shape.nodes(4.0, 9.0)
    sums = np.exp(-2j * np.pi * (np.outer(fx, nodes.x) + np.outer(fy, nodes.y))) @ nodes.weight
    error = grid_spectrum(soft, fx, fy, soft.passband + soft.stopband) - sums
    assert np.abs(error).max() < 1e-7


def test_what_overlaps_counts_once():
    """Two disks of radius r at a distance d have 2r² arccos(d/2r) - d/2 √(4r² - d²) in common."""
    r, d = 0.5, 0.6
    common = 2 * r * r * math.acos(d / 2 / r) - d / 2 * math.sqrt(4 * r * r - d * d)
    left, right = OVERLAPPING.shapes
    assert OVERLAPPING.area == pytest.approx(2 * math.pi * r * r - common, abs=1e-12)
    assert intersection(left, right).area == pytest.approx(common, abs=1e-12)
    assert difference(left, right).area == pytest.approx(math.pi * r * r - common, abs=1e-12)
    assert OVERLAPPING.half_widths == pytest.approx((0.8, 0.6))


def test_a_ring_is_a_difference():
    x, y = np.random.default_rng(0).uniform(-1.2, 1.2, (2, 1000))
    ring, made = Annulus(0.35), difference(Circle(), Disk(0.35))
    assert made.area == pytest.approx(ring.area, abs=1e-12)
    softened = [at(shape.soften(5.0, 1e-8), x, y) for shape in (ring, made, Rings([0.35, 1.0]))]
    np.testing.assert_allclose(softened[1], softened[0], atol=1e-8)
    np.testing.assert_allclose(softened[2], softened[0], atol=1e-12)


def test_small_disks_are_softened_from_both_ends():
    """Both ends of the arcs of a stop lie within the reach of the kernel if the stop is smaller than this reach."""
    x, y = np.random.default_rng(1).uniform(-0.4, 0.4, (2, 1000))
    shape, edge = difference(Circle(), Disk(0.07, (0.05, 0.02))), Circle().soften(4.0, 1e-7).edge
    assert edge.reach > 0.14
    whole, stop = at(Circle().soften(4.0, 1e-7), x, y), Rings([0.0, 0.07])._softened(edge)
    expected = whole - at(stop, x - 0.05, y - 0.02)
    np.testing.assert_allclose(at(shape._softened(edge), x, y), expected, atol=1e-7)


def test_segments_without_gaps_are_one_opening():
    """Edges shared by two segments do not count as edges."""
    whole = hexagonal_segments(1)
    assert len(whole.outline.segments) == 18
    assert whole.area == pytest.approx(sum(part.area for part in whole.shapes), rel=1e-12)
    assert max(np.hypot(*whole.outline.segments.reshape(-1, 2).T)) == pytest.approx(1)
    assert len(hexagonal_segments(2, 0.01, without=(0,)).shapes) == 18


def test_an_edge_is_counted_once_where_shapes_share_it():
    square = Slit(1.0, 1.0)
    right = Oblong(0.5, 1.0, (0.25, 0.0))
    assert difference(square, right).area == pytest.approx(0.5)
    assert union(right, Oblong(0.5, 1.0, (-0.25, 0.0))).area == pytest.approx(1.0)
    assert len(union(right, Oblong(0.5, 1.0, (-0.25, 0.0))).outline.segments) <= 6
    assert union(Disk(0.5), Disk(0.5)).area == pytest.approx(math.pi / 4)
    assert union(Disk(2.0)).area == pytest.approx(math.pi)
    turned = Oblong(0.5, 1.0, (0.25, 0.0), rotation_deg=90)
    assert turned.contains(np.array([0.7, 0.25]), np.array([0.0, 0.4])).tolist() == [True, False]


def test_zones_of_a_zone_plate_end_where_paths_are_half_waves_longer():
    plate = Rings.zone_plate(50e-6, 1e-3, 500e-9)
    paths = np.hypot(plate.radii[:-1] * 50e-6, 1e-3) - 1e-3
    np.testing.assert_allclose(paths, 250e-9 * np.arange(len(paths)), atol=1e-15)
    closed = Rings.zone_plate(50e-6, 1e-3, 500e-9, open_centre=False)
    np.testing.assert_allclose(closed.radii[:4], plate.radii[1:5])


def test_segments_are_left_out_whatever_holds_their_numbers():
    areas = {hexagonal_segments(1, without=held).area for held in ((0, 1), [1, 0], np.array([0, 1]), range(2))}
    assert len(areas) == 1 < 2 * areas.pop() / hexagonal_segments(1).area


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: union(), "0 shapes: a union must have 1"),
        (lambda: difference(Circle()), "1 shapes: a difference must have 2"),
        (lambda: difference(Circle(), 0.3), "shape = 0.3"),
        (lambda: difference(Circle(), Disk), "shape = <class .*Disk'>: must be an aperture"),
        (lambda: difference(Disk(0.3), Circle()), "must leave something open"),
        (lambda: union(Disk(0.1, (3.0, 0.0))), "must leave something open"),
        (lambda: Combined("xor", (Circle(),)), "rule = 'xor'"),
        (lambda: Disk(-1), "radius = -1"),
        (lambda: Disk(0.1, (np.nan, 0)), "centre = nan"),
        (lambda: Oblong(0, 1), "width = 0"),
        (lambda: Oblong(1, 1, rotation_deg=math.inf), "rotation_deg = inf"),
        (lambda: Spider(0, 0.1), "vanes = 0"),
        (lambda: Spider(3, 2.0), "width = 2.0"),
        (lambda: Rings([0.1]), "even number of radii"),
        (lambda: Rings([0.3, 0.2]), "must ascend"),
        (lambda: Rings([0.3, 1.2]), "must ascend within"),
        (lambda: Rings.zone_plate(5e-6, 1.0), "zones between"),
        (lambda: hexagonal_segments(13), "rings = 13"),
        (lambda: hexagonal_segments(1, gap=1.0), "gap = 1.0"),
        (lambda: hexagonal_segments(1, without=(7,)), "without = 7"),
        (lambda: hexagonal_segments(0, without=(0,)), "must leave a segment"),
        (lambda: hexagonal_segments(2, without=0), "without = 0: must hold numbers"),
    ],
)
def test_bad_input_names_itself(make, message):
    with pytest.raises(ValueError, match=message):
        make()


# Shapes that touch in a point, or along a tangent: (opening, its area).
TOUCHING = {
    "a strip between tangents": (lambda: intersection(Circle(), Oblong(0.5, 2.0)), 0.989484),
    "two disks": (lambda: union(Disk(0.5, (0.5, 0)), Disk(0.5, (-0.5, 0))), math.pi / 2),
    "four disks": (lambda: union(*(Disk(0.25, (x, 0)) for x in (-0.75, -0.25, 0.25, 0.75))), math.pi / 4),
    "a disk at the rim, taken away": (lambda: difference(Circle(), Disk(0.5, (-0.5, 0))), 0.75 * math.pi),
    "a square around a hole": (lambda: difference(Annulus(0.3), Oblong(0.6, 0.6)), math.pi - 0.36),
    "half of a disk": (lambda: intersection(Circle(), Oblong(1, 2, (0.5, 0))), math.pi / 2),
}


@pytest.mark.parametrize("name", TOUCHING)
def test_shapes_that_touch_are_cut_where_they_touch(name):
    make, area = TOUCHING[name]
    shape = make()
    assert shape.area == pytest.approx(area, rel=1e-5)
    nodes = shape.nodes(3.0, 5.0)
    assert nodes.weight.sum() == pytest.approx(area, rel=1e-4)
    seen = psf(Pupil(10e-6, aperture=shape, thin_lens_focal_length=80e-6), [550e-9], dx=1e-6, shape=(9, 9))
    assert seen.psf[0, 4, 4] == pytest.approx(area * (10e-6 / (550e-9 * 80e-6)) ** 2, rel=0.02)


def test_a_small_hole_within_the_soft_edge_is_a_ring():
    """The angle of an empty arc is not taken for a full turn, so the softened difference equals the softened ring."""
    x, y = np.meshgrid(np.linspace(-1, 1, 101), np.linspace(-1, 1, 101))
    hole, ring = (at(shape.soften(3.0, 1e-5), x, y) for shape in (difference(Circle(), Disk(0.1)), Annulus(0.1)))
    assert np.abs(hole - ring).max() < 1e-5
