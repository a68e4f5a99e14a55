"""Several animals in one world: mutual visibility, learning, and ends of episodes."""

import numpy as np
import pytest
from stable_baselines3 import PPO

import sim
from tests.sim.envs.hunt import Predator, Prey, Twin, distance, hunt, still


def ahead(observation):
    """Return actions along +x at full speed."""
    return np.tile([1.0, 0.0], (len(observation["previous_action"]), 1))


def seen_last(env, action):
    """Return the poses of all worlds and the learner's observation after one step."""
    observation, *_ = env.step(np.tile(np.asarray(action, np.float32), (env.num_envs, 1)))
    return np.array([data.qpos for data in env.worlds.datas]), observation


def test_one_learns_and_the_other_acts_by_its_policy():
    env = sim.make_vec_env(hunt().alone("Prey", {"Predator": ahead}), n_envs=4)
    assert env.num_envs == 4
    assert env.observation_space["eyes"].shape == (1, 3, 3, 2, 8)  # the prey's own resolution
    assert env.observation_space["feels"].shape == (2,)
    env.reset()
    before = np.array([data.qpos for data in env.worlds.datas])
    after, _ = seen_last(env, [0, 1])
    moved = after - before
    assert (moved[:, 2] > 0.04).all()  # the predator moves along x
    assert (moved[:, 1] > 0.04).all()  # the prey moves along y
    assert np.abs(moved[:, [0, 3]]).max() < 1e-6
    idle = sim.make_vec_env(hunt().alone("Prey", {}), n_envs=4)
    idle.reset()
    assert np.abs(seen_last(idle, [0, 0])[0] - before).max() < 1e-6


class Invisible(Predator):
    """A predator in a group of geoms that is not rendered."""

    name = "Predator"
    model = Predator.model.replace('rgba=".9 .1', 'group="3" rgba=".9 .1')


class Careful(Prey):
    model = Invisible.model


def test_each_sees_the_other_through_its_own_eyes():
    """The frozen animal receives the signals of its own eyes. The learner sees the frozen animal: without it, the red
    disappears.
    """
    told = []

    def looks(observation):
        told.append({name: array.copy() for name, array in observation.items()})
        return still(observation)

    env = sim.make_vec_env(hunt().alone("Prey", {"Predator": looks}), n_envs=3, seed=2)
    first = env.reset()
    env.step(np.zeros((3, 2)))
    assert told[0]["eyes"].shape == (3, 1, 2, 3, 1, 12)
    assert told[0].keys() == {"eyes", "previous_action"}
    frozen = {k: v.copy() for k, v in told[0].items()}
    red = first["eyes"][:, 0, :, 0] - first["eyes"][:, 0, :, 2]
    assert (red.max(axis=(1, 2, 3)) > 0.1).all()
    hidden = sim.make_vec_env(sim.Encounter(Careful(), Invisible()).alone("Careful", {}), n_envs=3, seed=2)
    unseen = hidden.reset()["eyes"][:, 0]
    assert (unseen[:, :, 0] - unseen[:, :, 2]).max() < 0.1
    # The same state in the predator's own task.
    mirrored = sim.make_vec_env(hunt().alone("Predator", {}), n_envs=3, seed=2)
    mirrored.reset()
    for theirs, ours in zip(mirrored.worlds.datas, env.worlds.datas, strict=True):
        theirs.qpos[:], theirs.qvel[:] = ours.qpos, 0
    twin = mirrored.renderer.signals(_forward(mirrored))
    assert np.abs(twin - frozen["eyes"][:, 0]).max() < 0.1  # the noise is 0.01, and there was one step without motion


def _forward(env):
    import mujoco

    for data in env.worlds.datas:
        mujoco.mj_forward(env.worlds.model, data)
    return env.worlds.datas


def test_frozen_eyes_remember_what_their_policy_wants():
    learner = PPO("MultiInputPolicy", sim.make_vec_env(hunt().alone("Predator", {}), n_envs=2, memory=3), n_steps=8)
    shapes = []
    predict = learner.policy.predict

    def spied(observation, **options):
        shapes.append(observation["eyes"].shape)
        return predict(observation, **options)

    learner.policy.predict = spied
    env = sim.make_vec_env(hunt().alone("Prey", {"Predator": learner.policy}), n_envs=5)
    env.reset()
    env.step(np.zeros((5, 2)))
    assert shapes == [(5, 3, 2, 3, 1, 12)]
    blind = PPO("MlpPolicy", "Pendulum-v1", n_steps=64)
    with pytest.raises(ValueError, match=r"policy of 'Predator' takes \{\}, its task gives .*'eyes'.*: must be alike"):
        sim.make_vec_env(hunt().alone("Prey", {"Predator": blind}), n_envs=1)
    other = sim.Frozen(Twin("predator"), learner.policy)
    prey = Prey()
    prey.others = (other,)
    with pytest.raises(ValueError, match=r"policy of 'predator' takes .*, its task gives .*: must be alike"):
        sim.make_vec_env(prey, n_envs=1)


def test_an_episode_ends_for_all_when_it_ends_for_one():
    """The episode is terminated for the animal that ended it, and truncated for the other."""

    class Brave(Prey):
        name = "Prey"

        def terminated(self, data):
            return False

    def towards(observation):
        found = [np.sign(data.qpos[:2] - data.qpos[2:]) for data in env.worlds.datas]
        return np.array(found)

    env = sim.make_vec_env(sim.Encounter(Brave(), Predator()).alone("Prey", {"Predator": towards}), n_envs=6, seed=1)
    env.reset()
    done = np.zeros(6, bool)
    while not done.any():
        _, _, done, infos = env.step(np.zeros((6, 2)))
    assert env.simulation.steps.max() < Prey.episode_steps
    assert all(info["TimeLimit.truncated"] for info, over in zip(infos, done, strict=True) if over)
    assert not any("episode" in info for info, over in zip(infos, done, strict=True) if not over)


def test_worlds_with_frozen_animals_go_back_bit_for_bit():
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(12, 2)).astype(np.float32)

    def swayed(observation):
        """Return actions that depend on the signals, including noise and memory."""
        return observation["eyes"].reshape(len(observation["eyes"]), -1)[:, :12] @ directions

    def played(env, steps):
        return [env.step(np.full((3, 2), np.sin(k), np.float32))[0] for k in range(steps)]

    env = sim.make_vec_env(hunt().alone("Prey", {"Predator": swayed}), n_envs=3, seed=4, memory=2)
    env.reset()
    played(env, 5)
    state = env.get_state()
    assert {"Predator.remembered", "Predator.noise", "Predator.action", "Predator.felt"} <= state.keys()
    once = played(env, 25)
    seen = env.set_state(state)
    np.testing.assert_array_equal(seen["eyes"], state["remembered"])
    again = played(env, 25)
    for one, other in zip(once, again, strict=True):
        for name, array in one.items():
            np.testing.assert_array_equal(array, other[name])


def new_learner(env, **settings):
    return PPO("MultiInputPolicy", env, n_steps=32, learning_rate=3e-3, gamma=0.9, seed=0, **settings)


def test_both_learn_in_turn():
    """A predator learns first. Then the prey learns against that predator, which stays unchanged."""
    hunts = sim.make_vec_env(hunt().alone("Predator", {"Prey": still}), n_envs=2)
    predator = new_learner(hunts, batch_size=64, n_epochs=1).learn(64)
    weights = predator.policy.state_dict()["action_net.weight"].clone()
    flees = sim.make_vec_env(hunt().alone("Prey", {"Predator": predator}), n_envs=2)
    prey = new_learner(flees, batch_size=64, n_epochs=1).learn(128)
    assert (predator.policy.state_dict()["action_net.weight"] == weights).all()
    assert prey.num_timesteps == 128


@pytest.mark.slow
def test_a_predator_learns_to_approach():
    """A predator learns to approach prey that stands still."""
    hunts = sim.make_vec_env(hunt().alone("Predator", {"Prey": still}), n_envs=32)
    predator = new_learner(hunts, batch_size=256, n_epochs=8).learn(12_000)

    def ends_at(policy):
        observation = hunts.reset()
        for _ in range(7):  # the prey is not caught this early
            observation, *_ = hunts.step(policy(observation))
        return np.mean([distance(data) for data in hunts.worlds.datas])

    apart = ends_at(still)
    assert ends_at(lambda seen: predator.predict(seen, deterministic=True)[0]) < 0.9 * apart


def test_animals_that_are_alike_learn_one_policy():
    """The rows are the first animal of all worlds, then the second. Each row belongs to its own animal."""
    twins = sim.Encounter(Twin("prey"), Twin("predator"))
    env = sim.make_vec_env(twins, n_envs=4, seed=3, render_mode="eyes")
    assert env.num_envs == 8
    first = env.reset()
    assert first["eyes"].shape == (8, 1, 3, 3, 1, 6)
    assert len(env.get_images()) == 8
    actions = np.zeros((8, 2), np.float32)
    actions[5] = 1, 0  # the predator of the second world
    before = np.array([data.qpos for data in env.worlds.datas])
    observation, reward, _, infos = env.step(actions)
    moved = np.array([data.qpos for data in env.worlds.datas]) - before
    assert moved[1, 2] > 0.04
    assert np.abs(np.delete(moved.ravel(), 6)).max() < 1e-6
    np.testing.assert_array_equal(observation["previous_action"], actions)
    np.testing.assert_allclose(reward[:4], reward[4:])
    for _ in range(Twin.episode_steps):
        *_, done, infos = env.step(actions)
        np.testing.assert_array_equal(done[:4], done[4:])
        if done.any():
            assert all(("terminal_observation" in info) == over for info, over in zip(infos, done, strict=True))
            break
    state = env.get_state()
    env.step(actions)
    np.testing.assert_array_equal(env.set_state(state)["eyes"][:4], state["remembered"])
    PPO("MultiInputPolicy", env, n_steps=8, batch_size=64).learn(64)


def test_automatic_fidelity_is_chosen_among_the_others():
    """A predator alone sees only the floor's edge; with prey in view it needs at least the same number of rays."""
    careless = Predator()
    careless.fidelity = "auto"
    env = sim.make_vec_env(sim.Encounter(Prey(), careless).alone("Predator", {}), n_envs=1)
    alone = sim.Encounter(careless).alone("Predator", {})
    assert (
        env.renderer.fidelity.rays_per_receptor >= sim.make_vec_env(alone, n_envs=1).renderer.fidelity.rays_per_receptor
    )
    assert "moments" in env.renderer.fidelity.levels[-1].why
