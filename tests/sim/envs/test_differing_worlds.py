"""Bodies that differ between the worlds of one batch: physics and signals agree with a model that is compiled with
these bodies.
"""

import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from scipy.stats import kstest

import sim
from sim.eyes.tangent_plane import directions_of
from sim.render.optic_flow import receptor_centres
from sim.scene.variation import Variation
from sim.scene.world_models import WorldModels
from sim.tasks.task_fidelity import fidelities_of
from tests.sim.envs.rail import EYE
from tests.sim.envs.rooms import SHAPES, Room, room, with_ranges


@pytest.mark.parametrize("kind", SHAPES)
def test_what_is_seen_is_as_large_as_physics_has_it(kind):
    env = sim.make_vec_env(with_ranges({"thing.size": (0.4, 2.5)}, room(kind, SHAPES[kind])), n_envs=6, seed=2)
    env.reset()
    env.step(np.zeros((6, 1)))
    sizes = [info["varied"]["thing.size"] for info in env.reset_infos]
    assert np.ptp(sizes) > 0.5
    depth, ids, (pupils, frames) = (
        ask(sim.Poses.from_data(env.worlds.datas))
        for ask in (env.renderer.depth, env.renderer.ids, env.renderer.eye_frames)
    )
    geom, centres, right, shares = np.zeros(1, np.int32), directions_of(EYE, receptor_centres(EYE)), [], []
    for world, data in enumerate(env.worlds.datas):
        for r, centre in enumerate(centres):
            way = (frames[world, 0] @ centre).astype(float)
            far = mujoco.mj_ray(data.model, data, pupils[world, 0], way, None, 1, -1, geom)
            mine = ids[world, 0].ravel()[r], depth[world, 0].ravel()[r]
            near = (far < 0 and np.isinf(mine[1])) or abs(mine[1] - far * centre[2]) < 1e-3
            right.append(mine[0] == geom[0] and near)
        shares.append((ids[world] == env.worlds.model.geom("thing").id).mean())
    assert np.mean(right) >= 0.995
    order = np.argsort(sizes)
    assert (np.diff(np.array(shares)[order]) >= 0).all()
    assert shares[order[-1]] > 2 * shares[order[0]] > 0


@pytest.mark.parametrize("kind", SHAPES)
def test_masses_and_all_that_follow_are_the_compilers(kind):
    """Mass follows the scaled volume, unless the model specifies a mass: then it stays."""
    text, factor = room(kind, SHAPES[kind]), 1.7
    model = mujoco.MjModel.from_xml_string(text)
    bodies = WorldModels(text, model, 2, Variation({"thing.size": (factor, factor)}))
    bodies.start_episode(1, {"thing.size": factor})
    found, g, b = bodies.models[1], model.geom("thing").id, model.body("thing").id
    np.testing.assert_allclose(found.geom_size[g], factor * model.geom_size[g], rtol=1e-12)
    np.testing.assert_allclose(found.geom_pos[g], model.geom_pos[g], atol=1e-12)
    assert found.body_mass[b] == pytest.approx(factor**3 * model.body_mass[b])
    np.testing.assert_allclose(found.body_inertia[b], factor**5 * model.body_inertia[b], rtol=1e-9)
    assert found.geom_rbound[g] == pytest.approx(factor * model.geom_rbound[g])
    np.testing.assert_array_equal(bodies.models[0].geom_size, model.geom_size)
    weighed = text.replace('name="thing" type', 'name="thing" mass="2" type')
    model = mujoco.MjModel.from_xml_string(weighed)
    bodies = WorldModels(weighed, model, 1, Variation({"thing.size": (factor, factor)}))
    bodies.start_episode(0, {"thing.size": factor})
    assert bodies.models[0].body_mass[b] == 2
    np.testing.assert_allclose(bodies.models[0].body_inertia[b], factor**2 * model.body_inertia[b], rtol=1e-9)


def test_a_world_of_factor_one_is_the_world_as_it_was():
    model = mujoco.MjModel.from_xml_string(room())
    bodies = WorldModels(room(), model, 1, Variation({"thing.size": (1, 2)}))
    bodies.start_episode(0, {"thing.size": 1.8})
    bodies.start_episode(0, {"thing.size": 1.0})
    for name in dir(model):
        here = None if name.startswith("_") else getattr(model, name)
        if isinstance(here, np.ndarray) and here.dtype != object:
            np.testing.assert_array_equal(getattr(bodies.models[0], name), here, err_msg=name)
    assert bodies.models[0].stat.meaninertia == model.stat.meaninertia


def test_large_things_fall_onto_the_floor_earlier():
    """A ball of radius r comes to rest with its centre at height r."""
    env = sim.make_vec_env(with_ranges({"thing.size": (0.5, 1.5)}), n_envs=4, seed=0)
    env.reset()
    for data in env.worlds.datas:
        mujoco.mj_step(data.model, data, 800)
    radii = [0.3 * info["varied"]["thing.size"] for info in env.reset_infos]
    np.testing.assert_allclose([data.qpos[3] for data in env.worlds.datas], radii, atol=2e-3)


def coloured(rgb, **how):
    """Return the signals of a room that is compiled with this colour."""
    model = mujoco.MjModel.from_xml_string(room(rgb=" ".join(map(str, rgb)), **how))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return sim.ModelRenderer(model, EYE, Room.mounts, 1, Room.fidelity).signals([data])[0]


def test_colours_are_those_of_a_room_that_is_built_so():
    env = sim.make_vec_env(with_ranges({"thing.color": ((0.1, 0, 0.2), (0.9, 0.8, 1.0))}), n_envs=4, seed=1)
    seen = env.reset()["eyes"][:, 0]
    colors = [info["varied"]["thing.color"] for info in env.reset_infos]
    assert np.ptp(colors, axis=0).min() > 0.2
    for world in range(4):
        np.testing.assert_allclose(seen[world], coloured(colors[world]), atol=2e-6)
    assert np.abs(seen[0] - seen[1]).max() > 0.05
    np.testing.assert_allclose(env.worlds.datas[2].model.geom("thing").rgba, [*colors[2], 1], rtol=1e-6)


def test_a_floor_that_stands_still_may_differ_and_keeps_its_texture():
    textured = 'material="stripes"'
    task = with_ranges({"floor.color": ((0.2, 0.2, 0.2), (1, 1, 1))}, room(floor=textured))
    env = sim.make_vec_env(task, n_envs=3, seed=1)
    seen = env.reset()["eyes"][:, 0]
    white = coloured((0.9, 0.2, 0.1), floor=textured)
    for world, info in enumerate(env.reset_infos):
        color = info["varied"]["floor.color"]
        plain = [coloured((0.9, 0.2, 0.1), floor=f'rgba="{" ".join(map(str, c))} 1"') for c in (color, (1, 1, 1))]
        where = (env.renderer.ids(sim.Poses.from_data(env.worlds.datas))[world] == 0)[:, None] & (plain[1] > 0.02)
        inner = np.broadcast_to(where, white.shape).copy()
        inner[..., 1:, :] &= inner[..., :-1, :]
        inner[..., :-1, :] &= inner[..., 1:, :]
        inner[..., :, 1:] &= inner[..., :, :-1]
        inner[..., :, :-1] &= inner[..., :, 1:]
        # A texture multiplied by a colour, band by band. Signals of one receptor follow this product up to the width of
        # its bands.
        expected = white * plain[0] / np.maximum(plain[1], 1e-6)
        np.testing.assert_allclose(seen[world][inner], expected[inner], rtol=0.05, atol=2e-3)
        assert inner.sum() > 50
    assert np.ptp(white[:, -3:]) > 0.1, "the floor has stripes"


def test_starts_are_drawn_for_joints_and_bodies():
    task = with_ranges(
        {"rail.start": (-0.5, 0.7), "lamp.start": ((0, 1, 0.2), (1, 2, 0.4)), "thing.start": ((2, -1, 1), (3, 1, 1))}
    )
    env = sim.make_vec_env(task, n_envs=200, seed=3)
    env.reset()
    rail = np.array([data.joint("rail").qpos[0] for data in env.worlds.datas])
    assert kstest((rail + 0.5) / 1.2, "uniform").pvalue > 0.01
    lamps = np.array([data.mocap_pos[0] for data in env.worlds.datas])
    assert (lamps >= [0, 1, 0.2]).all()
    assert (lamps <= [1, 2, 0.4]).all()
    assert np.abs(np.corrcoef(lamps.T)[np.triu_indices(3, 1)]).max() < 0.25
    things = np.array([data.joint("flight").qpos[:3] for data in env.worlds.datas])
    assert (things[:, 2] == 1).all()
    assert np.ptp(things[:, 1]) > 1.8
    varied = env.reset_infos[7]["varied"]
    assert varied["rail.start"] == rail[7]
    np.testing.assert_array_equal(varied["lamp.start"], lamps[7])


def test_sizes_are_drawn_evenly_over_their_logarithm_and_anew():
    task = with_ranges({"thing.size": (0.25, 4.0)})
    task.episode_steps = 1
    env = sim.make_vec_env(task, n_envs=16, seed=3)
    env.reset()
    infos = [info for _ in range(12) for info in env.step(np.zeros((16, 1)))[3]]
    found = [info["varied"]["thing.size"] for info in infos]
    assert kstest((np.log(found) - np.log(0.25)) / np.log(16), "uniform").pvalue > 0.01
    worlds = np.reshape(env.simulation.varied["thing.size"], -1)
    np.testing.assert_allclose([d.model.geom("thing").size[0] for d in env.worlds.datas], 0.3 * worlds)


def test_one_world_and_another_number_of_worlds_see_the_same():
    vary = {"thing.size": (0.5, 2), "post.color": ((0, 0, 0), (1, 1, 1)), "light": (0.5, 1)}
    seen = [sim.make_vec_env(with_ranges(vary), n_envs=n, seed=5).reset()["eyes"][0] for n in (1, 4)]
    np.testing.assert_array_equal(*seen)
    check_env(sim.make_env(with_ranges(vary)), skip_render_check=True)


def test_states_have_the_bodies_with_them():
    vary = {"thing.size": (0.5, 2), "thing.color": ((0, 0, 0), (1, 1, 1)), "lamp.start": ((0, 1, 0), (1, 2, 1))}
    task = with_ranges(vary)
    env = sim.make_vec_env(task, n_envs=3, seed=5)
    env.reset()
    env.step(np.ones((3, 1)))
    held = env.get_state()
    expected = [env.step(np.ones((3, 1)))[0]["eyes"] for _ in range(2)]
    env.reset()
    other = sim.make_vec_env(task, n_envs=3, seed=9)
    other.reset()
    for one in (env, other):
        one.set_state(held)
        for frame in expected:
            np.testing.assert_array_equal(one.step(np.ones((3, 1)))[0]["eyes"], frame)


def test_rays_are_tried_on_worlds_that_differ():
    task = with_ranges({"thing.size": (0.05, 0.06), "floor.color": ((0, 0, 0), (1, 1, 1))})
    task.fidelity = "auto"
    assert fidelities_of(task)["eyes"].rays_per_receptor >= 1


def test_pictures_for_people_show_them():
    task = with_ranges({"thing.size": (3.0, 3.0), "thing.color": ((0, 1, 0), (0, 1, 0))})
    pictures, task.episode_steps = [], 12
    for one in (task, Room()):
        env = sim.make_vec_env(one, n_envs=1, render_mode="rgb_array")
        env.reset()
        pictures.append(env.get_images()[0].astype(int))
    env = sim.make_vec_env(task, n_envs=1, render_mode="rgb_array")
    env.reset()
    for _ in range(11):
        env.get_images()
        env.step(np.zeros((1, 1)))
    assert env.renderer.recordings <= 4, "a new camera records its kernels again, and an episode has one camera"
    green, red = ((p[..., 1] > 1.3 * p[..., 0]).sum() for p in pictures)
    assert green > red + 2000


def test_renderers_take_what_datas_own_models_have():
    """Renderers also follow the data's own models without a task, and refuse changes for which they were not built."""
    models = [mujoco.MjModel.from_xml_string(room(shape=f'size="{size}"')) for size in (0.1, 0.5)]
    datas = [mujoco.MjData(model) for model in models]
    for model, data in zip(models, datas, strict=True):
        mujoco.mj_forward(model, data)
    renderer = sim.ModelRenderer(models[0], EYE, Room.mounts, 2, Room.fidelity)
    seen = renderer.ids(datas) == models[0].geom("thing").id
    assert seen[1].sum() > 10 * seen[0].sum() > 0
    single = sim.ModelRenderer(models[0], EYE, Room.mounts, 1, Room.fidelity)
    np.testing.assert_array_equal(single.ids(datas[1:]) == models[0].geom("thing").id, seen[1:])
    models[1].geom("post").size[2] *= 2
    with pytest.raises(ValueError, match="geom 'post' differs in size from the renderer's model: must be in `vari"):
        renderer.signals(datas)
    models[1].geom("post").size[2] /= 2
    models[1].geom("thing").rgba[0] = 0.3
    with pytest.raises(ValueError, match="geom 'thing' differs in colour from the renderer's model"):
        renderer.signals(datas)
    sim.ModelRenderer(models[0], EYE, Room.mounts, 2, Room.fidelity, varied=["thing"]).signals(datas)


@pytest.mark.parametrize(
    ("vary", "model", "said"),
    [
        ({"thimg.size": (1, 2)}, room(), "vary: thimg.size: the model has no geom 'thimg'; did you mean 'thing'?"),
        (
            {"floor.size": (1, 2)},
            room(),
            "vary: floor.size: must be a sphere, capsule, cylinder, ellipsoid or box with",
        ),
        (
            {"thing.size": (1, 2)},
            mujoco.MjModel.from_xml_string(room()),
            "vary: sizes: model is an MjModel: must be MJCF",
        ),
        (
            {"rail.start": ((0, 0, 0), (1, 1, 1))},
            room(),
            "vary: rail.start is between points .*: 'rail' must be a mocap",
        ),
        ({"lamp.start": (0, 1)}, room(), "vary: lamp.start is between numbers: 'lamp' must be a hinge or slide joint"),
        ({"flight.start": (0, 1)}, room(), "'flight' must be a hinge or slide joint"),
        ({"nobody.start": ((0, 0, 0), (1, 1, 1))}, room(), "'nobody' must be a mocap body"),
    ],
)
def test_what_cannot_differ_is_refused(vary, model, said):
    with pytest.raises(ValueError, match=said):
        sim.make_vec_env(with_ranges(vary, model), n_envs=1)


def test_an_mjspec_is_not_changed():
    spec = mujoco.MjSpec.from_string(room())
    env = sim.make_vec_env(with_ranges({"thing.size": (2, 3)}, spec), n_envs=2)
    env.reset()
    assert spec.geom("thing").size[0] == 0.3
    assert env.worlds.datas[0].model.geom("thing").size[0] > 0.59
