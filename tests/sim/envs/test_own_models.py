"""Changes that a task makes to one world's model stay in that world, last for the episode, and are restored with its
state.
"""

from typing import ClassVar

import mujoco
import numpy as np
import pytest

import sim
from tests.sim.envs.rooms import Room, room, with_ranges
from tests.sim.envs.test_task_state import played, same
from tests.sim.envs.test_task_vec_env import CART, Face

FALLING = CART.replace(
    '<body name="ball"',
    '<body name="stone" pos="0 3 500"><freejoint/><geom size=".1"/></body><body name="ball"',
).replace("<option ", '<option integrator="Euler" ')


class Weighed(Face):
    """A task in which each episode has its own gravity, and a rail whose damping is scaled by 0.5 to 2."""

    model = FALLING
    episode_steps = 6

    def reset(self, data, rng):
        super().reset(data, rng)
        data.model.opt.gravity[2] = -rng.uniform(1, 20)
        data.model.dof_damping[0] *= rng.uniform(0.5, 2)


def gravities(env):
    return np.array([data.model.opt.gravity[2] for data in env.worlds.datas])


def test_each_world_falls_by_its_own_gravity_also_while_others_begin_anew():
    """After k steps of length h of the semi-implicit Euler method, a body has fallen g h² k (k + 1) / 2."""
    env = sim.make_vec_env(Weighed(), n_envs=3, seed=1)
    env.reset()
    drawn, steps = gravities(env), np.zeros(3, int)
    assert np.ptp(drawn) > 1
    for step in range(10):
        if step == 2:
            env.simulation.steps[1] = 5  # this world restarts at once
        *_, done, _ = env.step(np.zeros((3, 1)))
        steps = np.where(done, 0, steps + Weighed.substeps)
        kept = gravities(env) == drawn
        np.testing.assert_array_equal(kept, ~done)
        drawn = gravities(env)
        fallen = [500 - data.body("stone").xpos[2] for data in env.worlds.datas]
        np.testing.assert_allclose(fallen, -drawn * 0.02**2 * steps * (steps + 1) / 2, atol=1e-9)


def test_a_factor_is_of_the_models_own_value():
    """The factor applies to the compiled value, not to that of the last episode: after many episodes it is still
    between 0.5 and 2.
    """
    env = sim.make_vec_env(Weighed(), n_envs=2, seed=0)
    found = []
    for _ in range(40):
        env.reset()
        found += [data.model.dof_damping[0] for data in env.worlds.datas]
    assert 0.5 <= min(found) < 0.6
    assert 1.9 < max(found) <= 2


def test_episodes_depend_on_seed_and_number_alone():
    """A single world and the first of three worlds have the same episodes, also after other episodes."""
    alone, among = (sim.make_vec_env(Weighed(), n_envs=n, seed=5) for n in (1, 3))

    def heights(env):
        env.seed(5)
        env.reset()
        actions = np.zeros((env.num_envs, 1))
        return [env.worlds.datas[0].body("stone").xpos[2] for _ in range(15) if env.step(actions)]

    first = heights(alone)
    assert heights(among) == first
    assert heights(among) == first
    assert np.ptp(first) > 0.1


def test_a_state_holds_what_was_changed():
    """After a restore, in the same environment or in another one, all values are the same, including gravity."""
    env, other = (sim.make_vec_env(Weighed(), n_envs=3, seed=seed) for seed in (2, 3))
    env.reset()
    other.reset()
    played(env, 4, 0)
    state, then = env.get_state(), gravities(env)
    future = played(env, 15, 1)
    for again in (env, other):
        again.set_state(state)
        np.testing.assert_array_equal(gravities(again), then)
        assert same(future, played(again, 15, 1))


def test_environments_of_one_compiled_model_do_not_share_it():
    task = Weighed()
    task.model = mujoco.MjModel.from_xml_string(FALLING)
    one, other = (sim.make_vec_env(task, n_envs=2, seed=seed) for seed in (0, 1))
    one.reset()
    before = gravities(one)
    other.reset()
    np.testing.assert_array_equal(gravities(one), before)
    assert task.model.opt.gravity[2] == -9.81


class Late(Face):
    """A task that changes the model during an episode of one world, but not during the trial."""

    def act(self, data, action):
        super().act(data, action)
        if action[0] > 0.9:
            data.model.geom_friction[0, 0] = 0.1


class LateReset(Face):
    def reset(self, data, rng):
        if rng.uniform() < 0.4:
            data.model.opt.timestep = 0.01


def test_what_comes_too_late_for_a_model_of_its_own_is_refused():
    env = sim.make_vec_env(Late(), n_envs=2)
    env.reset()
    env.step(np.zeros((2, 1)))
    words = "{} of data.model has changed, and all worlds share it: must be changed by the first `reset`, too"
    with pytest.raises(RuntimeError, match=f"Late: {words.format('geom_friction')}") as refused:
        env.step(np.array([[0.0], [1.0]]))
    assert "\n" not in str(refused.value)
    late = sim.make_vec_env(LateReset(), n_envs=32, seed=0)
    assert late.simulation.streams.episodes[0].uniform() > 0.4
    with pytest.raises(RuntimeError, match=f"LateReset: {words.format('opt.timestep')}"):
        late.reset()


def test_an_only_world_may_be_changed_at_any_time():
    """A single world has its own model after the change. The next episode starts from the compiled model, and states
    contain the change, in this environment and in another one.
    """
    env, other = (sim.make_vec_env(Late(), n_envs=1) for _ in range(2))
    env.reset()
    other.reset()
    before = env.get_state()
    env.step(np.ones((1, 1)))
    data = env.worlds.datas[0]
    assert data.model.geom_friction[0, 0] == 0.1
    state = env.get_state()
    env.reset()
    assert data.model.geom_friction[0, 0] == 1.0
    for again in (env, other):
        again.set_state(state)
        assert again.worlds.datas[0].model.geom_friction[0, 0] == 0.1
        again.set_state(before)
        assert again.worlds.datas[0].model.geom_friction[0, 0] == 1.0


class Painted(Face):
    """A task that always paints the ball and turns on the light, and optionally changes physics."""

    heavy = False

    def reset(self, data, rng):
        super().reset(data, rng)
        data.model.geom_rgba[data.model.body("ball").geomadr[0]] = [0.1, 0.9, 0.2, 1]
        data.model.vis.headlight.active = 1
        data.model.vis.headlight.diffuse[:] = 0.9
        if self.heavy:
            data.model.opt.gravity[2] = -rng.uniform(1, 20)


@pytest.mark.parametrize("heavy", [False, True])
def test_what_a_task_paints_once_for_all_is_seen_in_one_world_and_in_several(heavy):
    task = Painted()
    task.heavy = heavy
    seen = [sim.make_vec_env(task, n_envs=n, seed=4).reset()["eyes"][0] for n in (1, 3)]
    np.testing.assert_array_equal(*seen)
    plain = sim.make_vec_env(Face(), n_envs=1, seed=4).reset()["eyes"][0]
    assert np.abs(seen[0] - plain).max() > 0.1


def test_who_changes_nothing_shares_one_model():
    env = sim.make_vec_env(Face(), n_envs=3)
    assert len({id(data.model) for data in env.worlds.datas} | {id(env.worlds.model)}) == 1


@pytest.mark.parametrize("floor", ['rgba="1 0 0 1"', 'material="green"'])
def test_the_grey_that_mujoco_takes_for_no_colour_is_a_colour_where_it_is_drawn(floor):
    """MuJoCo treats this grey as "no colour". A drawn grey is still a colour, whether the geom has a material
    or not.
    """
    text = room(floor=floor).replace("<asset>", '<asset><material name="green" rgba="0 1 0 1"/>')
    seen = []
    for grey in (0.5, 0.5 + 1e-6):
        env = sim.make_vec_env(with_ranges({"floor.color": ((grey,) * 3, (grey,) * 3)}, text), n_envs=2)
        seen.append(env.reset()["eyes"])
    np.testing.assert_allclose(*seen, atol=1e-5)


def test_who_changes_a_colour_to_that_grey_sees_it():
    """A task may set this grey. For a geom without a material, MuJoCo shows the same colour."""

    class Grey(Room):
        vary: ClassVar = {"floor.color": ((1, 0, 0), (1, 0, 0))}
        model = room(floor='rgba="1 0 0 1"')
        grey = 0.5

        def reset(self, data, rng):
            super().reset(data, rng)
            data.model.geom("floor").rgba[:3] = self.grey

    seen = []
    for grey in (0.5, 0.5 + 1e-6):
        task = Grey()
        task.grey = grey
        seen.append(sim.make_vec_env(task, n_envs=2).reset()["eyes"])
    np.testing.assert_allclose(*seen, atol=1e-5)
