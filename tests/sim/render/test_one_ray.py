"""The batched renderer and the one-ray renderer agree in every receptor that sees a single colour.

The two renderers share the mirror's shapes and materials. Each has its own code for rays, eyes, lamps, shadows and
receptors.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import sim
from sim.render import one_ray
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation

EYES = sim.Eyes(n_eyes=2, resolution=(24, 36), fov_deg=60, placement_range_deg=50, bands=3, noise_sigma=0)
RAYS = 64
FLAT = 0.03  # relative standard deviation of a receptor's rays below which it sees one colour, apart from shading
CLOSE = 5e-3  # the remaining effect of shading and float32
# Objects at arm's length of the agent, one on each eye's axis, and one behind it.
CLOSE_BY = np.array([[1.5, 0.7], [1.5, -0.7], [2.6, 0.0]])


@cache
def scene(task):
    world = sim.build_world(task, seed=3)
    state = Simulation(task_of(world), 1, 3).reset()
    if world.objects:
        objects = state.objects.copy()
        objects[0, :, :2] = CLOSE_BY + np.array([-6.0, 1.0])
        state = replace(state, objects=objects, position=np.array([[-6.0, 1.0]]), heading=np.zeros(1))
    return world, state


@cache
def batched(task):
    """Return the signals of the batched renderer, and the receptors that see one colour."""
    world, state = scene(task)
    renderer = sim.BatchedRenderer(world, EYES, 1, sim.Fidelity(RAYS, EYES.bands))
    rays = renderer.radiance(state).sum(axis=-1).reshape(EYES.n_eyes, *EYES.resolution, RAYS)
    flat = rays.std(axis=-1) <= FLAT * np.maximum(rays.mean(axis=-1), 1e-6)
    return renderer.signals(state)[0], flat


def differing(task, signals):
    """Return the number of receptors that see one colour and have different signals."""
    expected, flat = batched(task)
    assert flat.mean() > 0.4
    assert np.ptp(expected.max(axis=1)[flat]) > 0.1  # the receptors are not uniformly dark
    off = np.abs(signals - expected).max(axis=1) > CLOSE * (np.abs(expected).max(axis=1) + 0.02)
    return int((off & flat).sum())


@pytest.mark.parametrize("task", ["detection", "foraging", "navigation"])
def test_both_renderers_see_the_same(task):
    world, state = scene(task)
    assert differing(task, one_ray.see(world, EYES, state)) <= 2  # RAYS rays may miss an edge


def test_signals_that_see_an_edge_are_as_bright_on_average():
    world, state = scene("detection")
    expected, flat = batched("detection")
    found = one_ray.see(world, EYES, state)
    edges = ~flat[:, None].repeat(found.shape[1], axis=1)
    assert found[edges].mean() == pytest.approx(expected[edges].mean(), rel=0.1)


def swapped(monkeypatch, world, state):
    """A mutant that exchanges goal and adversary."""
    return world, replace(state, objects=state.objects[:, [1, 0, 2]])


def shifted(monkeypatch, world, state):
    """A mutant in which every receptor looks along its right neighbour's direction."""
    looks = one_ray.receptor_direction
    monkeypatch.setattr(one_ray, "receptor_direction", lambda eyes, axis, row, at: looks(eyes, axis, row, at + 1))
    return world, state


def without_cosine(monkeypatch, world, state):
    """A mutant in which oblique light is as bright as perpendicular light."""
    lambert = one_ray.cosine
    monkeypatch.setattr(one_ray, "cosine", lambda normal, towards: float(lambert(normal, towards) > 0))
    return world, state


@pytest.mark.parametrize("wrong", [swapped, shifted, without_cosine])
def test_a_wrong_one_is_noticed(wrong, monkeypatch):
    world, state = wrong(monkeypatch, *scene("detection"))
    assert differing("detection", one_ray.see(world, EYES, state)) > 20


def test_a_world_with_a_medium_is_refused():
    with pytest.raises(ValueError, match="medium must be None, a single ray renders clear air only"):
        one_ray.see(sim.build_world("detection", seed=3, medium="fog"), EYES, scene("detection")[1])
