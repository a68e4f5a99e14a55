"""All agents of all worlds, with stand-ins for their senses: construction, observations and states."""

from types import SimpleNamespace

import numpy as np
import pytest

from sim.envs import animals
from sim.envs.animals import Animals
from sim.tasks.per_world import PerWorld


class Senses:
    """Stand-in for the senses of one agent, whose state is one array."""

    def __init__(self, simulation, number, renderers, memory):
        self.given, self.agent = (number, renderers, memory), SimpleNamespace(name=f"agent {number}")
        self.has_auxiliary, self.log, self.state = renderers == "auxiliary", [], {"noise": np.zeros(3)}

    def restart(self):
        self.log.append("restart")

    def observation(self, frames, fresh):
        return {"of": self.given[0], "frames": frames, "fresh": fresh}

    def launch(self, poses, worlds):
        return f"{self.given[0]} {poses} {worlds}"

    def get_state(self):
        return {name: array.copy() for name, array in self.state.items()}

    def set_state(self, state):
        self.state = state


@pytest.fixture
def built(monkeypatch):
    """Return two learners, of which the second has no eyes, and three frozen animals, of which the second has none."""
    compared = []
    monkeypatch.setattr(animals, "Senses", Senses)
    monkeypatch.setattr(animals, "_require_fit", lambda other, senses: compared.append((other.memory, senses.given[0])))
    task = PerWorld.__new__(PerWorld)
    monkeypatch.setattr(PerWorld, "frozen", tuple(SimpleNamespace(memory=k) for k in (5, 6, 7)), raising=False)
    log = []
    simulation = SimpleNamespace(
        task=task,
        n=3,
        learners=2,
        poses=lambda: "poses",
        seed=lambda seed: log.append(("seed", seed)),
        get_state=lambda: {"physics": np.arange(3.0)},
        set_state=lambda state, chosen: log.append((state["physics"].tolist(), chosen.tolist())),
    )
    found = Animals(simulation, ["a", None, "auxiliary", None, "c"], 4)
    found.log, found.compared = log, compared
    return found


def test_learners_come_first(built):
    """Agents keep their numbers in the simulation, and frozen animals the memory of their policies."""
    assert [senses.given for senses in built.learners] == [(0, "a", 4)]
    assert [senses and senses.given for _, senses in built._frozen] == [(2, "auxiliary", 5), None, (4, "c", 7)]
    assert [senses.given[0] for senses in built.seeing] == [0, 2, 4]
    assert [senses.given[0] for senses in built._with_auxiliary] == [2]
    assert built.compared == [(5, 2), (7, 4)]


def test_a_task_without_frozen_animals(monkeypatch, built):
    built.simulation.task, built.simulation.learners = object(), 1
    found = Animals(built.simulation, ["a"], 4)
    assert (len(found.learners), found._frozen) == (1, [])


def test_all_noise_restarts(built):
    built.seed(5)
    assert built.log == [("seed", 5)]
    assert [senses.log for senses in built.seeing] == [["restart"]] * 3


def test_observations_are_those_of_learners(built):
    (found,) = built.remember(["x", "y", "z"], "fresh")
    assert found == {"of": 0, "frames": "x", "fresh": "fresh"}
    assert built.launch() == ["0 poses None", "2 poses None", "4 poses None"]
    assert built.launch("some")[2] == "4 poses some"
    frame = SimpleNamespace(wait=lambda: "image")
    built.start_episodes = lambda worlds: [{"eyes": frame}] * 3 if worlds.tolist() == [0, 1, 2] else None
    (found,) = built.reset()
    assert (found["frames"], found["fresh"].tolist()) == ({"eyes": "image"}, [0, 1, 2])


def test_first_frames_replace_those_of_ended_episodes(built):
    seen = [{"eyes": np.array([1, 2, 3])}, {"eyes": np.array([4, 5, 6])}]
    pending = [{"eyes": SimpleNamespace(wait=lambda k=k: np.array([k, k + 1]))} for k in (10, 20)]
    built.replace(seen, np.array([2, 0]), pending)
    assert [frames["eyes"].tolist() for frames in seen] == [[11, 2, 10], [21, 5, 20]]


def test_states_of_all_agents(built):
    """Only the chosen worlds are restored."""
    state = built.get_state()
    assert set(state) == {"physics", "noise", "agent 2.noise", "agent 4.noise"}
    for k, name in enumerate(("noise", "agent 2.noise", "agent 4.noise")):
        state[name] = np.arange(3.0) + 10 * (k + 1)
    built.set_state(state, np.array([2, 0]))
    assert built.log == [([0, 1, 2], [2, 0])]
    assert [senses.state["noise"].tolist() for senses in built.seeing] == [[10, 0, 12], [20, 0, 22], [30, 0, 32]]
