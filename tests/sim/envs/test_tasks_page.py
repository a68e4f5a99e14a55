"""The tables in docs/tasks.md agree with the environments."""

import re
import warnings
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import sim
from sim.envs.registration import IDS
from sim.physics.sliding_agents import UNSTABLE
from sim.tasks.reward import EVALUATION, TERMS, TRAINING
from sim.tasks.simulation import NO_ACTION
from sim.worlds.catalog import EPISODE_STEPS
from tests.sim.envs.test_task_vec_env import Face

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "tasks.md").read_text()
EYES = sim.Eyes(n_eyes=3, resolution=(2, 4))


class Dimmed(Face):
    vary = {"light": (0.1, 1.0)}  # noqa: RUF012


def table(heading):
    """Return the rows of the first table under a heading, as lists of cells without backquotes."""
    section = PAGE.split(f"# {heading}\n", 1)[1].split("\n#", 1)[0]
    rows = [line.strip("|").split("|") for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip().strip("`") for cell in row] for row in rows[2:]]


def test_every_task_and_id_is_there():
    assert {row[1]: row[0] for row in table("Tasks")} == IDS
    assert set(sim.TASKS) == set(IDS.values())


@pytest.mark.parametrize("task", sim.TASKS)
def test_observations_are_those_of_the_table(task):
    env = gymnasium.make(next(i for i, t in IDS.items() if t == task), eyes=EYES, memory=5, rays_per_receptor=1)
    rows = {row[0]: row for row in table("Observation")}
    assert set(env.observation_space.spaces) == set(rows)
    assert env.observation_space["eyes"].shape == (5, 3, 3, 2, 4)
    for key in ("contact", "previous_action"):
        space, (_, shape, kind, bounds, _) = env.observation_space[key], rows[key]
        assert str(space.shape) == shape
        assert space.dtype.name == kind
        assert [space.low.min(), space.high.max()] == [float(x) for x in re.findall(r"-?\d+", bounds)]
    assert env.action_space == gymnasium.spaces.Box(-1, 1, (len(table("Action")),), np.float32)


def test_reward_terms_and_weights_are_those_of_the_table():
    rows = {row[0]: row for row in table("Reward")}
    assert tuple(rows) == TERMS
    for name, row in rows.items():
        assert [float(row[1]), float(row[2])] == [getattr(TRAINING, name), getattr(EVALUATION, name)]


def test_info_keys_are_those_of_the_table():
    documented = {row[0]: row[1] for row in table("Info")}
    always = {key for key, when in documented.items() if when == "always" or when.startswith("every step")}
    venv = sim.make_vec_env("navigation", EYES, 2, 0, rays_per_receptor=1)
    venv.reset()
    assert all(set(info) == always for info in venv.reset_infos)
    seen = set()
    for step in range(EPISODE_STEPS):
        actions = np.tile([-1.0, 0.2], (2, 1))
        actions[1] = np.nan if step == 3 else actions[1]
        _, _, done, infos = venv.step(actions)
        for ended, info in zip(done, infos, strict=True):
            assert always <= set(info) <= set(documented)
            assert ended or set(info) == always
            seen |= set(info)
    assert seen == set(documented) - {"given_up", "varied", "adversary_first"}
    dusky = sim.make_vec_env("navigation", EYES, 2, 0, rays_per_receptor=1, vary={"light": (0.1, 1.0)})
    dusky.reset()
    assert all(set(info) == always | {"varied"} for info in dusky.reset_infos)
    hasty = sim.make_vec_env("navigation", EYES, 2, 0, rays_per_receptor=1, least_return=-1.0)
    hasty.reset()
    assert any("given_up" in info for _ in range(64) for info in hasty.step(np.tile([1.0, 0.0], (2, 1)))[3])
    assert f"{EPISODE_STEPS} actions" in {row[0] for row in table("Endings")}
    assert all(f'"{reason}"' in PAGE for reason in (UNSTABLE, NO_ACTION))


def test_tasks_of_ones_own_say_no_more_than_the_table_has():
    documented = {row[0] for row in table("Info")}
    elsewhere = {row[0] for row in table("Info") if row[2].endswith("not in user tasks")} | {"given_up"}
    env = sim.make_vec_env(Dimmed(), n_envs=2)
    env.reset()
    assert elsewhere == {"position", "heading", "given_up", "adversary_first"}
    always = {"reward_terms", "is_success", "varied"}
    assert all(set(info) == always for info in env.reset_infos)
    seen = set()
    for step in range(Dimmed.episode_steps):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            infos = env.step(np.array([[0.0], [np.nan if step == 3 else 0.0]]))[3]
        seen |= set().union(*infos)
    assert seen == documented - elsewhere


def test_arguments_are_those_of_the_table():
    import inspect

    taken = inspect.signature(sim.make_vec_env).parameters
    for name, default, _ in table("Arguments"):
        if name != "eyes":
            assert str(taken[name].default) == default.strip('"')
    named = {row[0] for row in table("Arguments")} | {"task", "n_envs", "seed"}
    assert set(taken) == named
