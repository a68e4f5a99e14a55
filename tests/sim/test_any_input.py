"""Public functions of `sim` return finite results of the right shape for any input, or raise a one-line error.

SIM_EXAMPLES=20 python -m pytest tests/sim/test_any_input.py     tries twenty times the default number of inputs
"""

import math
import os

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import sim
from sim.exr.files import ExrError
from sim.worlds.state import WorldState

SLOW = [HealthCheck.too_slow, HealthCheck.function_scoped_fixture]
ODD = [0, -1, 0.5, math.nan, math.inf, 1e300, 10**400, "much", None, (1, 2), [], b"x", True]


def examples(count):
    count *= int(os.environ.get("SIM_EXAMPLES", "1"))
    return settings(max_examples=count, deadline=None, derandomize=True, suppress_health_check=SLOW)


def or_odd(usual):
    """Return a strategy that usually draws valid values, and sometimes invalid ones."""
    return st.one_of(*[usual] * 9, st.sampled_from(ODD))


def made(function, *args, **kwargs):
    """Return the result, or None if the request is refused in one line."""
    try:
        return function(*args, **kwargs)
    except ValueError as error:
        one_line(error)
        return None


def one_line(error):
    assert str(error)
    assert "\n" not in str(error)


sound_eyes = st.fixed_dictionaries(
    {
        "n_eyes": st.integers(1, 3),
        "placement_range_deg": st.floats(0, 360),
        "fov_deg": st.floats(5, 150),
        "resolution": st.tuples(st.integers(1, 3), st.integers(1, 4)),
        "bands": st.integers(1, 8),
    }
)
few_eyes = st.fixed_dictionaries(
    {
        "n_eyes": or_odd(st.integers(1, 3)),
        "placement_range_deg": or_odd(st.floats(0, 360)),
        "fov_deg": or_odd(st.floats(5, 150)),
        "resolution": or_odd(st.tuples(st.integers(1, 3), st.integers(1, 4))),
        "noise_sigma": or_odd(st.floats(0, 0.2)),
        "bands": or_odd(st.integers(1, 8)),
    }
)


@examples(150)
@given(few_eyes)
def test_eyes_are_as_asked_or_refused(asked):
    eyes = made(sim.Eyes, **asked)
    if eyes is None:
        return
    azimuths = eyes.azimuths()
    assert azimuths.shape == (eyes.n_eyes,)
    assert np.isfinite(azimuths).all()
    assert np.abs(azimuths).max() <= math.radians(eyes.placement_range_deg) / 2 + 1e-12
    assert (np.diff(azimuths) <= 0).all(), "not in order from left to right"
    assert len(set(eyes.names())) == eyes.n_eyes


@pytest.fixture(scope="module")
def field():
    return sim.build_world("detection")


def anywhere(world, n, seed):
    """Return random positions of agents and objects, including positions in walls, in each other and far outside."""
    rng, k = np.random.default_rng(seed), len(world.objects)
    position, heading, none = rng.uniform(-15, 15, (n, 2)), rng.uniform(-np.pi, np.pi, n), np.zeros(n, int)
    objects = np.concatenate([rng.uniform(-12, 12, (n, k, 2)), np.full((n, k, 1), 0.5)], axis=2)
    return WorldState(position, heading, np.zeros((n, 2)), objects, np.zeros((n, k)), position, none, none, none)


seen = []  # number of worlds of each rendered example


@examples(6)
@given(sound_eyes, st.integers(1, 3), st.integers(1, 6), st.integers(0, 2**31))
def test_signals_are_finite_wherever_agents_stand(field, asked, n, rays, seed):
    """Signals are not negative, and in this world no surface is brighter than white in direct sunlight."""
    eyes = sim.Eyes(**asked)
    renderer = made(sim.BatchedRenderer, field, eyes, n, sim.Fidelity(rays, eyes.bands))
    if renderer is None:
        return
    signals = renderer.signals(anywhere(field, n, seed))
    assert signals.shape[:2] == (n, eyes.n_eyes)
    assert np.isfinite(signals).all()
    assert signals.min() >= 0
    assert signals.max() <= renderer.brightest * (1 + 1e-4)
    seen.append(n)


def test_enough_was_looked_at():
    assert len(seen) >= 3
    assert len(set(seen)) > 1


@pytest.mark.parametrize("odd", ODD, ids=lambda odd: f"{odd!s:.8}")
def test_odd_counts_are_refused_or_taken(field, odd):
    """For example, a huge integer would overflow in later arithmetic."""
    eyes = sim.Eyes(resolution=(1, 2))
    made(sim.Fidelity, odd, 4)
    made(sim.Fidelity, 4, odd)
    made(sim.BatchedRenderer, field, eyes, odd, sim.Fidelity(2, eyes.bands))


@examples(8)
@given(st.sampled_from(sim.TASKS), or_odd(st.integers(1, 3)), st.integers(1, 3), st.integers(0, 2**32))
def test_environments_go_on_whatever_is_done_in_them(task, n_envs, memory, seed):
    """An action of NaN ends that world's episode with a reason, and the other worlds continue."""
    eyes = sim.Eyes(n_eyes=1, resolution=(1, 2), fov_deg=40)
    envs = made(sim.make_vec_env, task, eyes, n_envs, seed, memory=memory, rays_per_receptor=1)
    if envs is None:
        assert n_envs in ODD, "whole numbers within bounds are refused"
        return
    rng = np.random.default_rng(0)
    try:
        envs.reset()
        for step in range(4):
            actions = rng.choice([-1.0, 0.3, 1.0, 1e9, -np.inf, np.nan][: 3 + step], (n_envs, 2)).astype(np.float32)
            observation, reward, done, infos = envs.step(actions)
            assert all(np.isfinite(array).all() for array in observation.values())
            assert np.isfinite(reward).all()
            assert done.shape == reward.shape == (len(infos),) == (n_envs,)
    finally:
        envs.close()


@examples(20)
@given(st.data())
def test_views_come_back_as_they_were_written_or_are_refused(tmp_path, data):
    shape = data.draw(st.tuples(st.integers(1, 4), st.integers(1, 3), st.integers(1, 5)))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    nm = data.draw(or_odd(st.lists(st.floats(300, 800), min_size=shape[0], max_size=shape[0], unique=True).map(sorted)))
    attributes = data.draw(st.dictionaries(st.text(max_size=3), or_odd(st.integers()), max_size=2))
    name = data.draw(or_odd(st.text("abc.é ", min_size=1, max_size=4)))
    view = made(lambda: sim.View(name, np.array(nm, float), rng.random(shape, dtype=np.float32), attributes=attributes))
    path = tmp_path / "view.exr"
    if view is None or made(lambda: sim.write_exr(path, [view]) or True) is None:
        return
    try:
        (back,) = sim.read_exr(path)
    except ExrError as error:
        raise AssertionError(f"what was written cannot be read: {error}") from error
    assert back.name == view.name
    assert np.array_equal(back.radiance, view.radiance)
    assert np.array_equal(back.wavelengths_nm, view.wavelengths_nm)
