"""Every argument of the functions that make environments changes an output, or it is refused with a reason."""

import inspect
from contextlib import closing
from functools import cache

import gymnasium
import numpy as np
import pytest

import sim
from tests.sim.envs.hunt import Prey, hunt
from tests.sim.envs.test_task_vec_env import Face

EYES = sim.Eyes(n_eyes=1, resolution=(2, 5), fov_deg=70, bands=2)
LAYOUT = "only built-in tasks have layouts; the world of a user task is its model"
SET = "a user task defines it by its setting"
CHANGES = None  # the value changes an output


class Rail(Face):
    """A cart whose episode ends at once if it is evaluated."""

    def terminated(self, data):
        return self.mode == "evaluation"


# For each argument: a value, and what it does for a built-in task and for a user task. Words are of a refusal.
ARGUMENTS = {
    "task": ("tracking", CHANGES, CHANGES),
    "eyes": (sim.Eyes(n_eyes=1, resolution=(2, 6), bands=2), CHANGES, "a user task defines its eyes by its settings"),
    "n_envs": (2, CHANGES, CHANGES),
    "seed": (1, CHANGES, CHANGES),
    "memory": (2, CHANGES, CHANGES),
    "mode": ("evaluation", CHANGES, CHANGES),
    "rays_per_receptor": (3, CHANGES, "a user task defines it by its setting fidelity"),
    "fidelity": (sim.Fidelity(3, bands=3), "rays_per_receptor = 1: must be left out", f"{SET} fidelity"),
    "world_seed": (1, CHANGES, LAYOUT),
    "mazes": (2, CHANGES, LAYOUT),
    "course": ("long", CHANGES, LAYOUT),
    "layouts": (sim.LayoutFamily(seed=1, n_training=1, n_selection=1, n_test=1).training, CHANGES, LAYOUT),
    "wall_height": (0.5, CHANGES, LAYOUT),
    "least_return": (-1e-3, CHANGES, CHANGES),
    "episode_steps": (1, CHANGES, CHANGES),
    "spectra": ({"wall": "foliage"}, CHANGES, f"{SET} spectra"),
    "medium": ("fog", CHANGES, f"{SET} medium"),
    "vary": ({"light": (0.1, 0.2)}, CHANGES, f"{SET} vary"),
    "auxiliary": (("depth",), CHANGES, f"{SET} auxiliary"),
    "render_mode": ("eyes", CHANGES, CHANGES),
}
GIVEN = {"n_envs": 1, "seed": 0}
# Tasks in which an argument has an effect. Detection has one layout, and only navigation has courses.
TASKS = {"world_seed": "maze", "mazes": "maze", "course": "navigation", "layouts": "maze", "wall_height": "maze"}
OF_ONE_WORLD = {
    "n_envs": "this is one world: make_vec_env has several",
    "seed": r"pass it to reset\(seed=...\)",
}


STEPS = {"least_return": 64}  # in built-in tasks; other arguments have an effect in the first three steps


def outputs(env, steps):
    """Return spaces, observations, rewards, ends and images of a few steps at full speed."""
    with closing(env):
        seen = env.reset()
        found = [str(env.observation_space), env.num_envs]
        for _ in range(steps):
            found += [
                {name: part.tolist() for name, part in seen.items()},
                [image.tobytes() for image in env.get_images()],
            ]
            seen, reward, done, _ = env.step(np.ones((env.num_envs, *env.action_space.shape), np.float32))
            found += [reward.tolist(), done.tolist()]
    return found


def made(task, steps=3, **given):
    of_task = {} if isinstance(task, sim.Task) else {"eyes": EYES, "rays_per_receptor": 1}
    return outputs(sim.make_vec_env(**{"task": task, **GIVEN, **of_task, **given}), steps)


@cache
def unchanged(task, steps):
    return made(Rail() if task is Rail else task, steps)


def test_the_table_names_every_argument():
    assert [*ARGUMENTS] == [*inspect.signature(sim.make_vec_env).parameters]


@pytest.mark.parametrize("user", [False, True])
@pytest.mark.parametrize("name", ARGUMENTS)
def test_every_argument_has_an_effect_or_is_refused(name, user):
    value, *said = ARGUMENTS[name]
    task = Rail if user else TASKS.get(name, "detection")
    given = {"task": Rail() if user else task, name: value, "steps": 3 if user else STEPS.get(name, 3)}
    if said[user] is CHANGES:
        assert made(**given) != unchanged(task, given["steps"])
    else:
        with pytest.raises(ValueError, match=said[user]) as refused:
            made(**given)
        assert str(refused.value).startswith(f"{name} = ") or name == "fidelity"


@pytest.mark.parametrize("make", [sim.make_env, lambda task, **given: gymnasium.make_vec("Rail-v0", 2, **given)])
@pytest.mark.parametrize("name", sorted(OF_ONE_WORLD))
def test_other_functions_refuse_arguments_that_they_do_not_have(make, name):
    sim.register_task("Rail-v0", Rail)
    with pytest.raises(ValueError, match=f"{name} = 3: must be left out, ({OF_ONE_WORLD[name]}|it is num_envs here)"):
        make(Rail(), **{name: 3})


@pytest.mark.parametrize("make", [sim.make_env, lambda task, **given: gymnasium.make_vec("Rail-v0", 2, **given)])
def test_unknown_arguments_are_named(make):
    sim.register_task("Rail-v0", Rail)
    with pytest.raises(ValueError, match=r"memry = 3: unknown, must be an argument .* did you mean 'memory'\?"):
        make(Rail(), memry=3)


def test_a_mode_of_the_task_is_refused():
    """An environment would replace it by its own."""
    task = Rail()
    task.mode = "evaluation"
    with pytest.raises(
        ValueError, match=r"Rail: mode = 'evaluation': must be left out, the environment's mode sets it"
    ):
        sim.make_vec_env(task, n_envs=1)
    sim.make_vec_env(task, n_envs=1, mode="evaluation").close()


PARALLEL = {"encounter": sim.Encounter(Prey()), "seed": 1, "memory": 2, "render_mode": "eyes"}


def test_every_argument_of_encounters_has_an_effect():
    def played(encounter=None, **given):
        with closing(sim.make_parallel_env(encounter or hunt(), **{"seed": 0, **given})) as env:
            seen, _ = env.reset()
            images = env.render()
        return {animal: (part["eyes"].tolist(), part["eyes"].shape) for animal, part in seen.items()}, str(images)

    assert [*PARALLEL] == [*inspect.signature(sim.make_parallel_env).parameters]
    before = played()
    assert played() == before
    for name, value in PARALLEL.items():
        assert played(**{name: value}) != before, name
