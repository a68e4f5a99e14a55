"""Compound eyes of the agents of built-in tasks: signals, noise, fidelity, and refusals."""

import mujoco
import numpy as np
import pytest

import optics
import sim
from sim.render.one_ray import see
from sim.render.world_fidelity import chosen_fidelity
from sim.render.world_scene import WorldScene
from sim.tasks.built_in import mounts_of_agent
from sim.worlds.state import pose

FACET = optics.Ommatidium(optics.FacetLens(16e-6, 14e-6), optics.Waveguide(2e-6))
EYES = sim.Eyes(n_eyes=2, resolution=(3, 8), fov_deg=90.0, placement_range_deg=100.0, ommatidium=FACET, acute_zone=1.5)
RAYS = sim.Fidelity(64, 4)


@pytest.fixture(scope="module")
def moments():
    """Detection, and a moment in each of two worlds."""
    env = sim.make_vec_env("detection", sim.Eyes(), 2, rays_per_receptor=1)
    env.reset()
    env.step(np.array([[1, 0.5], [0.5, -1]], np.float32))
    yield env.batch_task.world, env.simulation.state
    env.close()


def test_both_tracers_and_a_renderer_of_models_agree(moments):
    """`sim.ModelRenderer` traces the rays of the same lattice with Mitsuba, from two mounts on the agent."""
    world, state = moments
    closed, mitsuba = (
        sim.BatchedRenderer(world, EYES, 2, RAYS, tracer).signals(state) for tracer in ("closed_form", "mitsuba")
    )
    assert closed.shape == (2, 2, 3, 3, 8)
    assert np.abs(closed - mitsuba).max() < 2e-3
    data = mujoco.MjData(world.model)
    pose(data, world, state, 1)
    lattice = sim.CompoundEye(sim.hexagonal_rows(3, 8, 90.0, 1.5), FACET)
    renderer = sim.ModelRenderer(world.model, lattice, mounts_of_agent(EYES), 1, RAYS, spectra=world.spectra)
    found = renderer.signals(data)[0].reshape(2, 3, 3, 8)
    assert np.abs(found - closed[1]).max() < 2e-3
    assert closed.std() > 0.02


def test_observations_have_rows_and_each_facet_has_its_photons():
    """The noise of each ommatidium has the variance signal / photons, in 64 worlds at the start of an episode."""
    budget = optics.PhotonBudget(30.0)
    dim = sim.Eyes(2, (3, 8), 90.0, 100.0, ommatidium=FACET, photon_budget=budget, noise_sigma=0.0)
    bright = sim.Eyes(2, (3, 8), 90.0, 100.0, ommatidium=FACET, noise_sigma=0.0)
    noisy, clean = (sim.make_vec_env("navigation", eyes, 64, rays_per_receptor=4, memory=2) for eyes in (dim, bright))
    seen, truth = noisy.reset()["eyes"], clean.reset()["eyes"]
    assert seen.shape == (64, 2, 2, 3, 3, 8)
    photons = dim.eye().receptor_photons
    expected = np.maximum(truth[:, -1], 0) / photons
    scale = (seen - truth)[:, -1] / np.sqrt(np.maximum(expected, 1e-12))
    assert scale[truth[:, -1] > 0.02].std() == pytest.approx(1, rel=0.05)
    for env in (noisy, clean):
        env.close()


def test_images_of_an_agents_compound_eyes():
    env = sim.make_vec_env("detection", EYES, 1, rays_per_receptor=2, render_mode="eyes")
    env.reset()
    assert env.get_images()[0].shape[1] > 2 * env.get_images()[0].shape[0]
    env.close()


@pytest.mark.slow
def test_automatic_fidelity_is_within_its_tolerance(moments):
    world, state = moments
    few = sim.Eyes(1, (1, 4), 80.0, 0.0, ommatidium=FACET, noise_sigma=0.1)
    chosen = sim.choose_fidelity(world, few)
    assert chosen.samples == "rays"
    assert chosen.predicted_error <= chosen.tolerance == 0.05
    assert chosen == chosen_fidelity(WorldScene(world, few))
    truth = sim.Fidelity(512, 4, light=chosen.light)
    found, exact = (sim.BatchedRenderer(world, few, 2, fidelity).signals(state) for fidelity in (chosen, truth))
    assert np.sqrt(np.mean((found - exact) ** 2)) < 0.05


def test_what_compound_eyes_do_not_have_is_refused_in_one_line(moments):
    world, state = moments
    with pytest.raises(ValueError, match="eyes: their ommatidium must be None"):
        see(world, EYES, state)
    with pytest.raises(ValueError, match="eyes: their ommatidium must be None, the reference"):
        sim.ReferenceRenderer(world, EYES)
    with pytest.raises(ValueError, match="samples = 'areas': must be 'rays' for a compound eye"):
        sim.BatchedRenderer(world, EYES, 2, sim.Fidelity(1, 4, samples="areas"))
    with pytest.raises(ValueError, match="the eye is a CompoundEye"):
        sim.make_vec_env("detection", EYES, 1, rays_per_receptor=1, auxiliary=("depth",))
