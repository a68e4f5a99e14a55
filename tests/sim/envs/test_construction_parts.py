"""Functions that build batched environments, with stand-ins for tasks and worlds."""

import inspect
from types import SimpleNamespace

import pytest

import sim
from sim.envs import assembly
from sim.envs.assembly import make_parallel_env, make_vec_env
from sim.envs.vec_env import EyesVecEnv
from tests.sim.envs.hunt import hunt
from tests.sim.envs.test_task_vec_env import Face

EYES, OTHER = (sim.Eyes(n_eyes=1, resolution=(1, n), bands=4) for n in (3, 4))

# --- functions that build environments


@pytest.fixture
def prepared(monkeypatch):
    """Return a list of the steps in which environments are built."""
    log = []

    class Prepared:
        def __init__(self, task):
            log.append(("prepared", task))

        def vec_env(self, *given, **options):
            log.append((given, options))
            return "environment"

    def task_of(world, mode, eyes, fidelity):
        log.append((world, mode, eyes, fidelity))
        return SimpleNamespace()

    def build_world(task, **options):
        log.append((task, options))
        return "world"

    monkeypatch.setattr(assembly, "PreparedTask", Prepared)
    monkeypatch.setattr(assembly, "task_of", task_of)
    monkeypatch.setattr(assembly, "build_world", build_world)
    monkeypatch.setattr(
        assembly, "batched", lambda task: SimpleNamespace(in_mode=lambda mode: (type(task).__name__, mode))
    )
    return log


def test_a_built_in_environment(prepared):
    assert make_vec_env("maze", None, 2, vary={}, auxiliary=()) == "environment"
    world, task, (_, built), made = prepared
    layout = {"seed": 0, "mazes": 1, "course": "short", "wall_height": assembly.WALL_HEIGHT}
    assert world == ("maze", {**layout, "layouts": None, "spectra": None, "medium": None})
    assert task == ("world", "training", sim.Eyes(), "auto")
    assert (built.vary, built.auxiliary) == (None, ())
    assert made == ((2, 0, 1), {"least_return": None, "episode_steps": None, "render_mode": None})


def test_a_built_in_environment_with_all_options(prepared):
    """A fidelity sets the number of bands of the eyes."""
    asked = sim.Fidelity(2, 7)
    make_vec_env(
        "maze", {"a": EYES, "b": OTHER}, 3, 5, memory=2, fidelity=asked, world_seed=4, mazes=2, course="long",
        wall_height=2.0, least_return=-1.0, episode_steps=9, spectra="spectra", medium="fog", vary={"light": (0.5, 1)},
        auxiliary=("depth",), render_mode="eyes", layouts="layouts",
    )  # fmt: skip
    world, task, (_, built), made = prepared
    layout = {"seed": 4, "mazes": 2, "course": "long", "wall_height": 2.0}
    assert world == ("maze", {**layout, "layouts": "layouts", "spectra": "spectra", "medium": "fog"})
    assert task[2:] == ({name: assembly.replace(of, bands=7) for name, of in (("a", EYES), ("b", OTHER))}, asked)
    assert (built.vary, built.auxiliary) == ({"light": (0.5, 1)}, ("depth",))
    assert made == ((3, 5, 2), {"least_return": -1.0, "episode_steps": 9, "render_mode": "eyes"})


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"episode_steps": 0}, "episode_steps = 0: must be a whole number, at least 1"),
        ({"eyes": 7}, r"eyes = 7: must be sim\.Eyes"),
        ({"world_seed": -1}, "world_seed = -1: must be a whole number, at least 0"),
        ({"n_envs": 0}, "n_envs = 0"),
        ({"memory": 0}, "memory = 0"),
        ({"seed": -1}, "seed = -1"),
        ({"mode": "x"}, "mode = 'x'"),
        ({"render_mode": "x"}, "render_mode = 'x'"),
        ({"least_return": "x"}, "least_return = 'x'"),
    ],
)
def test_bad_options_are_refused_before_a_world_is_built(prepared, options, reason):
    with pytest.raises(ValueError, match=rf"^{reason}"):
        make_vec_env("maze", **options)
    assert prepared == []


@pytest.mark.parametrize("task", [Face, hunt])
def test_an_environment_of_a_user_task(prepared, task):
    make_vec_env(task(), n_envs=1, episode_steps=1, mode="evaluation")
    assert prepared[0] == ("prepared", (type(task()).__name__, "evaluation"))
    assert prepared[1] == ((1, 0, 1), {"least_return": None, "episode_steps": 1, "render_mode": None})


@pytest.mark.parametrize("name", sorted(assembly.OF_TASKS))
def test_a_user_task_defines_its_worlds(prepared, name):
    with pytest.raises(ValueError, match=rf"^{name} = .*: must be left out, {assembly.OF_TASKS[name]}"):
        make_vec_env(Face(), **{name: 7})


def test_bad_user_tasks(prepared):
    with pytest.raises(ValueError, match=r"task is the class Face: must be an instance, such as Face\(\)"):
        make_vec_env(Face)
    with pytest.raises(ValueError, match="n_envs = 0"):
        make_vec_env(Face(), n_envs=0)
    evaluated, pair = Face(), hunt()
    evaluated.mode = "evaluation"
    pair.animals[1].mode = "test"
    for task, name in ((evaluated, "Face: mode = 'evaluation'"), (pair, "Predator: mode = 'test'")):
        with pytest.raises(ValueError, match=f"^{name}: must be left out"):
            make_vec_env(task)
    make_vec_env(evaluated, mode="evaluation")
    assert prepared == [("prepared", ("Face", "evaluation")), prepared[1]]


def test_defaults_of_arguments():
    """They are those of docs/tasks.md. Tables of results refer to them."""
    found = {
        name: one.default for name, one in inspect.signature(make_vec_env).parameters.items() if one.default is not None
    }
    assert (found["n_envs"], found["seed"], found["memory"]) == (64, 0, 1)
    assert (found["world_seed"], found["mazes"], found["mode"]) == (0, 1, "training")
    found = inspect.signature(make_parallel_env).parameters
    assert (found["seed"].default, found["memory"].default) == (0, 1)
    assert inspect.signature(EyesVecEnv).parameters["memory"].default == 1


def test_an_environment_of_several_animals(monkeypatch):
    from sim.envs import parallel_env

    monkeypatch.setattr(parallel_env, "EncounterEnv", lambda *given: given)
    pair = hunt()
    assert make_parallel_env(pair) == (pair, 0, 1, None)
    assert make_parallel_env(pair, None, memory=3, render_mode="eyes") == (pair, None, 3, "eyes")
    for options, reason in (
        ({"seed": -1}, "seed = -1"),
        ({"memory": 0}, "memory = 0"),
        ({"render_mode": "x"}, "render_mode = 'x'"),
    ):
        with pytest.raises(ValueError, match=reason):
            make_parallel_env(pair, **options)
    with pytest.raises(ValueError, match=r"^encounter = .*: must be a sim\.Encounter"):
        make_parallel_env(Face())
    monkeypatch.setattr(assembly, "find_spec", lambda name: None)
    with pytest.raises(ImportError, match="needs PettingZoo"):
        make_parallel_env(pair)
