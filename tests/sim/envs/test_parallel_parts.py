"""The environment of several animals in one world, with a stand-in for the animals."""

from types import SimpleNamespace

import numpy as np
import pytest

import sim
from sim.envs import parallel_env
from sim.envs.calls import CallOrder
from sim.envs.parallel_env import EncounterEnv
from tests.sim.envs.hunt import Predator, Prey


@pytest.fixture
def pair():
    """Return an environment of two animals whose worlds are a stand-in."""
    env = EncounterEnv.__new__(EncounterEnv)
    env.possible_agents, env.agents, env.render_mode = ["Prey", "Predator"], [], None
    env._calls, log = CallOrder(), []
    flags = {name: np.array([False, False]) for name in ("terminated", "truncated")}
    env.outcome = SimpleNamespace(
        **flags, reward=np.array([1.0, -1.0]), success=np.array([True, False]), failure={},
        terms=SimpleNamespace(rows=[{"t": 0}, {"t": 1}]),
    )  # fmt: skip
    simulation = SimpleNamespace(variation_info=lambda world: {"world": world}, close=lambda: log.append("closed"))
    env._animals = SimpleNamespace(
        simulation=simulation,
        seed=lambda seed: log.append(("seed", seed)),
        reset=lambda: [{"eyes": np.array([3])}, {"eyes": np.array([4])}],
        advance=lambda actions: (
            log.append([action.tolist() for action in actions]) or SimpleNamespace(step=env.outcome)
        ),
        seen=lambda advanced: "frames",
        remember=lambda seen, fresh: log.append((seen, len(fresh))) or [{"eyes": np.array([k])} for k in (5, 6)],
    )
    env._pictures = SimpleNamespace(taken=lambda: ["first", "second"])
    env.observation_spaces, env.log = {"Prey": "space"}, log
    env.action_spaces = {name: SimpleNamespace(shape=(2,)) for name in env.possible_agents}
    return env


ACTIONS = {"Predator": [0.5, 0.25], "Prey": [1.0, 0.0]}


def test_two_animals_begin(pair):
    with pytest.raises(RuntimeError, match="call reset first"):
        pair.step(ACTIONS)
    observations, infos = pair.reset(seed=0)
    assert observations == {"Prey": {"eyes": 3}, "Predator": {"eyes": 4}}
    assert infos == {name: {"reward_terms": {}, "is_success": False, "world": 0} for name in ("Prey", "Predator")}
    pair.reset()
    assert pair.log == [("seed", 0)]
    assert pair.observation_space("Prey") == "space"
    assert pair.action_space("Prey").shape == (2,)
    assert pair.agents is not pair.possible_agents


@pytest.mark.parametrize("end", [None, "terminated", "truncated"])
def test_two_animals_act(pair, end):
    """An episode ends for all animals at once, also if only one of them has reached its end."""
    pair.reset()
    if end is not None:
        getattr(pair.outcome, end)[1] = True
        pair.outcome.failure = {0: "broken"}
    observations, rewards, terminated, truncated, infos = pair.step(ACTIONS)
    assert pair.log == [[[[1.0, 0.0]], [[0.5, 0.25]]], ("frames", 0)]
    assert observations == {"Prey": {"eyes": 5}, "Predator": {"eyes": 6}}
    assert rewards == {"Prey": 1.0, "Predator": -1.0}
    assert terminated == {"Prey": False, "Predator": end == "terminated"}
    assert truncated == {"Prey": False, "Predator": end == "truncated"}
    failure = {} if end is None else {"failure": "broken"}
    assert infos["Prey"] == {"reward_terms": {"t": 0}, "is_success": True, "world": 0, **failure}
    assert infos["Predator"] == {"reward_terms": {"t": 1}, "is_success": False, "world": 0, **failure}
    assert pair.agents == ([] if end else ["Prey", "Predator"])
    if end:
        assert pair.step({}) == ({}, {}, {}, {}, {})


def test_actions_of_each_animal_are_required(pair):
    pair.reset()
    for actions, reason in (
        ({"Prey": [0, 0]}, "'Predator' has none: must have one for each of Prey, Predator"),
        ({**ACTIONS, "Pray": [0, 0]}, "no animal 'Pray'.*did you mean 'Prey'"),
        ({**ACTIONS, "xxxxx": [0, 0]}, "no animal 'xxxxx': there are Prey, Predator"),
        ({**ACTIONS, "Prey": [0, 0, 0]}, "action of 'Prey' has shape"),
    ):
        with pytest.raises(ValueError, match=reason):
            pair.step(actions)


def test_images_of_two_animals(pair):
    assert pair.render() is None
    pair.render_mode = "eyes"
    with pytest.raises(RuntimeError, match="call reset first"):
        pair.render()
    pair.reset()
    assert pair.render() == ["first", "second"]
    pair.render_mode = "rgb_array"
    assert pair.render() == "first"
    pair.close()
    assert pair.log == ["closed"]
    with pytest.raises(RuntimeError, match="closed"):
        pair.reset()


def test_one_world_is_built_for_two_animals(monkeypatch):
    made = []
    monkeypatch.setattr(parallel_env, "batched", lambda encounter: "task")
    monkeypatch.setattr(
        parallel_env, "Simulation", lambda *given: made.append(given) or SimpleNamespace(agents=["a", "b"])
    )
    monkeypatch.setattr(parallel_env, "PreparedTask", lambda task: SimpleNamespace(fidelities=f"of {task}"))
    monkeypatch.setattr(parallel_env, "renderers_for", lambda *given: made.append(given[1:]) or "renderers")
    learners = [SimpleNamespace(observation_space=k, action_space=-k) for k in (1, 2)]
    monkeypatch.setattr(
        parallel_env, "Animals", lambda simulation, *given: made.append(given) or SimpleNamespace(learners=learners)
    )
    env = EncounterEnv(sim.Encounter(Prey(), Predator()), 7, 3, "eyes")
    assert made == [("task", 1, 7), (["a", "b"], "of task", None), ("renderers", 3)]
    assert env.observation_spaces == {"Prey": 1, "Predator": 2}
    assert env.action_spaces == {"Prey": -1, "Predator": -2}
    assert (env.possible_agents, env.agents, env.render_mode) == (["Prey", "Predator"], [], "eyes")
