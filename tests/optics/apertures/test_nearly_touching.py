"""Combined apertures whose shapes almost touch or almost coincide keep every shape."""

import math

import numpy as np
import pytest
from scipy.special import j1

from optics import Annulus, Circle, Polygon, difference, intersection, union
from optics.apertures.outline import Outline
from optics.apertures.shapes import Disk, Oblong

LINES, COLUMNS = 600, 1500
ROUGH = 6e-3  # error of an area from LINES x COLUMNS points in a square of side 2: their spacing times the perimeter


def hexagon(centre, radius, rotation_deg):
    corners = centre + radius * np.exp(1j * (np.deg2rad(rotation_deg) + np.arange(6) * np.pi / 3))
    return Polygon(np.column_stack([corners.real, corners.imag]))


def two_hexagons(gap, radius, turn_deg):
    """Return two hexagons with parallel sides that are separated by `gap`; they overlap if it is negative."""
    centre = np.exp(1j * np.deg2rad(turn_deg)) * (radius * math.sqrt(3) / 2 + gap / 2)
    return union(*(hexagon(side * centre, radius, 30 + turn_deg) for side in (-1, 1)))


ARRANGEMENTS = {
    "disks": lambda gap, r, turn: union(Disk(r, (r + gap / 2, 0)), Disk(r, (-r - gap / 2, 0))),
    "ring and its hole": lambda gap, r, turn: difference(Annulus(r), Disk(r - gap)),
    "hexagons": two_hexagons,
    "disks that touch inside": lambda gap, r, turn: intersection(Disk(r), Disk(r + gap, (gap, 0))),
    "rectangles": lambda gap, r, turn: union(
        Oblong(r, 0.2, (r / 2 + gap / 2, 0)), Oblong(r, 0.2, (-r / 2 - gap / 2, gap))
    ),
    "rectangle in a disk": lambda gap, r, turn: difference(Disk(r), Oblong(r - gap, r, (0, gap), turn)),
    "disks cut from a disk": lambda gap, r, turn: difference(
        Disk(0.8), Disk(r), Disk(0.8 - r, (0.8 - (0.8 - r) - gap, 0))
    ),
}


def area_of_points(opening):
    y, x = ((np.arange(n) + 0.5) / n * 2 - 1 for n in (LINES, COLUMNS))
    return 4 * opening.contains(x[None, :], y[:, None]).mean()


@pytest.mark.parametrize("name", ARRANGEMENTS)
@pytest.mark.parametrize("seed", range(6))
def test_no_shape_is_lost(name, seed):
    rng = np.random.default_rng([seed, len(name)])
    for _ in range(4):
        gap = rng.choice([-1, 1]) * 10 ** rng.uniform(-13, -4)
        opening = ARRANGEMENTS[name](gap, rng.uniform(0.2, 0.45), rng.choice([0.0, 15.0, 30.0, rng.uniform(0, 60)]))
        assert opening.area == pytest.approx(area_of_points(opening), abs=ROUGH), gap
        assert opening.nodes(3.0, 6.0).weight.sum() == pytest.approx(opening.area, abs=1e-6), gap


@pytest.mark.parametrize("gap", [1e-12, 1e-10, 1e-9, 1e-8, 1e-7, 1e-5])
def test_areas_are_those_of_closed_forms(gap):
    """The tolerance is the area of the gap. Sides 1e-12 radii apart are a common edge, and sides further apart are two
    edges.
    """
    two = union(Disk(0.4, (0.4 + gap / 2, 0)), Disk(0.4, (-0.4 - gap / 2, 0)))
    assert two.area == pytest.approx(2 * math.pi * 0.4**2, abs=1e-9)
    ring = difference(Annulus(0.3), Disk(0.3 - gap))
    assert ring.area == pytest.approx(math.pi * (1 - 0.3**2), abs=1e-9)
    frame = difference(Circle(), Disk(1 - gap)) if gap > 1e-8 else None
    assert frame is None or frame.area == pytest.approx(math.pi * (1 - (1 - gap) ** 2), rel=1e-6)


def test_the_amplitude_of_two_disks_is_that_of_their_closed_form():
    """A disk of radius r has the Fourier transform r J1(2πqr)/q at the frequency q. Two disks 1e-8 apart interfere."""
    r, gap = 0.4, 1e-8
    two = union(Disk(r, (r + gap / 2, 0)), Disk(r, (-r - gap / 2, 0)))
    q = np.array([[0.3, 0.0], [0.7, 0.4], [-1.3, 2.1], [0.0, 2.5]])
    nodes = two.nodes(8.0, 10.0)
    found = np.exp(-2j * np.pi * (q[:, :1] * nodes.x + q[:, 1:] * nodes.y)) @ nodes.weight
    size = np.hypot(*q.T)
    expected = r * j1(2 * np.pi * size * r) / size * 2 * np.cos(2 * np.pi * q[:, 0] * (r + gap / 2))
    np.testing.assert_allclose(found, expected, atol=1e-8)


def test_sides_tested_too_far_away_are_noticed(monkeypatch):
    """An earlier version tested points at a fixed distance of 1e-7 from a side. They lay beyond the gap, and a disk was
    lost.
    """
    monkeypatch.setattr(Outline, "clearance", lambda self, points, least: np.full(len(points), np.inf))
    with pytest.raises(ValueError, match=r"outline cannot be computed near .*: move one of them"):
        union(Disk(0.4, (0.4 + 5e-9, 0)), Disk(0.4, (-0.4 - 5e-9, 0)))
