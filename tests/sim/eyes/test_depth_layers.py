"""Depth layers of the batched renderer against `Eye.see` with a map of distances."""

import dataclasses
import math

import drjit as dr
import numpy as np
import pytest

import optics
import sim
from sim.eyes.depth_layers import DepthLayers
from sim.scene.variant import variant
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation

NEAR, FAR = 0.3, 20.0  # [m]


@pytest.fixture(scope="module")
def close_by():
    """Return a scene with an object at arm's length and others behind it, and an eye in focus at infinity.

    The eye has the size of a vertebrate's. Light from the distance NEAR is blurred over 1.7 receptors.
    """
    eyes = sim.Eyes(2, (5, 21), fov_deg=12, placement_range_deg=40, sensor_width=2e-2, bands=1, noise_sigma=0)
    focus = eyes.eye().sensor_distance
    eyes = dataclasses.replace(eyes, optics=optics.Pupil(2.5e-3, thin_lens_focal_length=focus))
    world = sim.build_world("detection")
    simulation = Simulation(task_of(world), 1, 0)
    state = simulation.reset()
    simulation.close()
    objects = state.objects.copy()
    objects[0, :, :2] = [[7.0, 1.6], [6.4, 2.5], [4.0, 1.0]]
    there = {"position": np.array([[8.0, 2.0]]), "heading": np.array([np.pi - 0.05])}
    return world, eyes, dataclasses.replace(state, objects=objects, **there)


def test_layers_agree_with_the_convolution_in_depth(close_by):
    world, eyes, state = close_by
    reference = sim.ReferenceRenderer(
        world, eyes, "direct", 144, depths=(NEAR, FAR), depth_layers=9, sampler="multijitter"
    )
    truth = reference.signals(state)

    def error(depth):
        signals = sim.BatchedRenderer(world, eyes, 1, sim.Fidelity(256, 1, depth)).signals(state)
        return np.sqrt(np.mean((signals - truth) ** 2)) / truth.mean()

    infinite, mean, layers = (
        error(depth) for depth in (DepthLayers(), DepthLayers(FAR, NEAR, 1), DepthLayers(FAR, NEAR, 3))
    )
    # 1.5 %, 0.5 %, and the noise of the reference, 0.1 to 0.2 %.
    assert infinite > 2 * mean > 4 * layers
    assert layers < 0.0025


def test_areas_share_their_light_among_layers_as_rays_do(close_by, monkeypatch):
    """Areas and rays give the layers the same mean light over all samples of a view. Both views contain spheres, walls
    and floor. The result differs if distances replace their inverses. Samples are unweighted: the number of areas
    equals that of groups of rays, over the receptors' squares.
    """
    world, eyes, state = close_by
    heading = state.heading[0] - np.linspace(0, 0.6, 7)
    states = dataclasses.replace(state.take(np.zeros(7, int)), heading=heading)
    sharp = dataclasses.replace(eyes, optics=None)
    depth = DepthLayers(FAR, NEAR, 3)

    def layers(eyes, samples, kind):
        """Return the mean light, (layer, view)."""
        renderer = sim.BatchedRenderer(world, eyes, 7, sim.Fidelity(samples, 1, depth, samples=kind))
        renderer.sensor = dataclasses.replace(renderer.sensor, depth=depth)
        renderer._set_width(7)
        found = renderer._components(renderer._launched(states).wait())
        return found.reshape(3, 14, -1).mean(axis=-1) / samples

    along_rays = layers(sharp, 256, "rays")

    def error():
        return np.abs(layers(sharp, 4, "areas") - along_rays).max() / along_rays.max()

    right, shares = error(), DepthLayers.shares
    monkeypatch.setattr(DepthLayers, "shares", lambda self, vergence: shares(self, dr.rcp(vergence)))
    assert (along_rays.max(axis=1) > 0.01).all()
    assert right < 0.01
    assert error() > 0.1


@pytest.mark.slow
def test_auto_takes_layers_for_large_eyes_alone(close_by):
    world, large, _ = close_by
    small = sim.Eyes(2, (5, 5), optics=optics.Pupil(25e-6, thin_lens_focal_length=2.4e-4))
    assert sim.choose_fidelity(world, small, bands="own").depth == DepthLayers()
    sharp, noisy = (
        sim.choose_fidelity(world, dataclasses.replace(large, noise_sigma=sigma), bands="own") for sigma in (2e-3, 0.05)
    )
    assert sharp.depth.count > 1
    assert sharp.depth.nearest < 0.5
    assert next(level for level in sharp.levels if level.stage == "depth").predicted_error < 1e-3
    assert noisy.depth.count == 1


def test_shares_are_hats_over_the_vergence():
    depth = DepthLayers(math.inf, 0.5, 3)
    assert depth.distances == (math.inf, 1.0, 0.5)
    z = np.array([math.inf, 4.0, 1.0, 2 / 3, 0.5, 0.1], np.float32)
    with variant():
        import mitsuba as mi

        shares = np.array([np.array(share) for share in depth.shares(dr.rcp(mi.Float(z)))])
    expected = [[1, 0.75, 0, 0, 0, 0], [0, 0.25, 1, 0.5, 0, 0], [0, 0, 0, 0.5, 1, 1]]
    np.testing.assert_allclose(shares, expected, atol=1e-5)
    assert DepthLayers(2.0, 0.5, 1).distances == (0.8,)  # the distance of the mean inverse distance


@pytest.mark.parametrize(
    ("arguments", "named"), [((1.0, 2.0), "nearest"), ((1.0, -1.0), "nearest"), ((2.0, 1.0, 0), "0 layers")]
)
def test_bad_arguments_are_named(arguments, named):
    with pytest.raises(ValueError, match=named):
        DepthLayers(*arguments)
