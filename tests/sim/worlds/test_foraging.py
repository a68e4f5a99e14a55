"""Foraging: objects that differ only in their spectra, an eye that distinguishes them, and eyes that cannot."""

import dataclasses

import numpy as np
import pytest

import optics
import sim
from optics.spectra.bands import SpectralBands
from optics.spectra.spectrum import ILLUMINANTS, illuminant
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation
from sim.worlds.foraging import ULTRAVIOLET, petal
from sim.worlds.state import pose
from sim.worlds.world import build_world

EYES = sim.Eyes(n_eyes=2, resolution=(9, 13), fov_deg=60, placement_range_deg=60)
BEES = dataclasses.replace(EYES, receptors="honeybee", bands=8)
NM = np.arange(300.0, 780.5)


@pytest.fixture(scope="module")
def world():
    return build_world("foraging")


def before_the_eyes(world, n=1, swapped=False):
    """Return a state with agents that face the goal and an adversary next to it; `swapped` exchanges the two."""
    state = Simulation(task_of(world), n, 0).reset()
    objects = state.objects.copy()
    objects[:, :, :2] = np.array([[1.6, 0.9], [1.6, -0.9], [4.0, 0.0]])
    if swapped:
        objects[:, [0, 1]] = objects[:, [1, 0]]
    return dataclasses.replace(state, position=np.zeros((n, 2)), heading=np.zeros(n), objects=objects)


def difference(world, eyes):
    """Return the largest change of any noise-free signal when goal and adversary are exchanged, in standard deviations
    of the receptors' noise.
    """
    renderer = sim.BatchedRenderer(world, eyes, 1, sim.Fidelity(4, eyes.bands))
    one, other = (renderer.signals(before_the_eyes(world, swapped=s)) for s in (False, True))
    assert one.max() > 0.05
    return np.abs(one - other).max() / eyes.noise_sigma


def test_spectra_are_smooth_reflectances():
    for share in ULTRAVIOLET.values():
        values = petal(share).at(NM * 1e-9)
        assert values.min() >= 0
        assert values.max() <= 1
        # The curve is a cosine over 50 nm and a logistic of 15 nm, with slopes of at most 0.017 and 0.0125 per nm, and
        # no steps.
        assert np.abs(np.diff(values)).max() < 0.02


@pytest.mark.parametrize("light", ILLUMINANTS)
def test_they_are_metamers_for_rgb_like_receptors(light):
    """Under every light and with any number of bands, the difference is within 1e-3 of white's signal (in fact 0). A
    pigment of 350 nm shows a difference under every light that contains ultraviolet.
    """
    difference = petal(ULTRAVIOLET["goal"]).at(NM * 1e-9) - petal(ULTRAVIOLET["adversary"]).at(NM * 1e-9)
    assert np.abs(difference).max() > 0.5
    for bands in (1, 2, 3, 4, 5, 8, 16, 64):
        eye = SpectralBands.uniform(bands)
        seen = [petal(s).at(eye.wavelengths) * illuminant(light).at(eye.wavelengths) for s in ULTRAVIOLET.values()]
        assert np.abs(eye.weights @ (seen[0] - seen[1])).max() < 1e-3
    pigment = SpectralBands.uniform(16, (350,))
    at = pigment.wavelengths
    seen = [petal(s).at(at) * illuminant(light).at(at) for s in ULTRAVIOLET.values()]
    dark = not illuminant(light).at(np.array([350e-9])).any()
    assert dark or np.abs(pigment.weights @ (seen[0] - seen[1])).max() > 0.02


def test_objects_differ_in_nothing_but_their_spectra(world):
    model = world.model
    goal, *adversaries = (model.geom(name).id for name in world.objects)
    for other in adversaries:
        assert np.array_equal(model.geom_size[other], model.geom_size[goal])
        assert np.array_equal(model.geom_quat[other], model.geom_quat[goal])
        a, b = model.geom_matid[goal], model.geom_matid[other]
        assert np.array_equal(model.mat_texid[a], model.mat_texid[b])
        assert np.array_equal(model.mat_texrepeat[a], model.mat_texrepeat[b])
        np.testing.assert_allclose(model.mat_rgba[a], model.mat_rgba[b], atol=2e-3)  # MuJoCo's viewer shows this colour
    assert world.spectra["goal"] != world.spectra["adversary"]


@pytest.mark.parametrize("pupil", [None, optics.Pupil(60e-6, thin_lens_focal_length=173e-6)], ids=["perfect", "lens"])
def test_an_eye_without_ultraviolet_cannot_tell_them_apart_and_one_with_it_can(world, pupil):
    """Receptor noise is 0.01. (Human cones begin at 390 nm, where their sensitivity is almost zero.)"""
    blind, human, bee = (dataclasses.replace(e, optics=pupil) for e in (EYES, _human(), BEES))
    assert difference(world, blind) < 0.1
    assert difference(world, human) < 0.1
    assert difference(world, bee) > 5


def _human():
    return dataclasses.replace(EYES, receptors="lms", bands=8)


@pytest.mark.parametrize("bands", [1, 3, 4, 16])
def test_no_number_of_bands_gives_the_secret_away(world, bands):
    assert difference(world, dataclasses.replace(EYES, bands=bands)) < 0.1


def test_one_pigment_is_enough_in_whatever_place_of_a_mosaic(world):
    alone = dataclasses.replace(EYES, receptors=(350,), bands=8)
    assert difference(world, alone) > 5
    kinds = optics.Receptors((540, 350), mosaic=((0, 1),))
    mosaic = dataclasses.replace(EYES, receptors=kinds, bands=8)
    renderer = sim.BatchedRenderer(world, mosaic, 1, sim.Fidelity(4, mosaic.bands))
    one, other = (renderer.signals(before_the_eyes(world, swapped=s)) for s in (False, True))
    assert one.shape == (1, 2, 1, 9, 13)
    change = np.abs(one - other)[0, :, 0] / mosaic.noise_sigma
    ultraviolet = np.arange(13) % 2 == 1
    assert change[:, :, ultraviolet].max() > 5
    assert change[:, :, ultraviolet].max() > 3 * change[:, :, ~ultraviolet].max()


@pytest.mark.parametrize("eyes", [EYES, BEES], ids=["rgb", "honeybee"])
def test_both_tracers_agree_ray_by_ray(world, eyes):
    n = 16
    rng = np.random.default_rng(0)
    state = Simulation(task_of(world), n, 0).reset()
    position = state.objects[:, 0, :2] + 2 * rng.standard_normal((n, 2))
    state = dataclasses.replace(state, position=position, heading=rng.uniform(-np.pi, np.pi, n))
    ours, theirs = (
        sim.BatchedRenderer(world, eyes, n, sim.Fidelity(4, eyes.bands), name).radiance(state).reshape(-1, eyes.bands)
        for name in ("closed_form", "mitsuba")
    )
    assert (np.abs(ours - theirs).max(axis=1) > 2e-3).mean() < 1e-3
    assert theirs.std() > 0.03


def test_as_many_components_as_the_eye_can_tell_spectra_apart(world):
    """The components are grey and yellow; for a range from 300 nm, yellow with ultraviolet is a third."""
    assert len(sim.BatchedRenderer(world, EYES, 1, sim.Fidelity(4, bands=8)).tracer.basis) == 2
    assert len(sim.BatchedRenderer(world, BEES, 1, sim.Fidelity(4, BEES.bands)).tracer.basis) == 3


def test_the_mirror_shows_what_the_renderer_shows(world):
    """The eyes' mean in every band agrees with Mitsuba's `direct` integrator on the mirror of the whole world."""
    import mujoco

    seen = build_world("foraging", eyes=BEES)
    state = before_the_eyes(seen)
    data = mujoco.MjData(seen.model)
    pose(data, seen, state)
    wavelengths = BEES.eye().spectral_bands.wavelengths
    mirror = sim.mirror(seen.model, data, spectra=seen.spectra)
    ours = (
        sim.BatchedRenderer(seen, BEES, 1, sim.Fidelity(256, BEES.bands))
        .receptor_radiance(state)[:, 0]
        .mean(axis=(2, 3))
    )
    theirs = np.stack(
        [mirror.render(name, 13, 9, "direct", 1024, wavelengths).mean(axis=(1, 2)) for name in BEES.names()], axis=1
    )
    # 120,000 samples of one of three lights each give a standard error of 0.3 % of the mean.
    np.testing.assert_allclose(ours, theirs, rtol=0.012)


def test_lights_and_walls_take_spectra_in_any_task():
    """Under incandescent light, red receptors have larger signals and blue ones smaller signals of the same
    grey walls.
    """
    day, evening = (
        sim.BatchedRenderer(build_world("detection", spectra=s), EYES, 1, sim.Fidelity(4, EYES.bands))
        for s in (None, {f"light_{i}": "A" for i in range(3)})
    )
    state = before_the_eyes(build_world("detection"))
    ratio = evening.signals(state).mean(axis=(0, 1, 3, 4)) / day.signals(state).mean(axis=(0, 1, 3, 4))
    assert ratio[0] > 1.15
    assert ratio[2] < 0.75
    leafy = sim.BatchedRenderer(
        build_world("detection", spectra={"wall": "foliage"}), EYES, 1, sim.Fidelity(4, EYES.bands)
    )
    near_wall = dataclasses.replace(state, position=np.array([[9.5, 0.0]]))
    _, green, blue = leafy.signals(near_wall)[0].mean(axis=(0, 2, 3))
    assert green > 1.15 * blue  # grey walls: 1


def test_episodes_are_played_by_detections_rules(world):
    simulation = Simulation(task_of(world), 1, 0)
    state = simulation.reset()
    simulation.state = dataclasses.replace(state, position=state.objects[:, 0, :2] - [1.05, 0], heading=np.zeros(1))
    step = simulation.step(np.array([[1.0, 0.0]]))
    assert step.terminated[0]
    assert step.success[0]
    assert step.reward_terms["goal"][0] == 1
