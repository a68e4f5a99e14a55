"""The single list of tasks agrees with all places that use tasks by name."""

import subprocess
import sys

import gymnasium
import pytest

import sim
from evolve.config.run_config import TASKS as CONFIGURABLE
from sim.envs.registration import IDS
from sim.tasks.find_goal import FindGoal
from sim.tasks.find_way import FindWay
from sim.tasks.registry import task_of
from sim.worlds.catalog import TASKS


def test_everyone_has_the_same_list():
    assert tuple(TASKS) == sim.TASKS
    assert CONFIGURABLE is TASKS
    assert list(IDS.values()) == list(TASKS)
    assert all(id_ in gymnasium.registry for id_ in IDS)
    assert "rhabdom/Foraging-v0" in IDS


@pytest.mark.parametrize("task", TASKS)
def test_every_task_has_a_world_and_rules(task):
    world = sim.build_world(task)
    assert world.task == task
    rules = task_of(world)
    assert isinstance(rules, FindWay if world.goal_region is not None else FindGoal)
    assert getattr(rules, "moving", False) == (task == "tracking")


def test_the_list_is_had_without_mujoco():
    code = "import sys, sim.worlds.catalog; print('mujoco' in sys.modules, 'drjit' in sys.modules)"
    child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert child.stdout.split() == ["False", "False"]
