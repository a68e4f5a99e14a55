"""Calls of batched environments, with a stand-in for the animals in their worlds."""

import inspect
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
from gymnasium import spaces

from sim.envs import vec_env
from sim.envs.animals import Advanced
from sim.envs.calls import CLOSED, CallOrder
from sim.envs.vec_env import EyesVecEnv
from tests.sim.envs.test_batch_parts import environment, step


class Sights:
    """Stand-in for all animals of three worlds, which records its calls."""

    def __init__(self, *_):
        self.log = []
        box = spaces.Dict({"eyes": spaces.Box(0, 9, (1,))})
        self.learners = [
            SimpleNamespace(
                observation_space=box,
                action_space=spaces.Box(-1, 1, (2,)),
                other_entries=lambda ended: {"own": ended + 0.5},
                preview=lambda seen, ended: {"eyes": seen["eyes"][ended]},
                now={"eyes": np.zeros((3, 1))},
                renderer="renderer",
            )
        ]

    def __getattr__(self, name):
        def record(*given):
            self.log.append((name, *(one.tolist() if isinstance(one, np.ndarray) else one for one in given)))
            return {"seen": [{"eyes": np.arange(3)}], "start_episodes": "pending"}.get(name)

        return record

    def reset(self):
        self.log.append(("reset",))
        return [{"eyes": np.zeros((3, 1))}]

    def remember(self, seen, fresh):
        self.log.append(("remember", fresh.tolist()))
        return [{"eyes": np.ones((3, 1))}]


@pytest.fixture
def batch(monkeypatch):
    """Return an environment of one learner in three worlds, whose next outcome is `batch.outcome`."""
    monkeypatch.setattr(vec_env, "Animals", Sights)
    closed = []
    simulation = environment(1).simulation
    streams = SimpleNamespace(episodes=[np.random.default_rng(k) for k in range(3)])
    vars(simulation).update(
        n=3, rows=3, streams=streams, state="state", varied=False, close=lambda: closed.append("simulation")
    )
    simulation.task.eyes, simulation.variation_info = "eyes", lambda world: {}
    found = EyesVecEnv(simulation, ["renderers"])
    found.closed = closed
    flags = {name: np.zeros(3, bool) for name in ("success", "terminated", "truncated", "given_up", "done")}
    rows = [{"t": k} for k in range(3)]
    found.outcome = step(
        **flags, reward=np.array([1.0, 2, 3]), terms=SimpleNamespace(rows=rows), changed=np.zeros(0, int)
    )
    found.animals.advance = lambda actions: Advanced(found.outcome, "frames")
    return found


def test_properties_of_a_batch(batch):
    assert (batch.state, batch.eyes, batch.worlds, batch.renderer) == ("state", "eyes", "physics", "renderer")
    assert batch.batch_task is batch.simulation.task
    assert (batch.num_envs, batch.action_space.shape, batch._commanded.shape) == (3, (2,), (3, 2))
    assert batch.get_state.__self__ is batch


def test_a_reset_uses_its_seed_once_and_clears_returns(batch):
    batch.seed(5)
    batch._returns[:] = 9
    batch.set_options({"a": 1})
    assert batch.reset()["eyes"].shape == (3, 1)
    assert batch._returns.tolist() == [0, 0, 0]
    assert batch._options == [{}] * 3
    assert [info["is_success"] for info in batch.reset_infos] == [False] * 3
    batch.reset()
    assert batch.animals.log == [("seed", 5), ("reset",), ("reset",)]


def test_seeds_of_worlds(batch):
    """None continues a world's own random numbers."""
    batch.seed_worlds([7, None, 0])
    drawn = int(np.random.default_rng(1).integers(2**63))
    assert batch.animals.log == [("seed", (7, drawn, 0))]
    for seeds, reason in (
        ([1, 2], "seed has 2 numbers: must have one for each of 3 worlds"),
        ([1, -1, 2], r"seed\[1\] = -1"),
    ):
        with pytest.raises(ValueError, match=reason):
            batch.seed_worlds(seeds)


def test_calls_out_of_order(batch):
    """An action is not looked at before the order of the calls."""
    for call in (batch.get_images, batch.get_state, lambda: batch.step_once("x"), lambda: batch.step_async("x")):
        with pytest.raises(RuntimeError, match="call reset first"):
            call()
    batch.reset()
    batch.step_async(np.zeros((3, 2)))
    with pytest.raises(RuntimeError, match="call step_wait first"):
        batch.step_async(np.zeros((3, 2)))
    batch.close()
    assert batch.closed == ["simulation"]
    with pytest.raises(RuntimeError, match=CLOSED):
        batch.reset()


@pytest.mark.parametrize("changed", [False, True])
@pytest.mark.parametrize("ended", [[], [0, 2]])
def test_a_step_starts_new_episodes(batch, ended, changed):
    """First frames are rendered early, unless the task moved bodies: then the last frames come first."""
    batch.reset()
    batch.animals.log.clear()
    batch.outcome.done[ended] = True
    if changed:
        batch.outcome.changed = np.array([1])
    observations, reward, done, infos = batch.step(np.zeros((3, 2)))
    assert (observations["eyes"] == 1).all()
    assert (reward.tolist(), reward.dtype, done.tolist()) == ([1, 2, 3], np.float32, [k in ended for k in range(3)])
    names = [call[0] for call in batch.animals.log]
    if not ended:
        assert names == ["seen", "remember"]
    else:
        first = ["seen", "start_episodes"] if changed else ["start_episodes", "seen"]
        assert names == [*first, "replace", "remember"]
        assert infos[2]["terminal_observation"] == {"eyes": 2, "own": 2.5}
    assert batch.animals.log[-1] == ("remember", ended)
    assert ["episode" in info for info in infos] == [k in ended for k in range(3)]


def test_a_failure_warns_where_the_step_was_called(batch):
    batch.reset()
    batch.outcome.failure = {1: "broken"}
    with warnings.catch_warnings(record=True) as shown:
        warnings.simplefilter("always")
        batch.step(np.zeros((3, 2)))
        line = inspect.currentframe().f_lineno - 1
    assert [(warning.filename, warning.lineno) for warning in shown] == [(__file__, line)]


def test_one_step_of_the_only_world(batch):
    """It ends no episode by itself, so no memory is filled again."""
    batch.reset()
    batch.step_async = lambda action: batch._calls.expect_wait() or batch.animals.log.append(action.tolist())
    batch.outcome.terminated[0] = True
    observations, reward, terminated, truncated, infos = batch.step_once([0.5, 1])
    assert batch.animals.log[1:] == [[[0.5, 1.0]], ("seen", Advanced(batch.outcome, "frames")), ("remember", [])]
    assert (observations["eyes"] == 1).all()
    assert (reward[0], terminated[0], truncated[0], infos[0]["reward_terms"]) == (1, True, False, {"t": 0})


@pytest.mark.parametrize("learners", [1, 2])
def test_a_restored_state_has_its_returns(monkeypatch, learners):
    """Returns of a state have the axes world and learner, and rows of an environment list one learner after another."""
    found = environment(learners)
    found._calls, returns = CallOrder(), np.array([[10.0, 20], [30, 40], [50, 60]])[:, :learners]
    found._calls.finish_reset()
    found._learners = [SimpleNamespace(now={"eyes": np.full(3, k)}) for k in range(learners)]
    state, restored = {"returns": returns, "steps": np.zeros(3)}, []
    found.animals = SimpleNamespace(
        get_state=lambda: state, set_state=lambda state, chosen: restored.append(chosen.tolist())
    )
    assert found.get_state() is state
    seen = found.set_state(state, [0, 2])
    assert restored == [[0, 2]]
    expected = [10, 1, 50, 20, 4, 60][: 3 * learners]
    assert found._returns.tolist() == expected
    assert seen["eyes"].tolist() == [0, 0, 0, 1, 1, 1][: 3 * learners]
    with pytest.raises(ValueError, match="state: must be the return value of get_state"):
        found.set_state({})
