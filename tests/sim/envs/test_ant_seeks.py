"""Tests of the example of an ant that navigates by sight: its legs follow the commands for speed and turning."""

import importlib.util
from pathlib import Path

import mujoco
import numpy as np
import pytest

import sim

FILE = Path(__file__).parents[3] / "examples" / "ant_seeks.py"


@pytest.fixture(scope="module")
def example():
    specification = importlib.util.spec_from_file_location("ant_seeks", FILE)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def gone(task, model, speed, turn, seconds=6):
    """Return the distance ahead [m] and the turn to the left [rad] of an ant under constant commands, and its smallest
    uprightness.
    """
    data, heading, upright = mujoco.MjData(model), [], []
    task.reset(data, np.random.default_rng(0))
    for _ in range(round(seconds / (task.substeps * model.opt.timestep))):
        task.act(data, np.array([speed, turn]))
        mujoco.mj_step(model, data, task.substeps)
        turned = data.body("torso").xmat.reshape(3, 3)
        heading.append(np.arctan2(turned[1, 0], turned[0, 0]))
        upright.append(turned[2, 2])
    return data.qpos[0], np.unwrap(heading)[-1], min(upright)


def test_it_walks_turns_and_stands_as_it_is_told(example):
    task = example.AntSeeks()
    model = task.model.compile()
    ahead, turned, upright = gone(task, model, 1, 0)
    assert ahead > 2
    assert abs(turned) < 0.5
    assert upright > 0.9
    ahead, left, _ = gone(task, model, -1, 1)
    assert abs(ahead) < 0.2
    assert left > 6
    assert gone(task, model, -1, -1)[1] < -6
    ahead, turned, _ = gone(task, model, -1, 0)
    assert abs(ahead) < 0.1
    assert abs(turned) < 0.1


def test_it_is_the_legs_that_take_it_there(example):
    """The ant does not advance on ice, which proves that its legs move it."""
    task = example.AntSeeks()
    model = task.model.compile()
    model.geom_friction[:, 0] = 1e-4
    assert gone(task, model, 1, 0)[0] < 0.5


def test_it_is_rewarded_for_getting_nearer_and_sees_the_ball_unless_blindfolded(example):
    env = sim.make_vec_env(example.AntSeeks(), n_envs=16, seed=0)
    blind = sim.make_vec_env(example.Blindfold(), n_envs=16, seed=0)
    ball = env.worlds.model.geom("ball").id
    for one, sees in ((env, True), (blind, False)):
        one.reset()
        assert (one.renderer.ids(sim.Poses.from_data(one.worlds.datas)) == ball).any() == sees
    before = np.array([example.AntSeeks().apart(data) for data in env.worlds.datas])
    _, _, _, infos = env.step(np.tile([1.0, 0.0], (16, 1)))
    after = np.array([example.AntSeeks().apart(data) for data in env.worlds.datas])
    terms = [info["reward_terms"]["nearer"] for info in infos]
    np.testing.assert_allclose(terms, before - after, atol=1e-6)
    assert {*np.round(before)} <= {2, 3}
