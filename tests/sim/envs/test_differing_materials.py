"""Geoms with different materials in the worlds of one batch look as in a model that is compiled with these
materials.
"""

import functools
import gc

import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import sim
from sim.tasks.task_fidelity import fidelities_of
from tests.sim.envs.rail import EYE, OnRail

MATERIALS = "plain", "dark", "stripes", "cubic", "glowing"
ROOM = """
<mujoco>
  <visual><headlight active="0"/></visual>
  <option timestep=".01"/>
  <asset>
    <texture name="stripes" type="2d" builtin="checker" rgb1=".9 .9 .3" rgb2=".2 .2 .2" width="32" height="32"/>
    <texture name="cubic" type="cube" builtin="checker" rgb1=".1 .7 .2" rgb2=".9 .2 .8" width="16" height="16"/>
    <material name="plain" rgba=".9 .2 .1 1"/>
    <material name="dark" rgba=".05 .1 .2 1"/>
    <material name="stripes" texture="stripes" texrepeat="4 4" rgba=".6 1 .8 1"/>
    <material name="cubic" texture="cubic"/>
    <material name="glowing" rgba=".2 .9 .4 1" emission=".6"/>
    <material name="unseen" rgba="1 1 1 0"/>
  </asset>
  <worldbody>
    <light type="directional" dir="-.3 -.4 -1" diffuse=".9 .9 .9"/>
    <geom name="floor" type="plane" size="6 3 .1" {floor}/>
    <body name="cart" pos="0 0 .4">
      <joint name="rail" type="slide" axis="0 1 0" damping="1"/>
      <geom type="box" size=".15 .2 .1" rgba=".2 .4 .8 1" mass="1"/>
    </body>
    <body pos="2 0 .6"><freejoint/><geom name="thing" type="{kind}" size="{size}" {thing}/></body>
  </worldbody>
  <actuator><velocity joint="rail" kv="10" ctrlrange="-2 2"/></actuator>
</mujoco>"""
GREY = 'rgba=".3 .3 .3 1"'
SIZES = {"sphere": ".3", "cylinder": ".2 .3", "box": ".2 .3 .1"}


def room(thing="", floor=GREY, kind="sphere"):
    return ROOM.format(thing=thing, floor=floor, kind=kind, size=SIZES[kind])


class Room(OnRail):
    model = room()


def with_ranges(vary, model=None, light="direct"):
    task = Room()
    task.vary, task.model, task.fidelity = vary, model or room(), sim.Fidelity(4, bands=5, light=light)
    return task


def built(data, light="direct", **how):
    """Return the signals of a model that is compiled with these settings, in the state of a world."""
    renderer = _renderer(light, room(**how))
    same = mujoco.MjData(renderer.model)
    same.qpos[:], same.qvel[:] = data.qpos, data.qvel
    mujoco.mj_forward(renderer.model, same)
    return renderer.signals([same])[0]


@functools.cache
def _renderer(light, text):
    return sim.ModelRenderer(text, EYE, Room.mounts, 1, sim.Fidelity(4, bands=5, light=light))


def material_of(data, geom="thing"):
    return data.model.material(int(data.model.geom_matid[data.model.geom(geom).id])).name


@pytest.mark.fast_cases(2)
@pytest.mark.filterwarnings("ignore::sim.MirrorWarning")
@pytest.mark.parametrize(("kind", "light"), [*((kind, "direct") for kind in SIZES), ("sphere", "bounce")])
def test_eyes_see_what_a_model_sees_that_is_built_so(kind, light):
    """Signals agree also after the end of an episode. The cases include bounced light and glowing materials, which
    light the floor.
    """
    task = with_ranges({"thing.material": MATERIALS}, room(kind=kind), light)
    # otherwise Mitsuba objects left by earlier tests die during the recording, and the kernel is recorded again
    gc.collect()
    env = sim.make_vec_env(task, n_envs=8, seed=2)
    seen, infos, met = env.reset()["eyes"], env.reset_infos, set()
    for _ in range(2):
        for world, data in enumerate(env.worlds.datas):
            drawn = infos[world]["varied"]["thing.material"]
            assert material_of(data) == drawn
            expected = built(data, light, thing=f'material="{drawn}"', kind=kind)
            np.testing.assert_allclose(seen[world, 0], expected, atol=2e-6, err_msg=drawn)
            met.add(drawn)
        for _ in range(Room.episode_steps + 1):  # one step into the next episode
            observation, _, dones, infos = env.step(np.ones((8, 1)))
        seen = observation["eyes"]
        assert not dones.any()
    assert met == set(MATERIALS)
    assert env.renderer.recordings <= 3, "all worlds share one kernel"


@pytest.mark.filterwarnings("ignore::sim.MirrorWarning")
def test_a_floor_that_stands_still_may_differ():
    """The floor is intersected like a moving geom: one ray in a thousand, at its rim or at the edge of a stripe, falls
    on the other side.
    """
    env = sim.make_vec_env(with_ranges({"floor.material": MATERIALS[:4]}, room(floor="")), n_envs=6, seed=1)
    seen = env.reset()["eyes"]
    for world, info in enumerate(env.reset_infos):
        drawn = info["varied"]["floor.material"]
        expected = built(env.worlds.datas[world], floor=f'material="{drawn}"')
        off = np.abs(seen[world, 0] - expected)
        assert (off > 1e-5).mean() < 0.01
    assert len({info["varied"]["floor.material"] for info in env.reset_infos}) > 2


@pytest.mark.filterwarnings("ignore::sim.MirrorWarning")
def test_depth_ids_and_shadows_are_of_the_one_that_is_drawn():
    """A geom with an invisible material has no depth, no id and no shadow."""
    env = sim.make_vec_env(with_ranges({"thing.material": ("cubic", "unseen", "plain")}), n_envs=9, seed=0)
    seen, poses = env.reset()["eyes"], sim.Poses.from_data(env.worlds.datas)
    thing, shares = env.worlds.model.geom("thing").id, {}
    for world, (ids, depth) in enumerate(zip(env.renderer.ids(poses), env.renderer.depth(poses), strict=True)):
        drawn = material_of(env.worlds.datas[world])
        shares.setdefault(drawn, []).append((ids == thing).mean())
        assert (depth[0, 7, 10] > 2) == (drawn == "unseen")
    assert max(shares["unseen"]) == 0
    np.testing.assert_allclose(shares["plain"] + shares["cubic"], shares["plain"][0], rtol=0.1)
    assert shares["plain"][0] > 0.01
    unseen = next(w for w, data in enumerate(env.worlds.datas) if material_of(data) == "unseen")
    expected = built(env.worlds.datas[unseen], thing='rgba="1 1 1 0"')
    np.testing.assert_allclose(seen[unseen, 0], expected, atol=2e-6)


def test_all_are_drawn_alike():
    task = with_ranges({"thing.material": ("plain", "dark", "stripes")})
    env = sim.make_vec_env(task, n_envs=600, seed=3)
    env.simulation.restart(np.arange(600))
    found = np.unique(env.simulation.varied["thing.material"], return_counts=True)
    assert list(found[0]) == ["dark", "plain", "stripes"]
    assert (np.abs(found[1] - 200) < 4 * np.sqrt(600 * 2 / 9)).all(), "more than four standard deviations"


def test_sizes_may_differ_with_materials_that_have_no_texture():
    task = with_ranges({"thing.size": (0.5, 2.0), "thing.material": ("plain", "dark")})
    env = sim.make_vec_env(task, n_envs=4, seed=4)
    seen = env.reset()["eyes"]
    for world, data in enumerate(env.worlds.datas):
        text = room(thing=f'material="{material_of(data)}"').replace(
            'size=".3"', f'size="{data.model.geom_size[2, 0]}"'
        )
        model = mujoco.MjModel.from_xml_string(text)
        same = mujoco.MjData(model)
        mujoco.mj_forward(model, same)
        expected = sim.ModelRenderer(model, EYE, Room.mounts, 1, Room.fidelity).signals([same])[0]
        np.testing.assert_allclose(seen[world, 0], expected, atol=2e-6)
    assert {material_of(data) for data in env.worlds.datas} == {"plain", "dark"}


def test_states_have_the_materials_with_them():
    task = with_ranges({"thing.material": MATERIALS[:4], "light": (0.5, 1.0)})
    env, other = (sim.make_vec_env(task, n_envs=4, seed=seed) for seed in (5, 9))
    env.reset()
    other.reset()
    held, drawn = env.get_state(), [material_of(data) for data in env.worlds.datas]
    expected = [env.step(np.ones((4, 1)))[0]["eyes"] for _ in range(5)]
    assert [material_of(data) for data in other.worlds.datas] != drawn
    for one in (env, other):
        one.set_state(held)
        assert [material_of(data) for data in one.worlds.datas] == drawn
        for frame in expected:
            np.testing.assert_array_equal(one.step(np.ones((4, 1)))[0]["eyes"], frame)
    held["varied.thing.material"][1] = "soot"
    with pytest.raises(ValueError, match=r"thing.material = 'soot': must be one of plain, dark, stripes, cubic"):
        env.set_state(held)


def test_one_world_and_another_number_of_worlds_see_the_same():
    vary = {"thing.material": ("plain", "stripes"), "floor.color": ((0, 0, 0), (1, 1, 1))}
    seen = [sim.make_vec_env(with_ranges(vary), n_envs=n, seed=5).reset()["eyes"][0] for n in (1, 4)]
    np.testing.assert_array_equal(*seen)
    check_env(sim.make_env(with_ranges(vary)), skip_render_check=True)
    task = with_ranges(vary)
    task.fidelity = "auto"
    assert fidelities_of(task)["eyes"].rays_per_receptor >= 1


def test_pictures_for_people_show_them():
    """Renderings for people show the materials of the current episode."""

    def worlds(**how):
        one = Room()
        for name, value in how.items():
            setattr(one, name, value)
        return sim.make_vec_env(one, n_envs=1, seed=0, render_mode="rgb_array")

    env, shown = worlds(vary={"thing.material": ("cubic", "plain")}), {}
    while len(shown) < 2:
        env.reset()
        shown[material_of(env.worlds.datas[0])] = env.get_images()[0].astype(int)
    assert np.abs(shown["cubic"] - shown["plain"]).max() > 50
    for material, picture in shown.items():
        other = worlds(model=room(thing=f'material="{material}"'))
        other.reset()
        np.testing.assert_allclose(picture, other.get_images()[0].astype(int), atol=1)


def test_renderers_take_the_materials_of_datas_own_models():
    """Renderers also follow the materials without a task, and refuse materials for which they were not built."""
    model = mujoco.MjModel.from_xml_string(room(thing='material="plain"'))
    models = [mujoco.MjModel.from_xml_string(room(thing=f'material="{m}"')) for m in ("plain", "stripes")]
    datas = [mujoco.MjData(each) for each in models]
    for each, data in zip(models, datas, strict=True):
        mujoco.mj_forward(each, data)
    how = model, EYE, Room.mounts, 2, Room.fidelity
    with pytest.raises(ValueError, match="geom 'thing' differs in material from the renderer's model: must be in `"):
        sim.ModelRenderer(*how).signals(datas)
    seen = sim.ModelRenderer(*how, varied={"thing": ("plain", "stripes")}).signals(datas)
    np.testing.assert_allclose(seen[1], built(datas[1], thing='material="stripes"'), atol=2e-6)
    with pytest.raises(ValueError, match="geom 'thing' has a material other than"):
        sim.ModelRenderer(*how, varied={"thing": ("plain", "dark")}).signals(datas)
    with pytest.raises(ValueError, match="varied: geom 'thing': the model has no material 'drak'; did you mean 'dark'"):
        sim.ModelRenderer(*how, varied={"thing": ("plain", "drak")})


@pytest.mark.parametrize(
    ("vary", "said"),
    [
        (
            {"thing.material": ("plain", "strips")},
            "thing.material: the model has no material 'strips'; did you mean 's",
        ),
        ({"thimg.material": ("plain",)}, "thimg.material: the model has no geom 'thimg'; did you mean 'thing'?"),
        ({"thing.material": ()}, r"thing.material = \(\): must be \(name, name, ...\), materials, each of them once"),
        ({"thing.material": "plain"}, "thing.material = 'plain': must be"),
        ({"thing.material": ("plain", "plain")}, "each of them once"),
        (
            {"thing.material": ("plain",), "thing.color": ((0, 0, 0), (1, 1, 1))},
            "must be one of them; materials have c",
        ),
        (
            {"thing.material": ("plain", "stripes"), "thing.size": (1, 2)},
            "thing.size: must be a sphere, .* without a t",
        ),
        ({"floor.material": ("plain",)}, "floor.material: the geom's own rgba replaces the colours of its materials"),
    ],
)
def test_what_cannot_differ_is_refused(vary, said):
    with pytest.raises(ValueError, match=f"vary: .*{said}"):
        sim.make_vec_env(with_ranges(vary), n_envs=1)


def test_what_differs_in_size_keeps_the_colour_of_its_material():
    env = sim.make_vec_env(with_ranges({"thing.size": (1, 1)}, room('material="plain"')), n_envs=1)
    env.reset()
    (seen,) = env.renderer.signals(env.worlds.datas)
    assert seen == pytest.approx(built(env.worlds.datas[0], thing='material="plain"'), abs=1e-5)
    red, _, blue = seen.reshape(3, -1)
    assert (red > 2 * blue + 0.1).any()
