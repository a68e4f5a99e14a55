"""The batched renderer against Mitsuba's stock `direct` integrator on the mirror of the same world."""

import dataclasses
import gc
from functools import cache

import drjit as dr
import mitsuba as mi
import mujoco
import numpy as np
import pytest

import sim
from sim.render.world_scene import WorldScene
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation
from sim.tracing import model_scene, spheres
from sim.tracing.model_lights import Lights
from sim.tracing.movers import Movers
from sim.worlds.state import pose
from sim.worlds.world import build_world

EYES = sim.Eyes(n_eyes=2, resolution=(9, 15), fov_deg=60, placement_range_deg=50, bands=6, noise_sigma=0)
BATCHES = 12  # independent renderings by Mitsuba, for their standard error
SPP = 96
RAYS = 1024


# Objects in the frames of the two agents: at arm's length, one on each eye's axis, shading floor, wall and each other.
CLOSE_BY = np.array([[[1.5, 0.7], [1.5, -0.7], [2.6, 0.0]], [[1.8, -0.8], [1.4, 0.7], [2.9, 0.3]]])


def begun(task, n, seed=0):
    """Return a world and a state in which the agents look at objects or walls."""
    world = build_world(task, seed=seed, eyes=EYES)
    state = Simulation(task_of(world), n, seed).reset()
    if not world.objects:
        return world, state
    objects = state.objects.copy()
    objects[:, :, :2] = CLOSE_BY + np.array([-8.0, 2.0])
    return world, dataclasses.replace(
        state, objects=objects, position=np.array([[-8.0, 2.0], [-8.0, 2.0]]), heading=np.zeros(2)
    )


def placed(world, state, index):
    """Return MuJoCo's data of one world of a state."""
    data = mujoco.MjData(world.model)
    pose(data, world, state, index)
    return data


@cache
def scene(task):
    return begun(task, 2)


class References(dict):
    """World, state and Mitsuba's renderings (batch, env, eye, band, y, x) of each task, rendered on first use."""

    def __missing__(self, task):
        world, state = scene(task)
        wavelengths = EYES.eye().spectral_bands.wavelengths
        mirror = sim.mirror(world.model)
        images = np.empty((BATCHES, state.n, EYES.n_eyes, len(wavelengths), *EYES.resolution))
        for env in range(state.n):
            mirror.sync(placed(world, state, env))
            for eye, name in enumerate(EYES.names()):
                for batch in range(BATCHES):
                    images[batch, env, eye] = mirror.render(
                        name, EYES.resolution[1], EYES.resolution[0], "direct", SPP, wavelengths, seed=batch
                    )
        self[task] = world, state, images
        return self[task]


@pytest.fixture(scope="module")
def references():
    return References()


@dataclasses.dataclass(frozen=True)
class Disagreement:
    """Differences from Mitsuba's renderings.

    They are the largest |z| of an eye's mean over its image, the share of receptors beyond 3 standard errors, and the
    largest relative error of a band's share in an image's light. The last one has hardly any noise in Mitsuba, because
    its bands share their rays.
    """

    mean: float
    beyond: float
    spectrum: float

    @property
    def significant(self):
        return self.mean > LARGEST_MEAN_Z or self.beyond > SHARE_BEYOND_3 or self.spectrum > SPECTRUM


def disagreement(world, state, images, tracer):
    renderer = sim.BatchedRenderer(world, EYES, state.n, sim.Fidelity(RAYS, EYES.bands), tracer)
    ours = np.moveaxis(renderer.receptor_radiance(state), 0, 2)
    means, theirs = ours.mean(axis=(3, 4)), images.mean(axis=(4, 5))
    shares = [m / m.sum(axis=-1, keepdims=True) for m in (means, theirs.mean(axis=0))]
    return Disagreement(
        mean=np.abs(_z(means, theirs)).max(),
        beyond=np.mean(np.abs(_z(ours, images)) > 3),
        spectrum=np.abs(shares[0] / shares[1] - 1).max(),
    )


def _z(ours, batches):
    error = batches.std(axis=0, ddof=1) / np.sqrt(len(batches))
    # 1e-5: float32 rounding of a uniformly lit receptor, for which the reference has no variance either.
    return (ours - batches.mean(axis=0)) / (error + 1e-5)


# Four image means per task, whose bands share their noise: one |t| of 11 degrees of freedom beyond 4.5 has p = 4e-3.
LARGEST_MEAN_Z = 4.5
# P(|t_11| > 3) = 1.2 %; receptors at an edge add our own sampling error.
SHARE_BEYOND_3 = 0.04
# float32, and the small remaining noise for materials that are not grey.
SPECTRUM = 1e-4


both_tracers = pytest.mark.parametrize("tracer", ["closed_form", "mitsuba"])


@pytest.mark.fast_cases(1)
@both_tracers
@pytest.mark.parametrize("task", ["detection", "navigation"])
def test_agrees_with_mitsubas_direct_integrator(references, task, tracer):
    found = disagreement(*references[task], tracer)
    assert not found.significant, found


def with_lights(change):
    """Return a mutant in which a function changes every light."""

    def sabotage(original):
        def lights(*arguments):
            found, left_out = original(*arguments)
            return [dataclasses.replace(light, **change(light)) for light in found], left_out

        return lights

    return sabotage


def misweighted(light):
    factor = np.ones(len(light.level))
    factor[2] = 1.02
    return {"level": light.level * factor}


def with_uv(change):
    """Return a mutant in which a function changes the texture coordinates (u, v) of spheres."""

    def sabotage(original):
        def surface_at(*arguments):
            point, normal, uv = original(*arguments)
            return point, normal, mi.Point2f(*change(uv.x, uv.y))

        return surface_at

    return sabotage


def with_uv_of_hits(change):
    def sabotage(original):
        def nearest(*arguments):
            hit = original(*arguments)
            return dataclasses.replace(hit, uv=mi.Point2f(*change(hit.uv.x, hit.uv.y)))

        return nearest

    return sabotage


def with_turned_light(original):
    def towards(*arguments):
        way, distance, share = original(*arguments)
        return mi.Vector3f(-way.x, way.y, way.z), distance, share

    return towards


def no_mover_shadows(original):
    return lambda *arguments: dr.zeros(type(original(*arguments)))


def upside_down(u, v):
    return u, 1 - v


def mirrored(u, v):
    return 1 - u, v


IN_CLOSED_FORM = [
    (model_scene, "model_lights", with_lights(lambda light: {"direction": light.direction * [-1, 1, 1]})),
    (model_scene, "model_lights", with_lights(misweighted)),
    (spheres, "surface_at", with_uv(upside_down)),
    (spheres, "surface_at", with_uv(mirrored)),
    (spheres, "blocks", no_mover_shadows),
]
BY_MITSUBA = [
    (Lights, "towards", with_turned_light),
    (model_scene, "model_lights", with_lights(misweighted)),
    (Movers, "nearest", with_uv_of_hits(upside_down)),
    (Movers, "nearest", with_uv_of_hits(mirrored)),
    (Movers, "block", no_mover_shadows),
]


@pytest.mark.fast_cases(4)
@pytest.mark.parametrize(
    ("tracer", "module", "name", "sabotage"),
    [*(("closed_form", *each) for each in IN_CLOSED_FORM), *(("mitsuba", *each) for each in BY_MITSUBA)],
)
def test_parity_is_lost_when_something_is_wrong(references, monkeypatch, tracer, module, name, sabotage):
    monkeypatch.setattr(module, name, sabotage(getattr(module, name)))
    assert disagreement(*references["detection"], tracer).significant


def test_signals_weight_the_bands():
    world, state = scene("detection")
    renderer = sim.BatchedRenderer(world, EYES, state.n, sim.Fidelity(3, EYES.bands))
    rays = renderer.radiance(state)
    assert rays.shape == (2, 2, 9 * 15 * 3, 6)
    receptors = rays.reshape(2, 2, 9, 15, 3, 6).mean(axis=4)
    expected = np.einsum("neyxb,cb->necyx", receptors, EYES.eye().spectral_bands.weights)
    np.testing.assert_allclose(renderer.signals(state), expected, rtol=1e-5, atol=1e-7)


@both_tracers
@pytest.mark.parametrize("task", ["detection", "navigation"])
def test_kernels_are_recorded_once_and_results_do_not_alias(task, tracer):
    # kernels depend on the shapes of all scenes: if scenes of other tests are freed meanwhile, kernels are recorded
    # again
    gc.collect()
    world, state = scene(task)
    renderer = sim.BatchedRenderer(world, EYES, state.n, sim.Fidelity(2, EYES.bands, light="bounce"), tracer)
    first = renderer.signals(state)
    kept = first.copy()
    for step in range(20):
        moved = dataclasses.replace(state, heading=state.heading + 0.1 * (step + 1))
        assert not np.array_equal(renderer.signals(moved), kept)
    np.testing.assert_array_equal(first, kept)
    np.testing.assert_array_equal(renderer.signals(state), kept)
    assert renderer.recordings == 1 or (tracer == "mitsuba" and task == "detection" and renderer.recordings <= 3)


@both_tracers
@pytest.mark.parametrize("task", ["detection", "navigation"])
def test_a_world_looks_the_same_among_any_number_of_neighbours(task, tracer):
    world, state = scene(task)
    alone = sim.BatchedRenderer(world, EYES, 1, sim.Fidelity(2, EYES.bands, light="bounce"), tracer)
    many = alone.resized(16)
    crowd = state.take(np.arange(16) % 2)
    np.testing.assert_array_equal(many.signals(crowd)[3], alone.signals(state.take(np.array([1])))[0])


def test_bad_arguments_are_named():
    world, state = scene("detection")
    with pytest.raises(ValueError, match="n_envs"):
        sim.BatchedRenderer(world, EYES, 0, sim.Fidelity(1, EYES.bands))
    with pytest.raises(ValueError, match=r"fidelity = 4: must be a kind of Fidelity"):
        sim.BatchedRenderer(world, EYES, 1, 4)
    with pytest.raises(ValueError, match=rf"fidelity\.bands = 3: must be the scene's {EYES.bands}"):
        sim.BatchedRenderer.from_scene(WorldScene(world, EYES), 1, sim.Fidelity(1, bands=3))
    with pytest.raises(ValueError, match="state has 2 worlds"):
        sim.BatchedRenderer(world, EYES, 1, sim.Fidelity(1, EYES.bands)).signals(state)
