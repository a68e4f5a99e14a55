"""Light that differs between worlds, renderings of some worlds, and adaptive edge sampling, the same through every
tracer.
"""

from types import SimpleNamespace

import numpy as np
import pytest

import optics
import sim
from sim.render.eye_renderer import EyeRenderer
from sim.render.pending_frame import settled
from sim.render.prepared_scene import PreparedScene
from sim.render.receptor_noise import FEW
from sim.render.world_scene import WorldScene
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation

N = 3 * FEW
LENS = optics.Pupil(30e-6, thin_lens_focal_length=240e-6)
CASES = {
    "closed form": ("auto", sim.Fidelity(4, bands=4)),
    "areas": ("auto", sim.Fidelity(1, bands=4, samples="areas")),
    "mitsuba": ("mitsuba", sim.Fidelity(4, bands=4)),
}


def begun(pupil, case):
    """Return a renderer of N worlds and their poses."""
    tracer, fidelity = CASES[case]
    world = sim.build_world("detection")
    simulation = Simulation(task_of(world), N, 0)
    state = simulation.reset()
    simulation.close()
    scene = WorldScene(world, sim.Eyes(2, (3, 5), optics=pupil, receptors="honeybee"), tracer)
    return EyeRenderer(scene, N, fidelity), scene.poses(state)


@pytest.mark.parametrize("case", list(CASES))
@pytest.mark.parametrize("pupil", [None, LENS], ids=["perfect", "lens"])
class TestLight:
    def test_the_same_factor_in_all_bands_multiplies_signals(self, pupil, case):
        renderer, poses = begun(pupil, case)
        level = np.linspace(0.1, 1, N, dtype=np.float32)
        lit = renderer.signals(poses, np.repeat(level[:, None], 4, axis=1))
        expected = renderer.signals(poses) * level[:, None, None, None, None]
        np.testing.assert_allclose(lit, expected, rtol=1e-5, atol=1e-7)
        if case != "mitsuba":  # Mitsuba's components are bands
            np.testing.assert_array_equal(lit, expected)

    def test_a_factor_of_each_band_multiplies_its_radiance(self, pupil, case):
        renderer, poses = begun(pupil, case)
        assert len(renderer.tracer.basis) == (4 if case == "mitsuba" else 1)
        factors = np.random.default_rng(0).uniform(0.2, 1, (N, 4))
        radiance = renderer.receptor_radiance(poses)  # (band, env, eye, y, x)
        mixing = renderer.eye.aperture_throughput * renderer.bands.weights
        expected = np.einsum("cb,nb,bneyx->nceyx", mixing, factors, radiance).swapaxes(1, 2)
        np.testing.assert_allclose(renderer.signals(poses, factors), expected, rtol=1e-4, atol=1e-6)

    def test_some_worlds_are_as_they_are_among_all(self, pupil, case):
        renderer, poses = begun(pupil, case)
        factors = np.random.default_rng(0).uniform(0.2, 1, (N, 4))
        for worlds in ([4], [7, 2, 19], list(range(1, N, 2))):
            for light in (None, factors):
                every = renderer.signals(poses, light)[worlds]
                np.testing.assert_array_equal(renderer.launch_some(poses, np.array(worlds), light).wait(), every)


def test_light_is_what_it_was_when_the_look_began():
    renderer, poses = begun(None, "closed form")
    factors = np.full((N, 4), 0.5)
    frame = renderer.launch(poses, factors)
    factors[:] = 7
    np.testing.assert_array_equal(frame.wait(), renderer.signals(poses) * np.float32(0.5))


def test_a_look_at_some_runs_beside_one_at_all():
    renderer, poses = begun(None, "areas")
    others = poses.take(np.arange(N)[::-1])
    expected = renderer.signals(poses), renderer.signals(others)[[3]]
    every = renderer.launch(poses)
    some = renderer.launch_some(others, np.array([3]))
    np.testing.assert_array_equal(every.wait(), expected[0])
    np.testing.assert_array_equal(some.wait(), expected[1])


@pytest.mark.parametrize("tracer", ["closed_form", "mitsuba"])
def test_rays_at_edges_see_built_in_worlds_too(tracer):
    _, poses = begun(None, "closed form")
    scene = WorldScene(sim.build_world("detection"), sim.Eyes(2, (12, 15)), tracer)
    at_edges, everywhere = (
        EyeRenderer(scene, N, sim.Fidelity(64, bands=4, samples=samples, tolerance=5e-3)).signals(poses)
        for samples in ("edges", "rays")
    )
    assert np.sqrt(np.mean((at_edges - everywhere) ** 2)) < 5e-3


def test_what_receptors_look_at_in_built_in_worlds():
    """Rays of all tracers end on the geoms that the labels name."""
    renderer, poses = begun(None, "closed form")
    ids, depth = renderer.ids(poses), renderer.depth(poses)
    model = renderer.model
    assert {model.geom(g).name for g in np.unique(ids) if g >= 0} >= {"floor", "wall_east"}
    assert (np.isfinite(depth) == (ids >= 0)).all()
    assert renderer.flow(poses, poses)[np.repeat((ids >= 0)[:, :, None], 2, axis=2)] == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize(("worlds", "n_envs"), [(FEW, FEW + 1), (FEW + 1, FEW + 2), (1, FEW), (1, FEW + 1)])
@pytest.mark.parametrize("lit", [True, False])
def test_few_worlds_are_rendered_apart(worlds, n_envs, lit):
    """A frame of all worlds may then be pending. The separate renderer always has FEW worlds."""
    renderer = EyeRenderer.__new__(EyeRenderer)
    renderer.n_envs = n_envs
    frames = settled(1 + np.arange(n_envs))
    renderer.launch = lambda poses, light: frames
    renderer.scene = SimpleNamespace(
        check_count=PreparedScene.check_count, placed=lambda poses: SimpleNamespace(n=poses.n, take=lambda few: few)
    )
    renderer.eye = SimpleNamespace(bands=1)
    light = 1.0 + np.arange(n_envs)[:, np.newaxis] if lit else None

    def few(poses, given):
        assert len(poses) == FEW
        assert given is None if light is None else (given[:, 0] == 1 + poses).all()
        return settled(-1 - poses)

    vars(renderer)["_few"] = SimpleNamespace(launch=few)
    chosen = np.arange(worlds)[::-1]
    found = renderer.launch_some(SimpleNamespace(n=n_envs), chosen, light).wait()
    apart = worlds <= FEW < n_envs
    np.testing.assert_array_equal(found, -1 - chosen if apart else 1 + chosen)
