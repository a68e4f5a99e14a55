"""Adaptive edge sampling: the accuracy of rays everywhere with a fraction of the rays."""

import gc

import mujoco
import numpy as np
import pytest

import optics
import sim
from sim.render.edge_rays import FIRST, EdgeRays, edges_pay
from tests.sim.render.test_model_fidelity import BALL, MOUNT, eye, moments

FINE = 64
SHARP = eye(noise_sigma=0.01, resolution=(12, 15))


def around(seed):
    """Return states with the ball at random positions, also half out of view."""
    return moments(seed, 16, 1.8)


def renderer(n, samples="edges", one=SHARP, tolerance=None, rays=FINE):
    fidelity = sim.Fidelity(rays, one.bands, tolerance=tolerance, samples=samples)
    return sim.ModelRenderer(BALL, one, [MOUNT], n, fidelity)


@pytest.fixture
def traced(monkeypatch):
    """Return a list of the number of rays that each launch traced."""
    found, launch = [], EdgeRays.launch

    def counted(self, start):
        def noted(kernel, inputs):
            found.append(len(inputs.lanes))
            return start(kernel, inputs)

        return launch(self, noted)

    monkeypatch.setattr(EdgeRays, "launch", counted)
    return found


def test_a_fraction_of_the_rays_sees_the_same(traced):
    """All rays of a receptor agree if the first four rays of the receptor and its neighbours agree."""
    datas = around(0)
    seen = renderer(len(datas)).signals(datas)
    first, again = traced
    receptors = len(datas) * 12 * 15
    assert first == FIRST * len(datas) * 14 * 17  # including a rim around the field
    assert 0 < again < 0.25 * FINE * receptors
    everywhere = renderer(len(datas), "rays").signals(datas)
    assert np.ptp(everywhere) > 0.2
    np.testing.assert_allclose(seen, everywhere, atol=SHARP.noise_sigma / 20)


def test_without_their_neighbours_receptors_miss_edges(monkeypatch):
    """A wrong method: four rays miss the ball in a receptor's corner."""
    datas = around(1)
    everywhere = renderer(len(datas), "rays").signals(datas)
    monkeypatch.setattr(EdgeRays, "_beside_edges", lambda self, light: np.zeros(12 * 15 * light.shape[1], bool))
    assert np.abs(renderer(len(datas)).signals(datas) - everywhere).max() > SHARP.noise_sigma


def test_more_tolerance_looks_again_at_fewer(traced):
    """A larger tolerance refines fewer receptors. The ball's brightness changes over its surface."""
    datas, again = around(2), []
    for tolerance in (1e-3, 0.02, 0.1):
        renderer(len(datas), tolerance=tolerance).signals(datas)
        again.append(traced[-1])
    assert again == sorted(again, reverse=True)
    assert again[0] > 1.2 * again[-1]


def test_kernels_are_recorded_once_however_many_edges_there_are():
    """Kernels are recorded once, even without any edges, and if a frame is launched before the previous one was
    awaited.
    """
    # kernels depend on the shapes of all scenes: if scenes of other tests are freed meanwhile, kernels are recorded
    # again
    gc.collect()
    one = renderer(16)
    behind = around(3)
    for data in behind:
        data.mocap_pos[0] = -3, 0, 0
        mujoco.mj_forward(BALL, data)
    assert np.ptp(one.signals(behind)) == 0
    datas, others = around(4), around(5)
    expected = [one.signals(datas), one.signals(others)]
    first = one.launch(datas)
    second = one.launch(others)
    for frame, seen in zip((second, first), reversed(expected), strict=True):
        np.testing.assert_array_equal(frame.wait(), seen)
    assert one.recordings == 2
    assert one.depth(datas).shape == (16, 1, 12, 15)


def test_radiance_is_looked_at_as_finely():
    datas = around(6)
    seen, everywhere = (renderer(len(datas), samples).receptor_radiance(datas) for samples in ("edges", "rays"))
    np.testing.assert_allclose(seen, everywhere, atol=1e-3 * everywhere.max())


def test_edges_are_asked_for_where_the_first_rays_are_few():
    """The first rays cover 14 x 17 squares for 12 x 15 receptors, but 18 squares for 1 x 4 receptors."""
    assert [edges_pay((12, 15), rays) for rays in (8, 10, 11, 16)] == [False, False, True, True]
    assert [edges_pay((1, 4), rays) for rays in (16, 32, 64)] == [False, False, True]


def test_who_cannot_look_at_edges_says_so():
    with pytest.raises(ValueError, match="rays_per_receptor = 2: must be at least 4 where samples = 'edges'"):
        renderer(1, rays=2)
    blurred = eye(pupil=optics.Pupil(20e-6, thin_lens_focal_length=240e-6))
    with pytest.raises(ValueError, match="samples = 'edges': is for perfect lenses"):
        renderer(1, one=blurred)
    with pytest.raises(ValueError, match="tolerance = -1: must be positive"):
        renderer(1, tolerance=-1)


def test_built_in_worlds_are_seen_at_edges_in_closed_form(traced):
    """Signals agree with rays everywhere, with half of the rays, although all walls have stripes."""
    world, eyes, worlds = sim.build_world("detection"), sim.Eyes(n_eyes=2, resolution=(12, 15)), 4
    env = sim.make_vec_env("detection", eyes, worlds, seed=1, rays_per_receptor=1)
    env.reset()
    seen, everywhere = (
        sim.BatchedRenderer(world, eyes, worlds, sim.Fidelity(FINE, 4, tolerance=0.005, samples=samples))
        for samples in ("edges", "rays")
    )
    assert seen.tracer.name == everywhere.tracer.name == "closed_form"
    right, found = everywhere.signals(env.state), seen.signals(env.state)
    coarse = sim.BatchedRenderer(world, eyes, worlds, sim.Fidelity(FIRST, 4)).signals(env.state)
    assert sum(traced) < 0.6 * FINE * worlds * 2 * 12 * 15
    # Missed edges stay within the tolerance; the error of the first rays alone is ten times as large in some receptor.
    assert np.abs(found - right).max() < 0.005
    assert np.abs(coarse - right).max() > 0.05


@pytest.mark.parametrize("place", [(1, 2), (0, 0), (3, 4)])
@pytest.mark.parametrize("excess", [1.01, 0.99])
def test_all_eight_neighbours_of_a_different_receptor_are_rendered_again(place, excess):
    """Squares beyond the rim also have neighbours. Light counts as different from four times the noticed spread."""
    beyond = np.ones((6, 7), bool)
    beyond[1:-1, 1:-1] = False
    rays = EdgeRays.__new__(EdgeRays)
    rays._signals, rays._beyond, rays._noticed = [[0.5, 0.25]], beyond, 0.1
    field = np.zeros((4, 5))
    field[place] = excess * FIRST * 0.1
    light = np.zeros((2, 1, beyond.size))  # receptors come first, and squares beyond the rim after them
    light[0, 0, : field.size] = FIRST * field.ravel() / 0.75
    light[1] = light[0]
    rows, columns = np.indices((4, 5))
    near = np.maximum(abs(rows - place[0]), abs(columns - place[1])) <= 1
    np.testing.assert_array_equal(rays._beside_edges(light).reshape(4, 5), near if excess > 1 else np.zeros((4, 5)))
