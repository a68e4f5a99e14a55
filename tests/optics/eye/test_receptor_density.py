"""Receptors of different sizes: their lattice, and signals against the average of a fine eye."""

import math
import pickle
from dataclasses import replace

import drjit as dr
import numpy as np
import pytest

import optics
from optics import Eye, Fovea, VisualStreak
from optics.eye.receptor_lattice import even_lattice, overlaps
from optics.eye.retinal_image import mean_over
from optics.numerics.precision import precision

HALF = math.tan(math.radians(30))
LENS = optics.Pupil(20e-6, thin_lens_focal_length=100e-6 / HALF, wavefront=optics.Zernike({(3, 1): 0.1}))
FIELD = {"fov_deg": 60.0, "noise_sigma": 0.0}


def slope(right, up):
    """A density that is not a product of two functions."""
    return np.exp(right / 20 + up * right / 400)


DENSITIES = [Fovea(8.0), Fovea(10.0, (12.0, -8.0)), VisualStreak(6.0), slope, np.arange(1.0, 13.0).reshape(3, 4)]


def average(image, eye, cells):
    """Return the mean of an image (band, Y, X) over each rectangle of an eye's receptors."""
    (height, width), lattice = eye.resolution, eye.lattice
    down = overlaps((lattice.rows + height / 2) * cells, height * cells)
    found = np.empty((len(image), height, width))
    for row, share in enumerate(down):
        across = overlaps((lattice.columns[row] + width / 2) * cells, width * cells)
        found[:, row] = np.einsum("y,cyx,jx->cj", share, image, across) / share.sum() / across.sum(axis=1)
    return found


@pytest.mark.parametrize("density", DENSITIES)
@pytest.mark.parametrize("resolution", [(5, 7), (1, 4), (6, 1)])
def test_all_receptors_hold_the_same_share_of_the_density(density, resolution):
    """The oracle integrates the density over every rectangle with the midpoint rule."""
    eye = Eye(resolution=resolution, density=density, **FIELD)
    if eye.lattice is None:  # a streak does not vary along a row
        return
    lattice, nodes = eye.lattice, (np.arange(200) + 0.5) / 200
    size = np.array(eye.receptor_size) / float(eye.sensor_distance)
    held = np.empty(resolution)
    for i, j in np.ndindex(*resolution):
        (top, bottom), (left, right) = lattice.rows[i : i + 2], lattice.columns[i, j : j + 2]
        y, x = np.meshgrid(top + nodes * (bottom - top), left + nodes * (right - left), indexing="ij")
        if isinstance(density, np.ndarray):
            cell = [np.floor((at / n + 0.5) * m) for at, n, m in zip((y, x), resolution, density.shape, strict=True)]
            values = density[cell[0].astype(int), cell[1].astype(int)]
        else:
            values = density(np.degrees(np.arctan(x * size[1])), -np.degrees(np.arctan(y * size[0])))
        held[i, j] = values.mean() * lattice.areas[i, j]
    np.testing.assert_allclose(held / held.mean(), 1, atol=0.012)
    assert np.ptp(lattice.areas) > 0.05
    assert lattice.areas.sum() == pytest.approx(math.prod(resolution))


@pytest.mark.parametrize("density", [DENSITIES[1], slope])
def test_signals_are_the_average_of_a_fine_eye(density):
    """A fine eye has one receptor for each cell of the scene. Both eyes receive the same light."""
    cells, rng = 6, np.random.default_rng(0)
    eye = Eye(LENS, (4, 5), bands=2, dtype="float64", density=density, **FIELD)
    fine = Eye(LENS, (4 * cells, 5 * cells), bands=2, dtype="float64", **FIELD)
    scene = rng.random((2, 4 * cells + 8, 5 * cells + 8))
    image, found = fine.see(scene, 1), eye.see(scene, cells)
    np.testing.assert_allclose(found, average(image, eye, cells), rtol=1e-10)
    np.testing.assert_allclose((found * eye.lattice.areas).sum(axis=(1, 2)), image.sum(axis=(1, 2)) / cells**2)
    assert np.abs(found - replace(eye, density=None).see(scene, cells)).max() > 0.02 * eye.white_signal


def test_signals_converge_with_the_square_of_the_cells():
    eye = Eye(None, (4, 4), bands=1, dtype="float64", receptors=(500,), density=Fovea(8.0), **FIELD)

    def error(cells):
        at = (np.arange(4 * cells) + 0.5) / cells - 2
        scenes = 1 + np.sin(2 * at[:, None] + at), np.ones((4 * cells, 4 * cells))
        found, ones = (eye.see(scene[None], cells)[0] for scene in scenes)
        y0, y1 = eye.lattice.rows[:-1, None], eye.lattice.rows[1:, None]
        x0, x1 = eye.lattice.columns[:, :-1], eye.lattice.columns[:, 1:]
        # ∫∫ sin(2y + x) in closed form
        held = sum(s * -np.sin(2 * y + x) / 2 for s, y, x in ((1, y1, x1), (-1, y0, x1), (-1, y1, x0), (1, y0, x0)))
        return np.abs(found / ones - (1 + held / eye.lattice.areas)).max()

    assert error(4) < 0.2
    assert error(64) < error(16) / 8
    assert error(64) < 2e-3


def test_an_even_density_changes_nothing():
    """The signals are the same bytes. A density that is almost even gives almost the same signals."""
    scene = np.random.default_rng(1).random((4, 30, 30))
    plain = Eye(LENS, (5, 5), **FIELD)
    for density in (np.ones((3, 2)), lambda right, up: np.ones_like(right)):
        eye = replace(plain, density=density)
        assert eye.lattice is None
        assert eye.see(scene, 4).tobytes() == plain.see(scene, 4).tobytes()
    near = replace(plain, density=lambda right, up: 1 + 1e-6 * right)
    np.testing.assert_allclose(near.see(scene, 4), plain.see(scene, 4), rtol=1e-4)
    np.testing.assert_allclose(near.receptor_angles_deg, plain.receptor_angles_deg, rtol=1e-4)


def test_large_receptors_have_less_shot_noise():
    budget = optics.PhotonBudget(10.0)
    eye = Eye(None, (3, 4), photon_budget=budget, density=Fovea(8.0), **FIELD)
    light, rng = np.ones((4, 12, 16)), np.random.default_rng(0)
    clean = eye.see(light, 4)
    noise = np.std([eye.see(light, 4, rng) - clean for _ in range(600)], axis=0)
    expected = np.sqrt(clean / (eye.photons[:, None, None] * eye.lattice.areas))
    np.testing.assert_allclose(noise, expected, rtol=0.13)
    total = Eye(None, (3, 4), photon_budget=budget, **FIELD).receptor_photons.sum() * 12
    assert eye.receptor_photons.sum() == pytest.approx(total)
    tiles = replace(eye, receptors=optics.receptors_of("rgb").arranged(((0, 1), (1, 2))))
    assert tiles.receptor_photons.shape == (1, 3, 4)
    assert tiles.receptor_photons[0, 1, 1] == pytest.approx(eye.photons[2] * eye.lattice.areas[1, 1])


def test_means_carry_derivatives():
    eye = Eye(None, (2, 3), density=slope, **FIELD)
    types = precision("float64")
    image = types.Tensor(np.random.default_rng(0).random((1, 8, 12)))
    dr.enable_grad(image)
    dr.backward(dr.sum(mean_over(eye.lattice, image, types)))
    total = average(np.eye(96).reshape(96, 8, 12), eye, 4).sum(axis=(1, 2))
    np.testing.assert_allclose(dr.grad(image).numpy().ravel(), total, rtol=1e-12)


def test_limits_in_a_direction_are_those_of_its_receptor():
    eye = Eye(LENS, (5, 5), bands=1, density=Fovea(8.0), **FIELD)
    middle, aside = eye.describe(), eye.describe(direction_deg=(20.0, 0.0))
    column = int(np.searchsorted(eye.lattice.columns[2], 2.5 * math.tan(math.radians(20)) / HALF)) - 1
    for found, j in ((middle, 2), (aside, column)):
        width = (eye.lattice.sides * np.array(eye.receptor_size)[:, None, None])[1, 2, j]
        assert found.interommatidial_angle_deg == pytest.approx(math.degrees(width / eye.sensor_distance))
    across, down = middle.interommatidial_range_deg
    angles = eye.receptor_angles_deg
    assert (across, down) == tuple((float(a.min()), float(a.max())) for a in angles[::-1])
    assert across[0] <= angles[1, 2, 2] < across[1] / 2
    assert aside.acceptance_angle_deg > 2 * middle.acceptance_angle_deg
    assert "spacing, horizontal" in str(middle)
    assert middle.sampling_cpd > 2 * aside.sampling_cpd


def test_angles_add_up_to_the_field():
    eye = Eye(resolution=(3, 8), density=VisualStreak(6.0), vertical_fov_deg=40.0, **FIELD)
    for found in (eye, replace(eye, density=None), replace(eye, density=Fovea(5.0))):
        assert found.receptor_angles_deg[1, 1].sum() == pytest.approx(60, rel=0.02)
        right, up = found.receptor_directions_deg
        assert (np.diff(right, axis=1) > 0).all()
        assert (np.diff(up, axis=0) < 0).all()
    heights = eye.lattice.sides[0, :, 0]
    assert heights[1] < 0.5 * heights[0]


@pytest.mark.parametrize("e2", [2.0, 8.0])
def test_acuity_falls_with_eccentricity(e2):
    """Angles between columns and between rows are proportional to 1 + E/E₂. Columns of a streak are evenly spaced."""
    eye = Eye(resolution=(61, 61), density=Fovea(e2), **FIELD)
    down, across = eye.receptor_angles_deg
    right, up = np.abs(eye.receptor_directions_deg)
    np.testing.assert_allclose(across[30] / (1 + right[30] / e2) / across[30, 30], 1, atol=0.04)
    np.testing.assert_allclose(down[:, 30] / (1 + up[:, 30] / e2) / down[30, 30], 1, atol=0.04)
    assert across[30, 30] == pytest.approx(down[30, 30])
    streak = replace(eye, density=VisualStreak(e2, 10.0))
    down, across = streak.receptor_angles_deg
    up = streak.receptor_directions_deg[1, :, 30]
    np.testing.assert_allclose(down[:, 30] / (1 + np.abs(up - 10) / e2) / down[:, 30].min(), 1, atol=0.06)
    np.testing.assert_allclose(across[np.abs(up).argmin()], 60 / 61, rtol=0.01)
    moved = replace(eye, density=Fovea(e2, (12.0, -8.0)))
    angles = moved.receptor_angles_deg
    finest = np.unravel_index(angles.prod(axis=0).argmin(), (61, 61))
    np.testing.assert_allclose(moved.receptor_directions_deg[:, *finest], (12, -8), atol=1)


def test_counting_coordinates_are_inverted():
    lattice = Eye(resolution=(4, 6), density=slope, **FIELD).lattice
    counted = np.random.default_rng(0).uniform([-3, -2], [3, 2], (200, 2))
    np.testing.assert_allclose(lattice.counted(lattice.places(counted)), counted, atol=1e-12)
    corners = lattice.places(np.array([[-3.0, -2.0], [3.0, 2.0], [-3.5, 0.0]]))
    np.testing.assert_allclose(corners[:2], [[-3, -2], [3, 2]])
    assert corners[2, 0] == pytest.approx(-3 - 0.5 * lattice.sides[1, 2, 0])
    pixels = lattice.receptors_at((400, 600))
    assert set(pixels.ravel()) == set(range(24))
    np.testing.assert_allclose(np.bincount(pixels.ravel()) / 1e4, lattice.areas.ravel(), atol=0.03)
    np.testing.assert_array_equal(even_lattice((2, 3)).receptors_at((2, 3)), np.arange(6).reshape(2, 3))


def test_water_does_not_move_receptors_on_the_retina():
    cornea = replace(LENS, object_n=1.0, medium_n=1.33)
    eye = Eye(cornea, (4, 4), density=Fovea(8.0), **FIELD)
    wet = optics.immersed(eye, optics.sea_water(1))
    assert wet.fov_deg < 50
    assert wet.lattice is eye.lattice


def test_eyes_with_a_map_can_be_compared_and_pickled():
    eye = Eye(density=np.arange(1.0, 5.0).reshape(2, 2))
    assert pickle.loads(pickle.dumps(eye)) == eye
    assert eye != Eye(density=np.arange(2.0, 6.0).reshape(2, 2))
    assert "DensityMap(2 x 2)" in repr(eye)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Eye(density="fovea"), "density = 'fovea': must be a function of"),
        (lambda: Eye(density=2.0), r"density = 2.0: must be a function of"),
        (lambda: Eye(density=Fovea), "must be a function of"),
        (lambda: Eye(density=np.ones(3)), r"density has shape \(3,\): must be"),
        (lambda: Eye(density=np.ones((2, 3000))), "with at most 2048 rows and columns"),
        (lambda: Eye(density=np.zeros((2, 2))), "density is 0 at its smallest: must be greater than 0"),
        (lambda: Eye(density=np.full((2, 2), np.nan)), "density holds NaN"),
        (lambda: Eye(density=lambda right, up: right), r"density\(right_deg, up_deg\) is -2.* at its smallest"),
        (lambda: Eye(density=lambda right, up: 1.0), r"has shape \(\): must be that of the angles"),
        (lambda: Eye(density=1 + 1e9 * np.eye(1, 500)), "density makes the narrowest receptor"),
        (lambda: Eye(density=even_lattice((2, 2))), r"density is a lattice of \(2, 2\) receptors: must be of \(15, 15"),
        (lambda: Eye(LENS, density=Fovea(), waveguide=optics.Waveguide(2e-6)), "density and waveguide are given"),
        (lambda: Eye(fov_deg=precision("float32").Float(45.0), density=Fovea()), "fov_deg is a Dr.Jit array"),
        (lambda: Fovea(0.0), "Fovea: e2_deg = 0"),
        (lambda: Fovea(1.0, (90.0, 0.0)), "Fovea: center_deg = 90"),
        (lambda: VisualStreak(math.nan), "VisualStreak: e2_deg = nan"),
        (lambda: VisualStreak(1.0, 90.0), "VisualStreak: elevation_deg = 90"),
        (lambda: Eye().describe(direction_deg=(40.0, 0.0)), r"direction_deg = \(40.0, 0.0\): must lie in the field"),
    ],
)
def test_bad_input_names_itself(make, message):
    with pytest.raises(ValueError, match=message) as raised:
        make()
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("kind", [optics.Fovea, optics.VisualStreak])
def test_limits_of_angles(kind):
    for e2 in (1e-3, 1e3):
        assert kind(e2).e2_deg == e2
    for e2 in (0.99e-3, 1.01e3, math.nan):
        with pytest.raises(ValueError, match=rf"{kind.__name__}: e2_deg = .*: must lie in \[0\.001, 1000\]"):
            kind(e2)
    for elevation in (-80, 80):
        assert optics.VisualStreak(5, elevation).elevation_deg == elevation
    for elevation in (-80.1, 80.1):
        with pytest.raises(ValueError, match="VisualStreak: elevation_deg"):
            optics.VisualStreak(5, elevation)
