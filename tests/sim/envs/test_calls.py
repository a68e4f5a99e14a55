"""Calls that come too late or too early, bad seeds and bad actions raise the same errors in all environments.

RANDOM_CALLS=20 python -m pytest tests/sim/envs/test_calls.py     draws twenty times the default number of calls
"""

import os
import re
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import torch

import sim
from sim.envs.calls import CLOSED, NOT_BEGUN
from sim.envs.vector_env import EyesVectorEnv
from tests.sim.envs.hunt import hunt

FACES = ["Env", "VectorEnv", "VecEnv", "ParallelEnv"]
N = 2  # numbers in an action, and worlds of a batch
ROUNDS = int(os.environ.get("RANDOM_CALLS", "1"))
REALS, MASKED, SHAPE = "must be real numbers", "has masked elements", "has shape"


@dataclass(frozen=True)
class Face:
    """One of the four environments, with calls that have the same form in all of them."""

    name: str
    env: Any

    @property
    def batched(self):
        return self.name.startswith("Vec")

    def step(self, action):
        """Take this action in the last world, and no movement in the others."""
        if self.batched:
            return self.env.step(np.array([[0, 0]] * (N - 1) + [action]) if np.shape(action) == (N,) else action)
        return self.env.step({"Prey": np.zeros(N), "Predator": action} if self.name == "ParallelEnv" else action)

    def reset(self, seed=None):
        if self.name == "VecEnv":
            self.env.seed(seed)
            return self.env.reset()
        return self.env.reset(seed=seed)

    def close(self):
        self.env.close()

    def call(self, name):
        """Call this method with actions that are valid."""
        if name == "step":
            return self.step(np.zeros(N))
        if name == "step_async":
            return self.env.step_async(np.zeros((N, N)))
        return self.env.step_wait() if name == "step_wait" else getattr(self, name)()


def refused(kind, what, call, *args):
    """Return the message of the error that this call raises."""
    try:
        call(*args)
    except kind as error:
        return str(error)
    return pytest.fail(f"no error: {what}")


def made(name):
    task = hunt().alone("Prey", {"Predator": lambda seen: np.zeros((len(seen["eyes"]), N), np.float32)})
    if name == "Env":
        return Face(name, sim.make_env(task))
    if name == "VectorEnv":
        return Face(name, EyesVectorEnv(N, task=task))
    return Face(name, sim.make_vec_env(task, n_envs=N) if name == "VecEnv" else sim.make_parallel_env(hunt()))


@pytest.fixture(scope="module")
def running():
    faces = [made(name) for name in FACES]
    for face in faces:
        face.reset(0)
    yield faces
    for face in faces:
        face.close()


@pytest.mark.parametrize("name", FACES)
def test_calls_in_any_order_work_or_raise_the_same_error(name):
    """Random calls are compared with three rules: nothing after `close`, no step before the first reset, and in
    stable-baselines3's environment `step_async` and `step_wait` alternate.
    """
    rng = np.random.default_rng()
    for _ in range(2 * ROUNDS):
        face, begun, pending, closed, log = made(name), False, False, False, []
        calls = ["reset", "step", "close", *(["step_async", "step_wait"] * 2 if name == "VecEnv" else [])]
        odds = np.array([4, 4, 1, *[5] * (len(calls) - 3)], float)
        for call in rng.choice(calls, 16, p=odds / odds.sum()):
            log.append(str(call))
            expected = None
            if closed:
                expected = None if call == "close" else CLOSED
            elif call == "step_wait":
                expected = None if pending else "call step_async" if begun else NOT_BEGUN
            elif call != "close":
                expected = "call step_wait first" if pending else None if begun or call == "reset" else NOT_BEGUN
            if expected is None:
                face.call(call)
            else:
                assert expected in refused(RuntimeError, log, face.call, call)
            if not closed and expected is None:
                begun, closed = begun or call == "reset", call == "close"
                pending = call == "step_async" or (pending and call == "close")


@pytest.mark.parametrize("name", FACES)
def test_no_reset_after_the_end(name):
    face = made(name)
    face.close()
    assert refused(RuntimeError, name, face.reset) == CLOSED


def test_nothing_works_after_the_end():
    face = made("VecEnv")
    face.reset()
    state = face.env.get_state()
    face.close()
    env = face.env
    for late in (env.get_state, lambda: env.set_state(state), env.get_images, lambda: env.seed_worlds([1, 2])):
        with pytest.raises(RuntimeError, match=CLOSED):
            late()


def test_a_state_is_not_taken_while_an_action_is_pending():
    env = made("VecEnv").env
    env.reset()
    env.step_async(np.zeros((N, N)))
    for early in (env.get_state, env.reset, lambda: env.step_async(np.zeros((N, N)))):
        with pytest.raises(RuntimeError, match="call step_wait first"):
            early()
    env.step_wait()
    env.get_state()


BAD_SEEDS = [1.5, -1, "x", "3", b"x", True, np.float64(2), np.nan, [1.5] * N, ["x"] * N, np.array(3), 1j, {}]


def test_bad_seeds_are_refused_at_once(running):
    for face in running:
        for seed in BAD_SEEDS:
            words = refused(ValueError, (face.name, seed), face.reset, seed)
            assert re.fullmatch(r"seed(\[0\])? = .*: must be a whole number, at least 0, or None", words)
        face.reset(np.int64(3))
        face.step(np.zeros(N))


def bad_action(rng):
    """Return an action that is not real numbers, or of another shape, with the expected message."""
    numbers = rng.uniform(-1, 1, N)
    masked = np.ma.masked_array(numbers, [rng.random() < 0.5, True])
    return [
        (numbers + 0j, REALS),
        (numbers + 1j, REALS),
        (list(numbers + 1j), REALS),
        (masked, MASKED),
        ([numbers[0], np.ma.masked], MASKED),
        (numbers.astype(str), REALS),
        (["left", "right"], REALS),
        ([None, 0.0], REALS),
        (numbers.astype("datetime64[s]"), REALS),
        (torch.tensor(numbers, requires_grad=True), "requires a derivative"),
        (np.zeros(rng.integers(3, 9)), SHAPE),
        (0.5, SHAPE),
    ][rng.integers(12)]


def test_bad_actions_are_refused_and_change_nothing(running):
    rng = np.random.default_rng()
    for face in running:
        face.reset(3)
        for _ in range(30 * ROUNDS):
            action, message = bad_action(rng)
            if face.batched:
                action = np.zeros((N, 3)) if message == SHAPE else [[0.0, 0.0]] * (N - 1) + [action]
            words = refused(ValueError, (face.name, action), face.env.step if face.batched else face.step, action)
            assert message in words
            assert "\n" not in words
            assert words.startswith("action")
        after, other = face.step(np.zeros(N))[0], made(face.name)
        other.reset(3)
        np.testing.assert_equal(after, other.step(np.zeros(N))[0])


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_an_action_that_is_not_finite_ends_its_world_in_a_batch_and_is_refused_elsewhere(running, value):
    rng = np.random.default_rng()
    for face in running:
        face.reset(0)
        action = rng.uniform(-1, 1, N)
        action[rng.integers(N)] = value
        if face.batched:
            with warnings.catch_warnings(action="ignore"):
                done = face.step(action)[2]
            assert done.tolist() == [False] * (N - 1) + [True]
        else:
            with pytest.raises(ValueError, match=r"^action.* = \[.*(nan|inf).*\]: must be finite$"):
                face.step(action)
            face.step(np.zeros(N))


def test_finite_actions_of_any_size_and_type_are_limited(running):
    for face in running:
        for action in (np.array([1e300, -1e300]), np.array([1, 0]), np.array([True, False]), torch.ones(N)):
            face.reset(0)
            seen = face.step(action)[0]
            if face.name == "ParallelEnv":
                seen = seen["Predator"]
            assert np.isfinite(seen["previous_action"]).all()
            assert seen["previous_action"].reshape(-1, N)[-1][0] == 1


def test_no_seeds_of_worlds_after_the_end():
    face = made("VecEnv")
    face.env.seed_worlds([1, 2])
    face.close()
    assert refused(RuntimeError, "seeds", face.env.seed_worlds, [1, 2]) == CLOSED


def test_options_of_a_reset_are_refused():
    face = made("Env")
    face.env.reset(options={})
    message = refused(ValueError, "options", lambda: face.env.reset(options={"seed": 3}))
    assert message == "reset: options = {'seed': 3}: must be left out, reset has no options"
    face.close()
