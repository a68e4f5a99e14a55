"""Faces of environments and checks of their calls, with a stand-in for the batch of worlds."""

from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest

import sim
from sim.envs import env as env_module
from sim.envs import registered_env, registration, vector_env
from sim.envs.calls import CLOSED, NOT_BEGUN, CallOrder, actions_of, one_worlds_action, seed_of
from sim.envs.env import EyesEnv, make_env
from sim.envs.registered_env import RegisteredEnv, RegisteredVectorEnv, _begun, _steps
from sim.envs.vector_env import EyesVectorEnv
from sim.tasks.task_settings import MOST_STEPS
from sim.worlds.catalog import EPISODE_STEPS
from tests.sim.envs.hunt import hunt
from tests.sim.envs.test_task_vec_env import Face

# --- calls

PENDING, NOT_PENDING = "step_async has started an action", "no action is pending"
CALLS = {
    "open": CallOrder.require_open,
    "begun": CallOrder.require_begun,
    "start": CallOrder.start_reset,
    "take": CallOrder.take,
}


def order(*calls):
    found = CallOrder()
    for call in calls:
        getattr(found, call)()
    return found


@pytest.mark.parametrize(
    ("calls", "errors"),
    [
        ((), {"open": None, "begun": NOT_BEGUN, "start": None, "take": NOT_BEGUN}),
        (("start_reset",), {"open": None, "begun": NOT_BEGUN, "start": None, "take": NOT_BEGUN}),
        (("finish_reset",), {"open": None, "begun": None, "start": None, "take": NOT_PENDING}),
        (("finish_reset", "start_reset"), {"open": None, "begun": NOT_BEGUN, "start": None, "take": NOT_BEGUN}),
        (("finish_reset", "expect_wait"), {"open": PENDING, "begun": PENDING, "start": PENDING, "take": None}),
        (("finish_reset", "expect_wait", "take"), {"open": None, "begun": None, "start": None, "take": NOT_PENDING}),
        (("finish_reset", "close"), {"open": CLOSED, "begun": CLOSED, "start": CLOSED, "take": CLOSED}),
    ],
)
def test_calls_in_order(calls, errors):
    for name, error in errors.items():
        found = order(*calls)
        if error is None:
            CALLS[name](found)
        else:
            with pytest.raises(RuntimeError, match=error):
                CALLS[name](found)
        assert found.closed == ("close" in calls)


def test_an_action_is_no_longer_pending_after_a_refusal():
    found = order("expect_wait")
    with pytest.raises(RuntimeError, match=NOT_BEGUN):
        found.take()
    found.require_open()


def test_seeds():
    assert [seed_of("seed", seed) for seed in (None, 0, 5, np.int64(7))] == [None, 0, 5, 7]
    assert type(seed_of("seed", np.int64(7))) is int
    for seed in (-1, True, 1.0, "1"):
        with pytest.raises(ValueError, match=r"^seed = .*: must be a whole number, at least 0, or None"):
            seed_of("seed", seed)


def test_actions_are_limited_to_float32():
    given = np.ones((2, 1), np.float32)
    assert actions_of("actions", given, (2, 1)) is given
    largest = np.finfo(np.float32).max
    found = actions_of("actions", [1e300, -1e300, np.inf, -np.inf, 0.5], (5,))
    assert found.dtype == np.float32
    assert found.tolist() == [largest, -largest, np.inf, -np.inf, 0.5]
    for actions, reason in (
        (np.ones((1, 2), np.float32), "has shape"),
        (np.ones(2), "has shape"),
        (["x"], "must be real"),
    ):
        with pytest.raises(ValueError, match=reason):
            actions_of("actions", actions, (2, 1))
    assert one_worlds_action("action", [1, 2], (2,)).tolist() == [1, 2]
    for bad in ([np.nan, 1], [np.inf, np.inf]):
        with pytest.raises(ValueError, match=r"^action = \[.*\]: must be finite"):
            one_worlds_action("action", bad, (2,))


# --- one world, and a vector of worlds


class Batch:
    """Stand-in for the environment of all worlds, which records its calls."""

    def __init__(self, *given, **options):
        self.given, self.options, self.calls = given, options, []
        self.observation_space = gymnasium.spaces.Dict({"eyes": gymnasium.spaces.Box(0, 9, (1,))})
        self.action_space = gymnasium.spaces.Box(-1, 1, (2,))
        self.render_mode, self.state = options.get("render_mode"), "state"
        n = options["n_envs"]
        self.reset_infos = [{"first": world} for world in range(n)]
        self.done, self.infos = np.zeros(n, bool), [{"later": world} for world in range(n)]

    def __getattr__(self, name):
        def record(*given):
            self.calls.append((name, *given))
            n = self.options["n_envs"]
            seen = {"eyes": np.arange(n)[:, None]}
            if name == "reset":
                return seen
            if name == "step":
                return seen, np.arange(n) / 2, self.done, self.infos
            if name == "step_once":
                return seen, np.array([0.5]), np.array([True]), np.array([False]), [{"episode": 1, "own": 2}]
            return ["image"] * n

        return record


@pytest.fixture(autouse=True)
def batches(monkeypatch):
    for module in (env_module, vector_env):
        monkeypatch.setattr(module, "make_vec_env", Batch)


def test_one_world():
    env = EyesEnv("maze", "eyes", render_mode="eyes", memory=3)
    assert env._batch.given == ("maze", "eyes")
    assert env._batch.options == {"n_envs": 1, "seed": None, "render_mode": "eyes", "memory": 3}
    assert (env.render_mode, env.state) == ("eyes", "state")
    assert (env.observation_space, env.action_space) == (env._batch.observation_space, env._batch.action_space)
    assert env.reset(seed=0) == ({"eyes": [0]}, {"first": 0})
    assert env.np_random_seed == 0
    assert env.reset(options={}) == ({"eyes": [0]}, {"first": 0})
    assert env._batch.calls == [("seed", 0), ("reset",), ("reset",)]
    assert env.step([1, 2]) == ({"eyes": [0]}, 0.5, True, False, {"own": 2})
    assert env.render() == "image"
    env.close()
    assert [call[0] for call in env._batch.calls[3:]] == ["step_once", "get_images", "close"]
    assert EyesEnv("maze").render() is None
    assert EyesEnv.metadata == {"render_modes": ["rgb_array", "eyes"], "render_fps": 5}
    assert isinstance(make_env("maze", memory=2), EyesEnv)
    for options, reason in (({"n_envs": 2}, "this is one world"), ({"seed": 3}, "pass it to reset")):
        with pytest.raises(ValueError, match=reason):
            EyesEnv("maze", **options)
    with pytest.raises(ValueError, match=r"several animals learn in a sim\.Encounter"):
        EyesEnv(hunt())
    with pytest.raises(ValueError, match=r"reset: options = \{'a': 1\}"):
        env.reset(options={"a": 1})


def test_a_vector_of_worlds():
    env = EyesVectorEnv(task="maze", eyes="eyes", memory=3)
    assert (env._batch.given, env._batch.options) == (("maze", "eyes"), {"n_envs": 1, "seed": None, "memory": 3})
    env = EyesVectorEnv(3, task="maze", render_mode="eyes")
    assert env.num_envs == 3
    assert (env.observation_space["eyes"].shape, env.action_space.shape) == ((3, 1), (3, 2))
    assert (env.single_observation_space["eyes"].shape, env.single_action_space.shape) == ((1,), (2,))
    _, info = env.reset(seed=[1, None, 2])
    assert (info["first"].tolist(), info["_first"].tolist()) == ([0, 1, 2], [True] * 3)
    for seed in (np.array([4, 5, 6]), 7, None, "x"):
        env.reset(seed=seed)
    assert [call for call in env._batch.calls if call[0] != "reset"] == [
        ("seed_worlds", [1, None, 2]), ("seed_worlds", [4, 5, 6]), ("seed", 7), ("seed", "x")
    ]  # fmt: skip
    assert env.render() == ("image",) * 3
    env.close_extras()
    assert env._batch.calls[-2:] == [("get_images",), ("close",)]
    assert EyesVectorEnv(task="maze").render() is None
    assert EyesVectorEnv.metadata["render_fps"] == 5
    for options, reason in (({"n_envs": 2}, "it is num_envs here"), ({"seed": 3}, "pass it to reset")):
        with pytest.raises(ValueError, match=reason):
            EyesVectorEnv(2, task="maze", **options)
    with pytest.raises(ValueError, match=r"several animals learn in a sim\.Encounter"):
        EyesVectorEnv(2, task=hunt())
    with pytest.raises(ValueError, match=r"reset: options = \{'a': 1\}"):
        env.reset(options={"a": 1})


def test_ended_episodes_of_a_vector():
    """The first world is terminated, the third is truncated, and the second continues."""
    env = EyesVectorEnv(3, task="maze")
    env._batch.done = np.array([True, False, True])
    for world, truncated in ((0, False), (2, True)):
        env._batch.infos[world] |= {
            "TimeLimit.truncated": truncated,
            "episode": 1,
            "terminal_observation": f"end {world}",
        }
    _, reward, terminated, truncated, info = env.step(np.zeros((3, 2)))
    assert reward.tolist() == [0, 0.5, 1]
    assert (terminated.tolist(), truncated.tolist()) == ([True, False, False], [False, False, True])
    assert info["_first"].tolist() == info["_final_obs"].tolist() == [True, False, True]
    assert info["later"][1] == 1
    assert info["_later"].tolist() == [False, True, False]
    assert info["final_obs"].tolist() == ["end 0", None, "end 2"]
    assert info["final_info"]["later"].tolist() == [0, 0, 2]
    assert "episode" not in info["final_info"]


# --- ids


def test_lengths_of_registered_episodes(monkeypatch):
    """-1 stands for Gymnasium's missing value. A course or a family of layouts may be shorter."""
    family = sim.LayoutFamily(seed=1, n_training=1, n_selection=1, n_test=1)
    monkeypatch.setattr(registered_env, "course_named", lambda name: SimpleNamespace(episode_steps=len(name) or None))
    for asked, options, steps in (
        (-1, {}, MOST_STEPS),
        (1, {}, 1),
        (7, {"course": "abcd"}, 4),
        (3, {"course": "abcd"}, 3),
        (7, {"course": ""}, 7),
        (-1, {"layouts": family.training}, family.episode_steps or MOST_STEPS),
        (5, {"layouts": family.training}, 5),
    ):
        assert _steps(asked, options) == steps
    for asked in (0, -2, MOST_STEPS + 1):
        with pytest.raises(ValueError, match="max_episode_steps"):
            _steps(asked, {})
    with pytest.raises(ValueError, match="its name there is max_episode_steps"):
        _steps(3, {"episode_steps": 3})
    assert registered_env.ENDLESS == -1
    assert isinstance(_begun(Face), Face)
    assert _begun("maze") == "maze"


def test_registered_environments_have_their_lengths():
    one, many = RegisteredEnv("maze", memory=2), RegisteredVectorEnv(task="maze", max_episode_steps=9)
    assert one._batch.options["episode_steps"] == MOST_STEPS
    assert (many.num_envs, many._batch.options["episode_steps"]) == (1, 9)
    assert RegisteredVectorEnv(2, task=Face)._batch.given[0].__class__ is Face


def test_registration(monkeypatch):
    """Registered ids stay as they are, but user tasks replace their former registration."""
    registered = []
    monkeypatch.setattr(gymnasium, "registry", {"rhabdom/Maze-v0": "former", "Own-v0": "former"})
    monkeypatch.setattr(gymnasium, "register", lambda id_, **how: registered.append((id_, how)))
    registration.register()
    assert sorted(id_ for id_, _ in registered) == sorted(set(registration.IDS) - {"rhabdom/Maze-v0"})
    assert {how["max_episode_steps"] for _, how in registered} == {EPISODE_STEPS}
    assert all(how["kwargs"] == {"task": registration.IDS[id_]} for id_, how in registered)
    registration.register_task("Own-v0", Face, memory=2)
    assert "Own-v0" not in gymnasium.registry
    assert registered[-1] == (
        "Own-v0",
        {
            "entry_point": "sim.envs.registered_env:RegisteredEnv",
            "vector_entry_point": "sim.envs.registered_env:RegisteredVectorEnv",
            "max_episode_steps": Face.episode_steps,
            "kwargs": {"task": Face, "memory": 2},
        },
    )
    short = Face()
    short.episode_steps = 1
    registration.register_task("Short-v0", short)
    assert registered[-1][1]["max_episode_steps"] == 1
    for task in ("maze", int, SimpleNamespace(episode_steps=3)):
        with pytest.raises(ValueError, match=r"must be a sim\.Task, or its class"):
            registration.register_task("Own-v0", task)
    gymnasium.registry["Own-v0"] = "former"
    short.episode_steps = 0
    with pytest.raises(ValueError, match="episode_steps = 0"):
        registration.register_task("Own-v0", short)
    assert gymnasium.registry["Own-v0"] == "former", "an invalid task does not remove what is registered"
