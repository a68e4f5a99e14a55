"""Windows, cells and integrals of a waveguide's receptive field, from given numbers."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from optics.eye import guided_field
from optics.eye.guided_field import MARGIN, Guide, _Cells, _grid_around
from optics.numerics.accuracy import AccuracyError


@pytest.mark.parametrize(("w", "radii"), [(6.0, 1.5), (2.0, 2.5), (1.0, 4.0), (0.5, 4.0)])
def test_radius_of_a_mode_with_its_evanescent_field(w, radii):
    """The field decays over 1/w of the radius. Three decay lengths are included, but at most three radii."""
    modes = SimpleNamespace(radius=2.0, w=w), SimpleNamespace(radius=9.0, w=9.0)
    waveguide = SimpleNamespace(modes=lambda wavelength: modes if wavelength == 5e-7 else ())
    assert guided_field._radius(waveguide, SimpleNamespace(wavelength=5e-7)) == 2 * radii
    with pytest.raises(ValueError, match=r"^waveguide: has no guided mode at 6e-07 m; must be wider"):
        guided_field._radius(waveguide, SimpleNamespace(wavelength=6e-7))


def test_places_in_cells():
    """Four cells of 0.5 around the middle; a polynomial of degree 5 is integrated exactly over each."""
    cells = _Cells(4, 0.5, 0.1, 1e-2)
    edges = np.array([-1, -0.5, 0, 0.5, 1])
    node, weight = cells.places(True)
    assert node.shape[0] == 4
    np.testing.assert_allclose((node**5) @ weight, np.diff(edges**6 / 6))
    middle, side = cells.places(False)
    np.testing.assert_allclose(middle, [[-0.75], [-0.25], [0.25], [0.75]])
    assert side.tolist() == [0.5]
    odd = _Cells(3, 0.5, 0.1, 1e-2).places(False)[0]
    np.testing.assert_allclose(odd, [[-0.5], [0], [0.5]], atol=1e-15)


@pytest.mark.parametrize("cycles", [0.5, 2.0, 5.0])
def test_nodes_in_cells_follow_from_the_highest_frequency(cycles):
    """A pitch of 0.1 at a tolerance of 0.01 belongs to waves of 0.225."""
    node, weight = _Cells(1, cycles * 0.225, 0.1, 1e-2).places(True)
    phase = 0.7
    exact = 0.225 / (2 * math.pi) * 2 * math.sin(math.pi * cycles) * math.cos(phase)
    found = (np.cos(2 * math.pi * node / 0.225 + phase) @ weight).item()
    assert found == pytest.approx(exact, abs=2e-4 * cycles * 0.225)
    assert len(weight) == guided_field.gauss_legendre_count(cycles, 4.0)
    assert _Cells(1, 1.0, 0.1, 1e-2).step == pytest.approx(0.1 * 2.25 / 2.675)


def test_grids_with_margins_for_splines():
    found = _grid_around(np.array([-1.0, 2.0]), np.array([[0.0], [4.0]]), 0.5)
    assert (found.shape, found.dx, found.centre) == ((25, 23), 0.5, (0.5, 2.0))
    assert _grid_around(np.array([0.0, 2.2]), np.array([[0.0], [0.5]]), 0.5).shape == (19, 23)
    many = np.array([0.0, 2039.0])
    for x, y in ((many, many[:1]), (many[:1], many)):
        assert max(_grid_around(x, y, 0.5).shape) == 4095
        with pytest.raises(AccuracyError, match=r"needs 4097 samples .*; the limit is 4096"):
            _grid_around(x * (1 + 1e-6), y * (1 + 1e-6), 0.5)


@pytest.mark.parametrize("from_cell", [False, True])
def test_integrals_of_the_accepted_light_over_cells(monkeypatch, from_cell):
    """The accepted fraction is a Gaussian function of sines. The reference sums over 20 points along a cell's side."""
    asked = {}

    def accepted(sine_x, sine_y):
        return np.exp(-((sine_x - 0.01) ** 2 + 2 * (sine_y + 0.02) ** 2) / (2 * 0.05**2))

    class Modes:
        def power_on(self, sines, taken, digits):
            asked.update(sines=sines, digits=digits)
            np.testing.assert_array_equal(taken, [0.5, 0.25])
            return accepted(sines.x, sines.y[:, None])

        def total(self, taken):
            return float(4 * taken[0])

    def at_pupil(beam, modes, steepest, place, digits):
        asked.update(modes=modes, steepest=steepest, place=place)
        assert digits == pytest.approx(3.5)
        return Modes()

    monkeypatch.setattr(guided_field, "modes_at_pupil", at_pupil)
    waveguide = SimpleNamespace(modes=lambda wavelength: (2, 4), absorbed=lambda mode: 1 / mode)
    middle = 0.3, -0.2
    beam = SimpleNamespace(source=SimpleNamespace(angle=tuple(np.arctan(middle))), wavelength=5e-7)
    rows, columns = _Cells(5, 0.02, 0.006, 1e-2), _Cells(4, 0.03, 0.006, 1e-2)
    spot = SimpleNamespace(centre=(1e-6, 2e-6))
    found, contained = guided_field._accepted(beam, spot, Guide(waveguide, 1.0, 4, from_cell), rows, columns)

    points = 20 if from_cell else 1
    y, x = (
        at + side * ((np.arange(count * points) + 0.5) / points - count / 2)
        for at, side, count in ((middle[1], 0.02, 5), (middle[0], 0.03, 4))
    )
    length, own = np.sqrt(1 + x**2 + y[:, None] ** 2), math.sqrt(1 + 0.3**2 + 0.2**2)
    sine_x, sine_y = x / length - 0.3 / own, y[:, None] / length + 0.2 / own
    exact = accepted(sine_x, sine_y).reshape(5, points, 4, points).mean(axis=(1, 3)) * 0.02 * 0.03
    np.testing.assert_allclose(found, exact, rtol=1e-3)
    sines = asked["sines"]
    assert asked["digits"] == pytest.approx(3.5)
    assert (asked["modes"], asked["place"], sines.dx) == ((2, 4), (1e-6, 2e-6), rows.step)
    if not from_cell:
        assert asked["steepest"] == pytest.approx(math.hypot(abs(sine_x).max(), abs(sine_y).max()))
    inner = accepted(sines.x[MARGIN:-MARGIN], sines.y[MARGIN:-MARGIN, None]).sum() * sines.dx**2
    assert contained == pytest.approx(inner / 2)


@pytest.mark.parametrize(("cells", "rows", "columns"), [(4, 8, 14), (5, 7, 15)])
def test_the_first_window_holds_rays_diffraction_and_the_mode(monkeypatch, cells, rows, columns):
    """Its half width is 0.5 for rays, 0.75 for the mode and 2 · 0.6/(1.5 · 1.6) = 0.5 for diffraction. Cells are 0.5
    high and 0.25 wide.
    """
    asked = []

    def accepted(beam, spot, guide, down, across):
        asked.append((down, across))
        return "found", 1 - 1e-2

    monkeypatch.setattr(guided_field, "_radius", lambda waveguide, beam: 0.75)
    monkeypatch.setattr(guided_field, "_accepted", accepted)
    pupil = SimpleNamespace(radius=1.5, index_before=lambda wavelength: 1.6)
    beam = SimpleNamespace(wavelength=0.6, pupil=pupil)
    spot, retina = SimpleNamespace(half=5.0, half_of_rays=0.5), SimpleNamespace(cell=(0.5, 0.25), tolerance=1e-2)
    assert guided_field._within(beam, spot, 0.1, retina, Guide(None, 2.0, cells)) == "found"
    [(down, across)] = asked
    assert (down.count, across.count) == (rows, columns)
    assert (down.side, across.side, down.pitch, across.pitch) == (0.25, 0.125, 0.05, 0.05)
    assert down.tolerance == across.tolerance == 1e-2
    spot.half_of_rays = 9.0  # the window is at most as wide as all light and the mode, 5.75
    guided_field._within(beam, spot, 0.1, retina, Guide(None, 2.0, cells))
    assert (asked[-1][0].count, asked[-1][1].count) == ((24, 46) if cells == 4 else (23, 47))


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    ("direction", "mirrored", "even"),
    [((0.0, 0.0), (1, 1), True), ((0.1, 0.0), (1, 1), False), ((0.0, 0.0), (1, 0), False)],
)
def test_kernels_of_all_bands_have_one_size(monkeypatch, turned, direction, mirrored, even):
    """Bands are centred in the largest window and rotated by 180°, except on the axis of a symmetric pupil."""
    rng = np.random.default_rng(0)
    given = rng.random((3, 5)), rng.random((5, 3))
    given[0][0, 0] = -1.0
    wavelengths = (4e-7, 6e-7)
    beams = [SimpleNamespace(wavelength=at, number=n) for n, at in enumerate(wavelengths)]
    spot = SimpleNamespace(needs=[SimpleNamespace(pitch=0.1), SimpleNamespace(pitch=0.2)])
    pitches = []

    def within(beam, spot, pitch, retina, guide):
        pitches.append(pitch)
        return given[beam.number]

    def beams_to(pupil, retina, z, tangents):
        assert (z, tangents) == (3.0, tuple(-2 * at for at in direction))
        return beams

    monkeypatch.setattr(guided_field, "beams_to", beams_to)
    monkeypatch.setattr(guided_field, "spot_of", lambda beams, retina: spot)
    monkeypatch.setattr(guided_field, "_within", within)
    pupil = SimpleNamespace(mirror_symmetric=lambda wavelength: mirrored[wavelengths.index(wavelength)])
    retina = SimpleNamespace(
        across_pupil=lambda direction: tuple(-2 * at for at in direction),
        cell=(0.5, 0.25),
        pupil_turned=turned,
        dtype="float64",
    )
    found = guided_field.guided_kernel(pupil, retina, 3.0, direction, Guide(None, 2.0, 4)).numpy()
    expected = np.zeros((2, 5, 5))
    expected[0, 1:4], expected[1, :, 1:4] = given
    expected = np.maximum(expected, 0) * 4 / (0.5 * 4 * 0.25 * 4)
    np.testing.assert_allclose(found, expected if turned or even else expected[:, ::-1, ::-1])
    assert pitches == [0.1, 0.2]
