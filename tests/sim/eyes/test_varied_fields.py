"""Receptors of different sizes in worlds, against the average of fine images, and against equal receptors."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import convolve1d

import optics
import sim
from optics.eye.receptor_lattice import even_lattice, overlaps
from sim.envs.retina_images import side_by_side
from sim.eyes.receptive_fields import Draw, ReceptiveFields, kernels_of
from sim.eyes.sampling import eye_sampling
from sim.eyes.varied_fields import VariedFields, _mixture
from sim.render.fidelity import AREAS, EDGES, RAYS
from sim.render.receptor_noise import NoiseModel
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation

N, CELLS, WIDER = 6, 20, 2
HALF = math.tan(math.radians(30))
LENS = optics.Pupil(40e-6, thin_lens_focal_length=100e-6 / HALF)
FOVEA, STREAK = optics.Fovea(8.0), optics.VisualStreak(5.0)


def slope(right, up):
    return np.exp(right / 30 + up / 20)


def eyes(density, lens=None, **given):
    return sim.Eyes(**{"n_eyes": 2, "resolution": (N, N), "fov_deg": 60, "optics": lens, "density": density, **given})


@pytest.fixture(scope="module")
def scene():
    """A world, a state, and each eye's radiance (eye, band, Y, X) on fine cells of a field of twice the width."""
    world = sim.build_world("detection", seed=1)
    simulation = Simulation(task_of(world), 1, 1)
    state = simulation.reset()
    simulation.close()
    fine = N * CELLS * WIDER
    wide = eyes(None, resolution=(fine, fine), fov_deg=2 * math.degrees(math.atan(WIDER * HALF)), noise_sigma=0)
    image = sim.BatchedRenderer(world, wide, 1, sim.Fidelity(1, 4)).receptor_radiance(state)
    return world, state, np.moveaxis(image[:, 0], 1, 0)


@pytest.mark.parametrize("lens", [None, LENS], ids=["perfect", "lens"])
@pytest.mark.parametrize("density", [FOVEA, STREAK, slope], ids=["fovea", "streak", "slope"])
def test_signals_converge_to_the_average_of_a_fine_image(scene, lens, density):
    """`Eye.see` is the reference: it is compared with fine eyes in tests/optics/eye/test_receptor_density.py."""
    world, state, image = scene
    given = eyes(density, lens)
    eye = given.eye()
    truth = np.stack([eye.see(one, CELLS) for one in image])

    def error(rays):
        found = sim.BatchedRenderer(world, given, 1, sim.Fidelity(rays, 4)).signals(state)[0]
        return float(np.sqrt(np.mean((found - truth) ** 2)) / eye.throughput)

    coarse, fine = error(1), error(100)
    assert fine < 5e-3  # the truth has square cells
    assert fine < coarse / 5
    equal = replace(given, density=None).eye()
    assert np.abs(truth - np.stack([equal.see(one, CELLS) for one in image])).max() > 0.05 * eye.throughput


def test_rays_follow_the_density():
    """The part of the field that a receptor covers receives the rays of one receptor, whatever its size."""
    for lens in (None, replace(LENS, aperture_radius=90e-6)):
        eye = eyes(FOVEA, lens).eye()
        sensor = eye_sampling(eye).sensor(16)
        across, down = (
            sensor.directions[:, 0] / sensor.directions[:, 2],
            -sensor.directions[:, 1] / sensor.directions[:, 2],
        )
        counted = eye.lattice.counted(np.stack([across, down], axis=-1) * N / (2 * HALF))
        inside = (np.abs(counted) < N / 2).all(axis=1)
        column, row = np.floor(counted[inside] + N / 2).astype(int).T
        held = np.bincount(row * N + column, minlength=N * N)
        np.testing.assert_allclose(held[[14, 15, 20, 21]], 16, atol=0 if lens is None else 6)
        assert len(sensor.directions) == 16 * N * N


def test_fields_of_equal_receptors_are_those_of_the_uniform_table():
    """Rays at the middles of cells have the values of the table of equal receptors."""
    eye, cells = optics.Eye(LENS, (3, 4), 60.0, bands=2), 5
    uniform, lattice = ReceptiveFields.from_eye(eye, cells), even_lattice((3, 4))
    kernels = kernels_of(eye, cells, eye_sampling(eye).depth).astype(np.float64)
    for some in (np.arange(12), np.array([1, 6, 7])):
        mixture = uniform.drawn_for(some).density
        for axis in (0, 1):
            mixture = convolve1d(mixture, (0.25, 0.5, 0.25), axis, mode="constant")
        mixture /= mixture.sum()
        np.testing.assert_allclose(_mixture(kernels, lattice, cells, some), mixture, atol=1e-9 * mixture.max())
    varied = VariedFields(kernels, uniform.density, (3, 4), cells, lattice)
    rows, columns = (index.ravel() for index in np.indices(uniform.density.shape))
    middles = np.stack([columns + 0.5, rows + 0.5], axis=-1)
    draw = Draw((middles - np.array(uniform.density.shape)[::-1] / 2) / cells, rows, columns)
    expected = uniform.values(draw, np.arange(12))
    np.testing.assert_allclose(varied.values(draw, np.arange(12)), expected, atol=1e-12 * expected.max())


def test_values_are_integrals_over_rectangles():
    eye, cells = optics.Eye(LENS, (3, 4), 60.0, bands=1, density=slope), 6
    fields = VariedFields.from_eye(eye, cells)
    row, column, size = 1, 2, fields.field.shape[1:]
    at = np.array([fields.density.shape[0] // 2 + 1, fields.density.shape[1] // 2 + 2])
    ray = Draw((at[None, ::-1] + 0.5 - np.array(fields.density.shape)[::-1] / 2) / cells, at[:1], at[1:])
    down = overlaps((eye.lattice.rows + 1.5) * cells, 3 * cells)[row]
    across = overlaps((eye.lattice.columns[row] + 2) * cells, 4 * cells)[column]
    expected = sum(
        fields.field[0, at[0] - y, at[1] - x] * down[y] * across[x]
        for y, x in np.ndindex(3 * cells, 4 * cells)
        if 0 <= at[0] - y < size[0] and 0 <= at[1] - x < size[1]
    ) / (down.sum() * across.sum())
    assert expected > 0
    assert fields.values(ray, np.array([row * 4 + column]))[0, 0, 0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("lens", [None, LENS], ids=["perfect", "lens"])
def test_the_automatic_choice_takes_rays_within_the_tolerance(scene, lens):
    world, state, _ = scene
    given = eyes(FOVEA, lens, noise_sigma=0.02)
    fidelity = sim.choose_fidelity(world, given)
    assert fidelity.samples == RAYS
    given = replace(given, bands=fidelity.bands)
    found = sim.BatchedRenderer(world, given, 1, fidelity).signals(state)
    truth = sim.BatchedRenderer(world, given, 1, replace(fidelity, rays_per_receptor=400)).signals(state)
    assert np.sqrt(np.mean((found - truth) ** 2)) < fidelity.tolerance


def test_other_samples(scene):
    """Adaptive edge sampling needs a perfect lens. Areas are rectangles of one size."""
    world, state, _ = scene
    at_edges = sim.BatchedRenderer(world, eyes(FOVEA), 1, sim.Fidelity(64, 4, samples=EDGES, tolerance=0.01))
    everywhere = sim.BatchedRenderer(world, eyes(FOVEA), 1, sim.Fidelity(64, 4))
    assert np.sqrt(np.mean((at_edges.signals(state) - everywhere.signals(state)) ** 2)) < 0.01
    with pytest.raises(ValueError, match="samples = 'areas': divides the field into equal rectangles") as raised:
        sim.BatchedRenderer(world, eyes(FOVEA), 1, sim.Fidelity(4, 4, samples=AREAS))
    assert "\n" not in str(raised.value)


def test_depth_and_ids_belong_to_the_middles_of_receptors(scene):
    """A fine eye of equal receptors sees the same geoms and depths there."""
    world, state, _ = scene
    fine = sim.BatchedRenderer(world, eyes(None, resolution=(241, 241)), 1, sim.Fidelity(1, 4))
    varied = sim.BatchedRenderer(world, eyes(FOVEA), 1, sim.Fidelity(1, 4))
    x, y = np.moveaxis(varied.eye.lattice.middles, -1, 0)
    row, column = (np.floor((at / N + 0.5) * 241).astype(int) for at in (y, x))
    same = varied.ids(state) == fine.ids(state)[:, :, row, column]
    assert same.mean() > 0.9
    near, found = fine.depth(state)[:, :, row, column], varied.depth(state)
    hit = same & np.isfinite(near)
    assert np.median(np.abs(found[hit] / near[hit] - 1)) < 0.02


def test_noise_and_images():
    budget = optics.PhotonBudget(1.0)
    eye = eyes(FOVEA, photon_budget=budget).eye()
    np.testing.assert_allclose(NoiseModel.from_eye(eye).photons, eye.receptor_photons, rtol=1e-6)
    assert eye.receptor_photons.shape == (3, N, N)
    signals = np.zeros((1, 3, N, N))
    signals[..., N // 2 :] = 1
    picture = side_by_side(signals, eye)
    bright = picture[:, :, 0] > 128
    assert bright[:, : bright.shape[1] // 2].sum() == 0
    assert bright[:, bright.shape[1] // 2 :].all()
    signals[:] = 0
    signals[:, :, 2, 2] = 1
    share = (side_by_side(signals, eye)[:, :, 0] > 128).mean()
    assert share == pytest.approx(eye.lattice.areas[2, 2] / N**2, rel=0.15)


def test_eyes_name_a_bad_density():
    with pytest.raises(ValueError, match="Eyes: density = 'fovea': must be a function"):
        sim.Eyes(density="fovea")
    assert eyes(np.ones((2, 2))) == eyes(np.ones((2, 2)))
