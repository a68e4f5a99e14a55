"""User tasks: a cart on a rail that moves to the position of a visible ball, and errors in other users' code."""

import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3 import PPO

import optics
import sim

CART = """
<mujoco>
  <visual><headlight active="0"/></visual>
  <option timestep=".02"/>
  <worldbody>
    <light type="directional" dir="-.3 -.4 -1" diffuse=".9 .9 .9"/>
    <geom type="plane" size="6 3 .1" rgba=".3 .3 .3 1"/>
    <body name="cart" pos="0 0 .2">
      <joint name="rail" type="slide" axis="0 1 0" damping="1"/>
      <geom type="box" size=".15 .2 .1" rgba=".2 .4 .8 1" mass="1"/>
    </body>
    <body name="ball" mocap="true" pos="2 0 .3"><geom size=".3" rgba=".9 .2 .1 1" contype="0" conaffinity="0"/></body>
  </worldbody>
  <actuator><velocity joint="rail" kv="10" ctrlrange="-2 2"/></actuator>
</mujoco>"""


class Face(sim.Task):
    """A task in which a cart on a rail moves to the position of a ball ahead of it."""

    model = CART
    eye = optics.Eye(resolution=(2, 16), fov_deg=120, bands=4)
    mounts = (sim.Mount("cart", offset=(0.2, 0, 0.1)),)
    fidelity = sim.Fidelity(2, bands=4)
    episode_steps = 40

    def reset(self, data, rng):
        data.mocap_pos[0, 1] = rng.uniform(-2, 2)

    def rewards(self, data):
        return {"near": -abs(data.mocap_pos[0, 1] - data.qpos[0]) / 10}

    def succeeded(self, data):
        return abs(data.mocap_pos[0, 1] - data.qpos[0]) < 0.3


@pytest.mark.slow
def test_ppo_learns_to_go_by_sight():
    """A cart that stays in the middle faces the ball in 0.15 of the episodes: 0.6 m of 4 m."""
    env = sim.make_vec_env(Face(), n_envs=32)
    learner = PPO(
        "MultiInputPolicy", env, n_steps=64, batch_size=512, learning_rate=1e-3, n_epochs=8, gamma=0.9, seed=0
    )
    learner.learn(16_000)
    observation = env.reset()
    for _ in range(Face.episode_steps - 1):
        observation, _, _, infos = env.step(learner.predict(observation, deterministic=True)[0])
    assert np.mean([info["is_success"] for info in infos]) > 0.9
    blind = {**observation, "eyes": np.zeros_like(observation["eyes"])}
    env.reset()
    for _ in range(Face.episode_steps - 1):
        _, _, _, infos = env.step(learner.predict(blind, deterministic=True)[0])
    assert np.mean([info["is_success"] for info in infos]) < 0.5


def test_worlds_depend_on_seed_and_number_alone():
    def episode(n, seed):
        env = sim.make_vec_env(Face(), n_envs=n, seed=seed)
        seen = [env.reset()["eyes"][0]]
        for k in range(45):  # past the end of an episode
            seen.append(env.step(np.full((n, 1), np.sin(k), np.float32))[0]["eyes"][0])
        return np.array(seen)

    alone = episode(1, 3)
    np.testing.assert_array_equal(alone, episode(5, 3))
    assert np.abs(alone - episode(1, 4)).max() > 0.1
    later = sim.make_vec_env(Face(), n_envs=1, seed=None)
    later.seed(3)
    np.testing.assert_array_equal(later.reset()["eyes"][0], alone[0])


def test_episodes_end_and_begin_as_stable_baselines_has_it():
    env = sim.make_vec_env(Face(), n_envs=2, memory=3)
    first = env.reset()
    assert first["eyes"].shape == (2, 3, 1, 3, 2, 16)
    returns = np.zeros(2)
    for k in range(Face.episode_steps):
        observation, reward, done, infos = env.step(np.zeros((2, 1)))
        returns += reward
        assert done.all() == (k == Face.episode_steps - 1)
    for world, info in enumerate(infos):
        assert info["TimeLimit.truncated"]
        assert info["episode"]["r"] == pytest.approx(returns[world], rel=1e-5)
        assert info["episode"]["l"] == Face.episode_steps
        last, new = info["terminal_observation"]["eyes"], observation["eyes"][world]
        assert np.ptp(last[-1] - last[0]) > 0  # noise differs between frames
        np.testing.assert_array_equal(new[0], new[2])  # the memory of a new episode is filled with its first frame
        assert np.abs(new[2] - last[2]).max() > 0.05


def test_one_world_is_a_gymnasium_environment():
    env = sim.make_env(Face(), render_mode="rgb_array")
    check_env(env, skip_render_check=True)
    env.reset(seed=1)
    picture = env.render()
    assert picture.shape == (360, 480, 3)
    env.step(np.ones(1))
    assert np.abs(env.render().astype(int) - picture).max() > 30
    assert sim.make_env(Face(), render_mode="eyes").render_mode == "eyes"


class Feeling(Face):
    def proprioception(self, data):
        return data.qvel


def test_what_is_felt_is_observed():
    env = sim.make_vec_env(Feeling(), n_envs=2)
    env.reset()
    observation = env.step(np.array([[1.0], [-1.0]]))[0]
    assert env.observation_space["feels"].shape == (1,)
    assert observation["feels"][0, 0] > 0 > observation["feels"][1, 0]
    np.testing.assert_array_equal(observation["previous_action"], [[1], [-1]])


class Failing(Face):
    def rewards(self, data):
        return {"near": 1 / int(data.mocap_pos[0, 1] > 0)}


class Unpaid(Face):
    def rewards(self, data):
        return 0.5


class NotFinite(Face):
    def rewards(self, data):
        return {"near": np.nan}


@pytest.mark.parametrize(
    ("task", "words"),
    [
        (Failing, "rewards, line .* of test_task_vec_env.py: ZeroDivisionError: division by zero"),
        (Unpaid, "rewards returned 0.5: must be numbers by name"),
        (NotFinite, "rewards: 'near' is nan: must be one finite number"),
    ],
)
def test_a_failing_method_ends_its_world_and_the_others_go_on(task, words):
    env = sim.make_vec_env(task(), n_envs=8)
    env.reset()
    fails = np.array([data.mocap_pos[0, 1] <= 0 for data in env.worlds.datas]) if task is Failing else np.ones(8, bool)
    with pytest.warns(UserWarning, match=words):
        _, reward, done, infos = env.step(np.zeros((8, 1)))
    np.testing.assert_array_equal(done, fails)
    for failed, info, r in zip(fails, infos, reward, strict=True):
        assert ("failure" in info) == failed
        # otherwise learners bootstrap from the first state of the new episode
        assert info.get("TimeLimit.truncated") == (False if failed else None)
        assert r == (0 if failed else 1)


def test_nothing_happens_before_the_first_reset():
    env = sim.make_vec_env(Face(), n_envs=2, render_mode="eyes")
    for early in (lambda: env.step(np.zeros((2, 1))), env.get_images, env.get_state):
        with pytest.raises(RuntimeError, match="call reset first"):
            early()
    single = sim.make_env(Face())
    with pytest.raises(RuntimeError, match="call reset first"):
        _ = single.state
    single.reset()
    assert single.state[0].qpos.shape == (1,)


def test_actions_and_physics_that_are_not_finite():
    env = sim.make_vec_env(Face(), n_envs=3)
    env.reset()
    with pytest.warns(UserWarning, match="action is not finite"):
        observation, _, done, infos = env.step(np.array([[7], [np.nan], [0]]))
    np.testing.assert_array_equal(done, [False, True, False])
    assert infos[1]["terminal_observation"]["previous_action"] == 0
    np.testing.assert_array_equal(observation["previous_action"], [[1], [0], [0]])
    env.worlds.datas[2].qvel[:] = np.nan
    with pytest.warns(UserWarning, match="physics is unstable"):
        observation, _, done, infos = env.step(np.zeros((3, 1)))
    assert "failure" in infos[2]
    assert np.isfinite(observation["eyes"]).all()


class NoModel(sim.Task):
    pass


class NoRewards(sim.Task):
    model, mounts = Face.model, Face.mounts

    def reward(self, data):  # a misspelt name of the method
        return {"progress": 0.1}


class NoCamera(Face):
    camera = "fromt"


class NoActuators(Face):
    model = '<mujoco><worldbody><body name="cart"><joint/><geom size=".1"/></body></worldbody></mujoco>'


class NoMounts(Face):
    mounts = ()


class NoSubsteps(Face):
    substeps = 0


class FailingReset(Face):
    def reset(self, data, rng):
        raise KeyError("nothing")


@pytest.mark.parametrize(
    ("task", "options", "error", "words"),
    [
        (NoModel, {}, ValueError, "NoModel: model: must be set"),
        (NoRewards, {}, ValueError, "NoRewards: rewards: must be defined, to return numbers by name"),
        (lambda: Face, {}, ValueError, r"task is the class Face: must be an instance, such as Face\(\)"),
        (NoCamera, {}, ValueError, "NoCamera: no camera 'fromt'; the model has"),
        (NoActuators, {}, ValueError, "NoActuators: its model has no actuators"),
        (NoMounts, {}, ValueError, "mounts = .*must contain at least one sim.Mount"),
        (NoSubsteps, {}, ValueError, "NoSubsteps: substeps = 0: must be a whole number"),
        (FailingReset, {}, RuntimeError, "reset, line .* of test_task_vec_env.py: KeyError: 'nothing'"),
        (
            Face,
            {"eyes": sim.Eyes()},
            ValueError,
            "eyes = .*: must be left out, a user task defines its eyes by its settings eye and mounts",
        ),
        (Face, {"n_envs": 0}, ValueError, "n_envs = 0: must be a whole number"),
        (Face, {"render_mode": "ascii"}, ValueError, "render_mode = 'ascii': must be one of"),
    ],
)
def test_bad_tasks_are_named(task, options, error, words):
    with pytest.raises(error, match=words):
        sim.make_vec_env(task(), **{"n_envs": 2, **options})


class Seen(Face):
    """A task with its own camera, and named colours that spectra can replace."""

    model = (
        CART.replace("<worldbody>", '<asset><material name="red" rgba=".9 .2 .1 1"/></asset><worldbody>')
        .replace('size=".3" rgba=".9 .2 .1 1"', 'size=".3" material="red"')
        .replace("<body name=", '<camera name="above" pos="0 0 6"/><body name=', 1)
    )


@pytest.mark.parametrize(
    ("field", "value", "where"),
    [
        ("substeps", 9, "eyes"),
        ("fidelity", sim.Fidelity(9, bands=4), "eyes"),
        ("eye", optics.Eye(resolution=(2, 16), fov_deg=60, bands=4), "eyes"),
        ("mounts", (sim.Mount("cart", azimuth_deg=20, offset=(0.2, 0, 0.1)),), "eyes"),
        ("spectra", {"red": optics.Spectrum((400.0, 700.0), (0.5, 0.5))}, "eyes"),
        ("camera", "above", "picture"),
    ],
)
def test_every_field_moves_what_is_seen(field, value, where):
    """Noise is the same in both environments, so that the field causes all differences."""
    found = []
    for task in (Seen(), Seen()):
        if found:
            setattr(task, field, value)
        env = sim.make_vec_env(task, n_envs=1, render_mode="rgb_array")
        env.reset()
        observation = env.step(np.ones((1, 1)))[0]
        found.append(observation["eyes"] if where == "eyes" else env.get_images()[0].astype(float))
    assert np.abs(found[1] - found[0]).max() > 0.01


def test_actuators_are_driven_over_their_range():
    task, model = Face(), mujoco.MjModel.from_xml_string(CART)
    data = mujoco.MjData(model)
    for action, control in ((-1, -2), (0, 0), (0.5, 1)):
        task.act(data, np.array([action]))
        assert data.ctrl[0] == pytest.approx(control)
