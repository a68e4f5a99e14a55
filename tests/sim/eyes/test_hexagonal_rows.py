"""Hexagonal lattices in rows: distances, order, acute zone, and the compound eyes that have them."""

import numpy as np
import pytest

import optics
import sim
from sim.eyes.hexagonal_rows import lattice_fovy_deg

FACET = optics.Ommatidium(optics.FacetLens(16e-6, 12e-6), optics.Waveguide(1.9e-6))


def angles(directions):
    """Return azimuth and elevation [degrees] of directions."""
    ahead, left, up = np.moveaxis(directions, -1, 0)
    return np.degrees(np.arctan2(left, ahead)), np.degrees(np.arcsin(up))


def test_neighbours_form_regular_hexagons():
    """Each inner ommatidium has six neighbours, at Δφ times the cosine of the elevation."""
    rows, columns, spacing = 15, 20, 4.0
    lattice = sim.hexagonal_rows(rows, columns, columns * spacing)
    assert np.linalg.norm(lattice, axis=1) == pytest.approx(1)
    apart = np.degrees(np.arccos(np.clip(lattice @ lattice.T, -1, 1)))
    inner = np.arange(rows * columns).reshape(rows, columns)[1:-1, 1:-1].ravel()
    nearest = np.sort(apart[inner], axis=1)[:, 1:8]
    expected = spacing * np.cos(np.radians(angles(lattice)[1][inner]))[:, None]
    assert np.abs(nearest[:, :6] / expected - 1).max() < 0.03
    assert (nearest[:, 6] > 1.6 * expected[:, 0]).all(), "the next are √3 times as far away"


def test_rows_run_from_the_top_and_from_the_left():
    azimuth, elevation = (a.reshape(3, 4) for a in angles(sim.hexagonal_rows(3, 4, 40.0)))
    assert (np.diff(elevation[:, 0]) < 0).all()
    assert np.diff(azimuth) == pytest.approx(-10.0)
    assert azimuth[0, 0] - azimuth[1, 0] == pytest.approx(5.0), "rows are shifted by half the distance"
    assert elevation[1] == pytest.approx(0)
    assert azimuth[1] + azimuth[0][::-1] == pytest.approx(0), "the lattice is centred"
    assert angles(sim.hexagonal_rows(1, 3, 30.0))[0] == pytest.approx([10, 0, -10])


def test_an_acute_zone_is_denser_in_the_middle():
    """The azimuth α/a + (1 - 1/a) α³ has the slope 1/a in the middle and 3 - 2/a at the edge."""
    steps = -np.diff(angles(sim.hexagonal_rows(1, 101, 101.0, 2.0))[0])
    assert steps[50] == pytest.approx(0.5, rel=0.01)
    assert steps[0] == pytest.approx(2.0, rel=0.05)
    assert steps.sum() == pytest.approx(100, abs=2), "the field of view remains"


def test_vertical_field_contains_all_rows():
    rows = angles(sim.hexagonal_rows(9, 12, 90.0))[1]
    assert lattice_fovy_deg(9, 12, 90.0) > np.ptp(rows)
    assert lattice_fovy_deg(1, 100, 100.0) == pytest.approx(np.sqrt(3) / 2, rel=1e-3)
    assert 160 < lattice_fovy_deg(6, 1, 60.0) < 180, "Mercator's projection ends at the pole"


def test_a_compound_eye_in_rows_has_their_shape():
    directions = sim.hexagonal_rows(3, 4, 60.0)
    budget = optics.PhotonBudget(10.0)
    types = np.arange(12).reshape(12, 1) % 3
    eye = sim.CompoundEye(directions, FACET, types=types, photon_budget=budget, rows=3)
    assert eye.resolution == (3, 4)
    assert eye.mosaic.tolist() == types.reshape(1, 3, 4).tolist()
    assert eye.receptor_photons.shape == (1, 3, 4)
    assert eye.receptor_photons.ravel() == pytest.approx(eye.photons.ravel())
    signals = np.arange(24.0).reshape(2, 1, 3, 4)  # (eye, channel, row, column)
    assert eye.as_frames(signals).ravel().tolist() == list(range(24))
    assert eye.with_mirror_image().resolution == (1, 24)
    with pytest.raises(ValueError, match="rows = 5: must divide the number of ommatidia, 12"):
        sim.CompoundEye(directions, FACET, rows=5)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ((0, 4, 40.0), "rows = 0"),
        ((2, 4.5, 40.0), "columns = 4.5"),
        ((2, 4, 361.0), "fov_deg = 361"),
        ((2, 4, 0.0), "fov_deg = 0"),
        ((2, 4, 40.0, 0.5), "acute_zone = 0.5"),
    ],
)
def test_bad_arguments_are_named(given, message):
    with pytest.raises(ValueError, match=message):
        sim.hexagonal_rows(*given)


@pytest.mark.parametrize("fov_deg", [0, -1.0, 361])
def test_the_largest_field_is_named(fov_deg):
    with pytest.raises(ValueError, match=r"fov_deg = .*: must be greater than 0 and at most 360, in degrees"):
        sim.hexagonal_rows(3, 4, fov_deg)
