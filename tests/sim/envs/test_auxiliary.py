"""Tests of auxiliary observations against MuJoCo's ray caster and the model renderer, across ends of episodes."""

import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3 import PPO

import optics
import sim
from sim.eyes.eyes import BODY_RADIUS
from sim.eyes.tangent_plane import directions_of
from sim.render.optic_flow import receptor_centres
from sim.tasks.user_tasks import with_evolved_eyes
from sim.worlds.state import pose
from tests.sim.envs.hunt import Predator, Prey
from tests.sim.envs.test_eye_kinds import Looker
from tests.sim.envs.test_task_vec_env import Face

ALL = ("depth", "ids", "flow")
EYES = sim.Eyes(n_eyes=2, resolution=(5, 7), fov_deg=80, placement_range_deg=90)


class Told(Face):
    auxiliary = ALL
    eye = optics.Eye(resolution=(6, 9), fov_deg=80, bands=4)
    episode_steps = 5


def met(model, data, eye, pupil, frame):
    """Return the depths along the axis (0 for no hit) and the ids of the geoms that MuJoCo's rays hit.

    The rays pass through the receptors' centres.
    """
    geom, centres = np.zeros(1, np.int32), directions_of(eye, receptor_centres(eye))
    found = []
    for centre in centres:
        far = mujoco.mj_ray(model, data, pupil, (frame @ centre).astype(float), None, 1, -1, geom)
        found.append((far * centre[2] if far >= 0 else 0.0, geom[0] if far >= 0 else -1))
    return (np.array(column).reshape(eye.resolution) for column in zip(*found, strict=True))


def test_own_tasks_are_told_what_mujocos_rays_meet():
    env = sim.make_vec_env(Told(), n_envs=3, seed=1)
    env.reset()
    observation = env.step(np.full((3, 1), 0.5))[0]
    pupils, frames = env.renderer.eye_frames(sim.Poses.from_data(env.worlds.datas))
    for world, data in enumerate(env.worlds.datas):
        depth, ids = met(env.worlds.model, data, Told.eye, pupils[world, 0], frames[world, 0])
        np.testing.assert_array_equal(observation["ids"][world, 0], ids)
        np.testing.assert_allclose(observation["depth"][world, 0], depth, rtol=1e-4)
    assert set(np.unique(observation["ids"])) == {-1, 0, 2}
    assert (observation["depth"] == 0).any()


def test_flow_is_of_what_is_seen_now_since_the_last_observation():
    """The flow of a distant wall is the cart's displacement since the last observation, divided by the wall's distance,
    in the opposite direction.
    """
    env = sim.make_vec_env(Told(), n_envs=2, seed=1)
    assert not env.reset()["flow"].any()
    places = [data.qpos[0] for data in env.worlds.datas]
    observation, _, _, _ = env.step(np.array([[1.0], [-0.5]]))
    eye = env.renderer.eye
    side = eye.receptor_pitch / eye.sensor_distance
    still = observation["ids"] == 0
    assert still.mean() > 0.3
    for world, data in enumerate(env.worlds.datas):
        way = data.qpos[0] - places[world]
        there, depth = still[world, 0], observation["depth"][world, 0]
        expected = way / depth[there] / side  # the cart moves to the left, and the scene to the right
        np.testing.assert_allclose(observation["flow"][world, 0, 0][there], expected, rtol=1e-3)
        np.testing.assert_allclose(observation["flow"][world, 0, 1][there], 0, atol=1e-3)
    assert np.abs(observation["flow"]).max() > 0.1
    assert not observation["flow"][observation["ids"][:, :, None].repeat(2, 2) == -1].any()


def test_nothing_flows_over_the_end_of_an_episode():
    env = sim.make_vec_env(Told(), n_envs=2, seed=1)
    env.reset()
    for _ in range(Told.episode_steps):
        observation, _, done, infos = env.step(np.ones((2, 1)))
    assert done.all()
    assert not observation["flow"].any()
    last = infos[0]["terminal_observation"]
    assert np.abs(last["flow"]).max() > 0.1
    assert np.abs(last["depth"] - observation["depth"][0]).max() > 0.1
    assert np.abs(env.step(np.ones((2, 1)))[0]["flow"]).max() > 0.1


def test_worlds_that_go_on_keep_their_flow_where_another_begins_anew():
    class Short(Told):
        def terminated(self, data):
            return data.qpos[0] > 0.05

    actions = np.array([[1.0], [-1.0]])
    flows = []
    for task in (Told(), Short()):
        env = sim.make_vec_env(task, n_envs=2, seed=1)
        env.reset()
        for _ in range(3):
            observation, _, done, _ = env.step(actions)
            flows.append((observation["flow"][1], done[0]))
    half = len(flows) // 2
    assert any(done for _, done in flows[half:])
    for (one, _), (other, _) in zip(flows[:half], flows[half:], strict=True):
        np.testing.assert_array_equal(one, other)


def test_they_come_back_with_the_worlds():
    env = sim.make_vec_env(Told(), n_envs=2, seed=1)
    env.reset()
    env.step(np.ones((2, 1)))
    held = env.get_state()
    expected = [env.step(-np.ones((2, 1)))[0] for _ in range(3)]
    env.step(np.ones((2, 1)))
    seen = env.set_state(held)
    for name in ALL:
        np.testing.assert_array_equal(seen[name], held[name])
    for one in expected:
        found = env.step(-np.ones((2, 1)))[0]
        for name in ALL:
            np.testing.assert_array_equal(found[name], one[name])


def test_spaces_hold_and_a_learner_takes_them():
    check_env(sim.make_env(Told()), skip_render_check=True)
    env = sim.make_vec_env(Told(), n_envs=4)
    shapes = {name: env.observation_space[name].shape for name in ALL}
    assert shapes == {"depth": (1, 6, 9), "ids": (1, 6, 9), "flow": (1, 2, 6, 9)}
    assert env.observation_space["ids"].dtype == np.int32
    assert env.observation_space["ids"].high.max() == env.worlds.model.ngeom - 1
    learner = PPO("MultiInputPolicy", env, n_steps=8, batch_size=16, n_epochs=1, seed=0).learn(32)
    assert np.isfinite(learner.predict(env.reset())[0]).all()


def test_each_kind_of_eyes_has_its_own():
    task = Looker()
    task.auxiliary = ("ids",)
    env = sim.make_vec_env(task, n_envs=1)
    observation = env.reset()
    poses = sim.Poses.from_data(env.worlds.datas)
    for name, sight in env.animals.learners[0].sights.items():
        np.testing.assert_array_equal(observation[f"{name}_ids"], sight.renderer.ids(poses))
    assert {name for name in observation if name.endswith(("depth", "flow"))} == set()
    task.eye = {"wide": Looker.eye["wide"], "wide_ids": Looker.eye["sharp"]}
    task.mounts = {"wide": Looker.mounts["wide"], "wide_ids": Looker.mounts["sharp"]}
    with pytest.raises(ValueError, match="kind 'wide_ids': must have another name, 'wide' has 'ids', too"):
        sim.make_vec_env(task, n_envs=1)


def test_a_frozen_policy_gets_what_its_own_task_has():
    told = []

    def policy(observation):
        told.append(observation)
        return np.zeros((2, 2), np.float32)

    predator = Predator()
    predator.auxiliary = ("depth",)
    env = sim.make_vec_env(sim.Encounter(Prey(), predator).alone("Prey", {"Predator": policy}), n_envs=2)
    observation = env.reset()
    env.step(np.zeros((2, *env.action_space.shape)))
    assert "depth" not in observation
    assert told[0]["depth"].shape[0] == 2
    learner = PPO("MultiInputPolicy", sim.make_vec_env(predator, n_envs=1, memory=2), n_steps=8, seed=0)
    assert sim.Frozen(predator, learner).memory == 2


def test_evolving_eyes_have_none():
    assert with_evolved_eyes(Told(), sim.Eyes()).auxiliary == ()


def test_rhabdoms_own_worlds_are_told_what_mujocos_rays_meet():
    env = sim.make_vec_env("detection", EYES, n_envs=6, seed=3, rays_per_receptor=1, auxiliary=ALL)
    env.reset()
    for _ in range(3):
        observation = env.step(np.random.default_rng(0).uniform(-1, 1, (6, 2)))[0]
    world, eye = env.worlds.world, EYES.eye()
    data, azimuths = mujoco.MjData(world.model), EYES.azimuths()
    seen, near = [], []
    for k in range(6):
        pose(data, world, env.state, k)
        turned = data.body("agent").xmat.reshape(3, 3)
        for e, azimuth in enumerate(azimuths):
            ahead = np.array([np.cos(azimuth), np.sin(azimuth), 0])
            frame = turned @ np.column_stack([[ahead[1], -ahead[0], 0], [0, 0, 1], ahead])
            pupil = data.body("agent").xpos + turned @ ahead * BODY_RADIUS * (1 + 1e-4)
            depth, ids = met(world.model, data, eye, pupil, frame)
            seen.append(observation["ids"][k, e] == ids)
            near.append(np.abs(observation["depth"][k, e] - depth) < 1e-3 * np.maximum(depth, 0.1))
    assert np.mean(seen) > 0.995
    assert np.mean(near) > 0.995
    assert len(np.unique(observation["ids"])) > 3


def test_rhabdoms_own_worlds_flow_by_the_way_of_the_agent():
    """Distant surfaces flow by the agent's angle of rotation, whatever their distance, when the agent turns on the
    spot.
    """
    eyes = sim.Eyes(n_eyes=1, resolution=(1, 41), fov_deg=60)
    env = sim.make_vec_env("detection", eyes, n_envs=2, rays_per_receptor=1, auxiliary=("flow", "depth"))
    assert not env.reset()["flow"].any()
    observation = env.step(np.array([[-1.0, 0.2], [-1.0, 0.2]]))[0]
    turned, eye = 0.2 * np.pi / 4, eyes.eye()
    side = eye.receptor_pitch / eye.sensor_distance
    # The pupil is BODY_RADIUS ahead of the agent's axis of rotation.
    depth = observation["depth"][0, 0, 0, 20]
    x, z = (depth + BODY_RADIUS) * np.sin(-turned), (depth + BODY_RADIUS) * np.cos(turned) - BODY_RADIUS
    assert observation["flow"][0, 0, 0, 0, 20] == pytest.approx(-x / z / side, rel=1e-3)
    assert not env.reset()["flow"].any()


def test_positions_of_states_are_those_of_mujoco():
    env = sim.make_vec_env("tracking", EYES, n_envs=5, rays_per_receptor=1)
    env.reset()
    env.step(np.random.default_rng(1).uniform(-1, 1, (5, 2)))
    world, datas = env.worlds.world, []
    for k in range(5):
        datas.append(mujoco.MjData(world.model))
        pose(datas[-1], world, env.state, k)
    found, expected = env.worlds.poses(), sim.Poses.from_data(datas)
    for name in ("geom_xpos", "geom_xmat", "xpos", "xmat"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-12)


def test_rhabdoms_own_worlds_and_ends_of_episodes():
    env = sim.make_vec_env("foraging", EYES, n_envs=2, rays_per_receptor=1, auxiliary=ALL, episode_steps=3)
    env.reset()
    for _ in range(3):
        observation, _, done, infos = env.step(np.ones((2, 2)))
    assert done.all()
    assert not observation["flow"].any()
    assert np.abs(infos[1]["terminal_observation"]["flow"]).max() > 0.1
    check_env(sim.make_env("foraging", EYES, rays_per_receptor=1, auxiliary=ALL), skip_render_check=True)


@pytest.mark.parametrize(
    ("auxiliary", "said"),
    [
        (("dept",), "auxiliary: 'dept'; did you mean 'depth'?"),
        ("depth", r"auxiliary = 'depth': must be several names, such as \('depth',\)"),
        (("normals",), "auxiliary: 'normals': must be of 'depth', 'ids', 'flow'"),
    ],
)
def test_other_names_are_refused(auxiliary, said):
    with pytest.raises(ValueError, match=said):
        sim.make_vec_env("detection", EYES, auxiliary=auxiliary)
    task = Told()
    task.auxiliary = auxiliary
    with pytest.raises(ValueError, match=f"Told: {said}"):
        sim.make_vec_env(task, n_envs=1)
