"""Threads, memory, numbers of rays, and the methods of environments whose worlds share one environment."""

import copy
import os
import pickle
import sys
from types import SimpleNamespace

import drjit
import numpy as np
import pytest
import threadpoolctl

from sim.envs import prepared_task
from sim.envs.observation import Memory
from sim.envs.one_environment import OneEnvironment
from sim.envs.prepared_task import PreparedTask, _at_most
from sim.envs.threads import set_threads
from sim.render.edge_rays import FIRST
from sim.render.fidelity import Fidelity


def test_threads_reach_all_libraries(monkeypatch):
    calls = {}
    monkeypatch.setattr(drjit, "set_thread_count", lambda n: calls.setdefault("drjit", n))
    monkeypatch.setattr(threadpoolctl, "threadpool_limits", lambda n: calls.setdefault("loaded", n))
    monkeypatch.setitem(sys.modules, "torch", SimpleNamespace(set_num_threads=lambda n: calls.setdefault("torch", n)))
    names = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
    for name in names:
        monkeypatch.setenv(name, "7")
    set_threads(1024)
    assert calls == {"drjit": 1024, "loaded": 1024, "torch": 1024}
    assert {os.environ[name] for name in names} == {"1024"}
    monkeypatch.delitem(sys.modules, "torch")
    calls.clear()
    set_threads()
    assert calls == {"drjit": 1, "loaded": 1}
    with pytest.raises(ValueError, match="count = 1025"):
        set_threads(1025)


class Alone(OneEnvironment):
    """Three worlds that do nothing."""

    reset = step_async = step_wait = close = None

    def __init__(self, render_mode=None):
        self.render_mode, self.num_envs, self.color = render_mode, 3, "red"

    def get_images(self):
        return [np.full((2, 2, 3), k, np.uint8) for k in range(3)]

    def paint(self, color, times=1):
        self.color = color * times
        return times


Alone.__abstractmethods__ = frozenset()


def test_attributes_and_methods_of_all_worlds():
    env = Alone()
    assert env.get_attr("color") == ["red"] * 3
    assert env.get_attr("color", [1, 2]) == ["red"] * 2
    env.set_attr("color", "blue", [0, 1, 2])
    assert env.env_method("paint", "ab", times=2, indices=None) == [2, 2, 2]
    assert env.color == "abab"
    assert (env.env_is_wrapped(object), env.env_is_wrapped(object, [1])) == ([False] * 3, [False])
    with pytest.raises(ValueError, match=r"^set_attr: the worlds share one environment"):
        env.set_attr("color", "blue", [0])
    with pytest.raises(ValueError, match=r"^env_method: the worlds share one environment"):
        env.env_method("paint", "c", indices=1)
    assert env.color == "abab"
    assert env.seed(5) == [5] * 3
    for refuse in (pickle.dumps, copy.copy):
        with pytest.raises(TypeError, match="Alone cannot be pickled or copied"):
            refuse(env)


def test_images_of_signals_are_tiled():
    found = Alone("eyes").render()
    assert found.shape == (4, 4, 3)
    assert sorted(np.unique(found)) == [0, 1, 2]
    np.testing.assert_array_equal(Alone("eyes").render("eyes"), found)


@pytest.mark.parametrize("frames", [0, -1])
def test_a_memory_without_frames_is_refused(frames):
    with pytest.raises(ValueError, match=rf"memory = {frames}: must be at least 1 frame"):
        Memory(frames)


def test_at_most_as_many_rays():
    edges = Fidelity(100, 2, samples="edges")
    assert _at_most(edges, FIRST) == Fidelity(FIRST, 2, samples="edges")
    assert _at_most(edges, FIRST - 1) == Fidelity(FIRST - 1, 2, samples="rays")
    assert _at_most(edges, 1000) == edges
    assert _at_most(Fidelity(8, 2, samples="areas"), 1) == Fidelity(1, 2, samples="areas")
    task = SimpleNamespace(agents=lambda: [SimpleNamespace(learns=learns) for learns in (True, False, False)])
    prepared = PreparedTask.__new__(PreparedTask)
    prepared.task, prepared.fidelities = task, [{"a": edges, "b": Fidelity(2, 2)}, {"a": edges}, None]
    found = prepared.at_most(5)
    assert found.fidelities == [{"a": Fidelity(5, 2, samples="edges"), "b": Fidelity(2, 2)}, {"a": edges}, None]
    assert prepared.fidelities[0] == {"a": edges, "b": Fidelity(2, 2)}
    assert (prepared.fidelity, found.fidelity.rays_per_receptor) == (edges, 5)


def test_a_prepared_task_in_another_mode_and_elsewhere():
    prepared = PreparedTask.__new__(PreparedTask)
    prepared.task, prepared._scenes = SimpleNamespace(in_mode=lambda mode: f"task in {mode}"), "scenes"
    assert prepared.in_mode("test").task == "task in test"
    elsewhere = prepared.elsewhere("other")
    assert (elsewhere.task, elsewhere._scenes, prepared._scenes) == ("other", None, "scenes")


def test_a_renderer_of_the_first_kind_of_eyes_of_the_first_agent(monkeypatch):
    """The simulation may run the task with other eyes."""
    asked = []

    def renderers(*given):
        asked.append(given)
        return [SimpleNamespace(eyes={"a": "first", "b": "second"})]

    monkeypatch.setattr(prepared_task, "renderers_for", renderers)
    prepared = PreparedTask.__new__(PreparedTask)
    prepared.task, prepared._scenes = SimpleNamespace(agents=lambda: ["one", "two"]), "scenes"
    prepared.fidelities = ["fidelity of one", "fidelity of two"]
    assert prepared.renderer("simulation") == "first"
    assert asked == [("simulation", ["one"], ["fidelity of one"], "scenes")]
