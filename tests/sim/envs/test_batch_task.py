"""A batch task behaves like the same task written for one world; every violation of the protocol is named."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import sim
from sim.tasks.outcome import Outcome, RewardTerms
from sim.tasks.per_world import PerWorld
from sim.tasks.registry import task_of

EXAMPLES = Path(__file__).parents[3] / "examples"


def _example(name):
    specification = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


FindBall, FindBalls = _example("find_ball").FindBall, _example("find_balls").FindBalls


def test_it_is_the_same_task_bit_for_bit():
    """The two tasks agree over two and a half episodes, in several worlds."""
    single, batch = (sim.make_vec_env(task, n_envs=5, seed=3, memory=2) for task in (FindBall(), FindBalls()))
    seen, same = single.reset(), batch.reset()
    random = np.random.default_rng(0)
    for _ in range(50):
        assert seen.keys() == same.keys()
        for name, array in seen.items():
            np.testing.assert_array_equal(same[name], array)
        actions = random.uniform(-1, 1, (5, 1)).astype(np.float32)
        seen, *rest = single.step(actions)
        same, *others = batch.step(actions)
        np.testing.assert_array_equal(others[0], rest[0])
        np.testing.assert_array_equal(others[1], rest[1])
        assert [info["is_success"] for info in others[2]] == [info["is_success"] for info in rest[2]]


def test_arrays_are_mujocos():
    env = sim.make_vec_env(FindBalls(), n_envs=3, seed=0)
    env.reset()
    env.step(np.array([[1.0], [0.0], [-1.0]]))
    worlds = env.worlds
    for world, data in enumerate(worlds.datas):
        np.testing.assert_array_equal(worlds.qpos[world], data.qpos)
        np.testing.assert_array_equal(worlds.mocap_pos[world], data.mocap_pos)
        np.testing.assert_array_equal(worlds.geom_xpos[world], data.geom_xpos)
    with pytest.raises(ValueError, match="read-only"):
        worlds.geom_xpos[0] = 0
    with pytest.raises(AttributeError, match="ArrayWorlds and mjData have no attribute"):
        _ = worlds.nothing


@pytest.mark.parametrize("mode", ["training", "evaluation"])
@pytest.mark.parametrize("task", sim.TASKS)
def test_the_built_in_tasks_keep_to_the_protocol(task, mode):
    sim.check_batch_task(task_of(sim.build_world(task), mode))


def test_tasks_of_one_world_at_a_time_keep_to_it():
    sim.check_batch_task(FindBalls())
    sim.check_batch_task(PerWorld(FindBall()))


class WrongShape(FindBalls):
    def rewards(self, worlds):
        return {"near": np.zeros(3)}


class NoMapping(FindBalls):
    def rewards(self, worlds):
        return np.zeros(worlds.n)


class WrongEnd(FindBalls):
    def terminated(self, worlds):
        return False


class NotFinite(FindBalls):
    def proprioception(self, worlds):
        felt = worlds.qvel.copy()
        felt[2] = np.nan
        return felt


class Neighbour(FindBalls):
    """A task that also moves the ball of the next world."""

    def reset(self, worlds, chosen, rngs):
        super().reset(worlds, chosen, rngs)
        worlds.mocap_pos[chosen - 1, 0, 1] += 0.3


class OwnChance(FindBalls):
    """A task that draws from its own random generator."""

    chance = np.random.default_rng(0)

    def reset(self, worlds, chosen, rngs):
        worlds.mocap_pos[chosen, 0, 1] = self.chance.uniform(-2, 2, len(chosen))


class Crowd(FindBalls):
    """A task in which a world's reward depends on the other worlds."""

    def rewards(self, worlds):
        return {"near": -self.distance(worlds) + self.distance(worlds).mean()}


class Mover(FindBalls):
    """A task that moves the ball in `judge` without reporting it."""

    def judge(self, worlds, failed):
        for data in worlds.datas[:2]:
            data.mocap_pos[0, 1] += 0.1
            data.geom_xpos[2, 1] += 0.1
        return super().judge(worlds, failed)


class OwnClock(FindBalls):
    """A task that counts actions in an attribute, which is not restored with the worlds."""

    clock = np.zeros(99)

    def reset(self, worlds, chosen, rngs):
        super().reset(worlds, chosen, rngs)
        self.clock[chosen] = 0

    def rewards(self, worlds):
        self.clock += 1
        return {"near": self.clock[: worlds.n].copy()}


class WrongWorld(FindBalls):
    def judge(self, worlds, failed):
        nothing = np.zeros(worlds.n, bool)
        return Outcome(RewardTerms(["near"], np.zeros((1, worlds.n))), nothing, nothing, changed=np.array([7]))


class NoNumber(FindBalls):
    def rewards(self, worlds):
        return {"near": np.where(np.arange(worlds.n) == 1, np.nan, 1.0)}


class OffEnd(FindBalls):
    def act(self, worlds, actions):
        return {worlds.n: "fell over"}


class NoReason(FindBalls):
    def act(self, worlds, actions):
        return [0]


class NoOutcome(FindBalls):
    def judge(self, worlds, failed):
        return None


class Mask(FindBalls):
    def judge(self, worlds, failed):
        nothing = np.zeros(worlds.n, bool)
        return Outcome(RewardTerms(["near"], np.zeros((1, worlds.n))), nothing, nothing, changed=nothing)


@pytest.mark.parametrize(
    ("task", "said"),
    [
        (NoNumber, "world 1: rewards: 'near' is nan: must be a finite number"),
        (OffEnd, "OffEnd: act names world 4: must be within 0 and 3"),
        (NoReason, r"NoReason: act returned \[0\]: must be {0: 'fell over'}, or None"),
        (NoOutcome, "judge returned None: must be a sim.Outcome, whose terms are sim.RewardTerms"),
        (Mask, "judge: changed names world False: must be within 0 and 3"),
        (WrongShape, r"WrongShape: rewards: 'near' has shape \(3,\): must be \(4,\), one entry for each world"),
        (NoMapping, "NoMapping: rewards returned .*: must be arrays by name"),
        (WrongEnd, r"WrongEnd: terminated has shape \(\): must be \(4,\)"),
        (NotFinite, r"NotFinite: proprioception: 'feels' is \[nan\] in world 2: must be finite"),
        (Neighbour, "reset: was given world 3 and changed physics of world 2: must not change it"),
        (OwnChance, "the same seed: .* differs after action 0: must repeat every episode"),
        (Crowd, "world 0: reward differs after action 0: must not depend on other worlds"),
        (Mover, "judge: moved bodies of world 0, which is not in Outcome.changed"),
        (OwnClock, "a restored state: reward differs after action 0: must lead to the same future"),
        (WrongWorld, "judge: changed names world 7: must be within 0 and 3"),
    ],
)
def test_what_breaks_the_protocol_is_named(task, said):
    with pytest.raises(ValueError, match=said):
        sim.check_batch_task(task())


def test_a_reward_that_is_not_finite_ends_its_own_world():
    class Broken(FindBalls):
        failure_reward = -5.0

        def rewards(self, worlds):
            return {"near": np.where(np.arange(worlds.n) == 1, np.nan, 1.0)}

    env = sim.make_vec_env(Broken(), n_envs=3, seed=0)
    env.reset()
    with pytest.warns(UserWarning, match="rewards: 'near' is nan"):
        _, reward, done, infos = env.step(np.zeros((3, 1)))
    assert done.tolist() == [False, True, False]
    assert reward.tolist() == [1, -5, 1]
    assert infos[1]["failure"] == "rewards: 'near' is nan: must be a finite number"
    assert not infos[1]["TimeLimit.truncated"]


def test_bad_arguments_of_the_checker():
    with pytest.raises(ValueError, match=r"task = .*: must be a sim.BatchTask"):
        sim.check_batch_task(FindBall())
    with pytest.raises(ValueError, match=r"n_envs = 1: must be a whole number in \[2, 1000000\]"):
        sim.check_batch_task(FindBalls(), n_envs=1)
