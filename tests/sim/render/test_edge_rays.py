"""Rays at edges alone: as good as rays everywhere, and a fraction of them."""

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
    """The ball somewhere, also half out of view."""
    return moments(seed, 16, 1.8)


def renderer(n, samples="edges", one=SHARP, tolerance=None, rays=FINE):
    fidelity = sim.Fidelity(rays, one.bands, tolerance=tolerance, samples=samples)
    return sim.ModelRenderer(BALL, one, [MOUNT], n, fidelity)


@pytest.fixture
def traced(monkeypatch):
    """How many rays each launch traced."""
    found, launch = [], EdgeRays.launch

    def counted(self, start):
        def noted(kernel, inputs):
            found.append(len(inputs.lanes))
            return start(kernel, inputs)

        return launch(self, noted)

    monkeypatch.setattr(EdgeRays, "launch", counted)
    return found


def test_a_fraction_of_the_rays_sees_the_same(traced):
    """Where the first four rays are alike and a neighbour is not far off, all rays are alike."""
    datas = around(0)
    seen = renderer(len(datas)).signals(datas)
    first, again = traced
    receptors = len(datas) * 12 * 15
    assert first == FIRST * len(datas) * 14 * 17  # and beyond the rim
    assert 0 < again < 0.25 * FINE * receptors
    everywhere = renderer(len(datas), "rays").signals(datas)
    assert np.ptp(everywhere) > 0.2
    np.testing.assert_allclose(seen, everywhere, atol=SHARP.noise_sigma / 20)


def test_without_their_neighbours_receptors_miss_edges(monkeypatch):
    """The wrong method: four rays do not see that the ball fills a corner."""
    datas = around(1)
    everywhere = renderer(len(datas), "rays").signals(datas)
    monkeypatch.setattr(EdgeRays, "_beside_edges", lambda self, light: np.zeros(12 * 15 * light.shape[1], bool))
    assert np.abs(renderer(len(datas)).signals(datas) - everywhere).max() > SHARP.noise_sigma


def test_more_tolerance_looks_again_at_fewer(traced):
    """Of a ball whose brightness changes over its surface."""
    datas, again = around(2), []
    for tolerance in (1e-3, 0.02, 0.1):
        renderer(len(datas), tolerance=tolerance).signals(datas)
        again.append(traced[-1])
    assert again == sorted(again, reverse=True)
    assert again[0] > 1.2 * again[-1]


def test_kernels_are_recorded_once_however_many_edges_there_are():
    """Also where there are none, and where a frame is begun before the one before it was waited for."""
    gc.collect()  # kernels look at the shapes of all scenes: when others' go meanwhile, they are recorded anew
    one = renderer(16)
    behind = around(3)
    for data in behind:
        data.mocap_pos[0] = -3, 0, 0
        mujoco.mj_forward(BALL, data)
    assert np.ptp(one.signals(behind)) == 0
    datas, others = around(4), around(5)
    expected = [one.signals(datas), one.signals(others)]
    first = one.begin(datas)
    second = one.begin(others)
    for frame, seen in zip((second, first), reversed(expected), strict=True):
        np.testing.assert_array_equal(frame.wait(), seen)
    assert one.recordings == 2
    assert one.depth(datas).shape == (16, 1, 12, 15)


def test_radiance_is_looked_at_as_finely():
    datas = around(6)
    seen, everywhere = (renderer(len(datas), samples).receptor_radiance(datas) for samples in ("edges", "rays"))
    np.testing.assert_allclose(seen, everywhere, atol=1e-3 * everywhere.max())


def test_edges_are_asked_for_where_the_first_rays_are_few():
    """Of 12 x 15 receptors 14 x 17 squares are looked at, of 1 x 4 as many as 18."""
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
    """As rays everywhere see them, with half of the rays: there are stripes on all walls."""
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
    # What is missed lies within the tolerance; the first rays alone err by ten times as much somewhere.
    assert np.abs(found - right).max() < 0.005
    assert np.abs(coarse - right).max() > 0.05
