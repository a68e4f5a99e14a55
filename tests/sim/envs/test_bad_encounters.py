"""Encounters that are refused, and the report of an animal that fails."""

import random
import re

import numpy as np
import pytest

import optics
import sim
from tests.sim.envs.hunt import Animal, Predator, Prey, hunt, still


class Other(Prey):
    model = Prey.model.replace(".05", ".04")


class Longer(Predator):
    episode_steps = 30


class Accompanied(Predator):
    def __init__(self):
        super().__init__()
        self.others = (sim.Frozen(Prey()),)


class Untied(Predator):
    def __init__(self):
        super().__init__()
        self.mounts = (sim.Mount("predatr"),)


class Greedy(Predator):
    """A predator that drives all actuators of the model."""

    def __init__(self):
        super().__init__()
        self.actuators = None


def lit(animal, *levels):
    animal.vary = {"light": levels}
    return animal


class Unwired(Predator):
    def __init__(self):
        super().__init__()
        self.actuators = ("predator_x", "predator_z")


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (lambda: sim.Encounter(), "Encounter: no animals: must be one sim.Task at least"),
        (lambda: sim.Encounter(Prey(), Prey()), "Encounter: two animals are called 'Prey': must differ, give one of "),
        (lambda: sim.Encounter(Prey(), Predator), "Encounter = .*Predator.*: must be"),
        (lambda: sim.Encounter(Prey(), Other()), "Encounter: Prey and Other have different models: must be one model"),
        (lambda: sim.Encounter(Prey(), Longer()), "Encounter: episode_steps = 20 of Prey, 30 of Longer: must be equal"),
        (
            lambda: sim.Encounter(lit(Prey(), 1, 2), lit(Predator(), 0.1, 0.2)),
            "Encounter: vary of Prey and of Predator differ: must be equal, or set once",
        ),
        (
            lambda: sim.make_vec_env(sim.Encounter(Prey(), Greedy()).alone("Prey", {})),
            "Prey and Greedy: actuators: both drive 'prey_x': must name their own",
        ),
        (lambda: sim.Encounter(Prey(), Accompanied()), "Encounter: Accompanied has its own `others`: must be a task "),
        (lambda: hunt().alone("Pray", {}), "Encounter: no animal 'Pray'; did you mean 'Prey'"),
        (lambda: hunt().alone("Prey", {"Cat": None}), "Encounter: no animal 'Cat': it has Prey, Predator"),
        (lambda: hunt().alone("Prey", {"Prey": still}), "Encounter: policies: 'Prey' is the one that learns: must be"),
        (lambda: hunt().alone("Prey", {"Predator": 3}), "Frozen: policy = 3: must be a function, have `predict`, or"),
        (lambda: sim.Frozen(3), "Frozen: task = 3: must be a kind of Task"),
        (lambda: sim.make_vec_env(hunt(), n_envs=1), "Encounter: Prey has .*, Predator has .*: must be alike to learn"),
        (lambda: sim.make_env(hunt()), "task: several animals learn in a sim.Encounter: use the result of `alone`"),
        (lambda: sim.make_parallel_env(Prey()), "encounter = .*Prey.*: must be a sim.Encounter"),
        (lambda: sim.make_vec_env(sim.Encounter(Prey(), Untied()).alone("Untied", {})), "Mount: no site or camera or "),
        (
            lambda: sim.make_vec_env(sim.Encounter(Prey(), Unwired()).alone("Prey", {})),
            "Unwired: actuators: 'predator_z'",
        ),
    ],
)
def test_bad_encounters_are_refused_in_one_line(asked, words):
    with pytest.raises(ValueError, match=words) as caught:
        asked()
    assert "\n" not in str(caught.value)


def failing(observation):
    return 1 / 0


def short(observation):
    return np.zeros(3)


@pytest.mark.parametrize(
    ("policy", "words"),
    [
        (failing, "policy of 'Predator': ZeroDivisionError: division by zero"),
        (short, r"policy of 'Predator' returned actions of shape \(3,\): must be \(2, 2\)"),
    ],
)
def test_policies_that_fail_are_named(policy, words):
    env = sim.make_vec_env(hunt().alone("Prey", {"Predator": policy}), n_envs=2)
    env.reset()
    with pytest.raises(RuntimeError, match=words):
        env.step(np.zeros((2, 2)))


def late(observation):
    """Return actions that are NaN after the first movement."""
    return np.where(observation["previous_action"] > 0, np.nan, 1.0)


class Priceless(Animal):
    n_eyes, eye, name = 3, optics.Eye(resolution=(1, 6), fov_deg=100, bands=4), "Prey"

    def __init__(self):
        self.actuators, self.mounts = ("prey_x", "prey_y"), sim.ring("prey", 3, 240, radius=0.26)

    def rewards(self, data):
        return {"far": np.inf if data.time > 0.15 else 0.0}


@pytest.mark.parametrize(
    ("encounter", "policy", "words"),
    [
        (lambda: sim.Encounter(Priceless(), Predator()), still, "Prey: rewards: 'far' is inf: must be one finite"),
        (hunt, late, "Predator: action is not finite"),
    ],
)
def test_what_goes_wrong_is_the_animals_of_that_name(encounter, policy, words):
    env = sim.make_vec_env(encounter().alone("Prey", {"Predator": policy}), n_envs=2)
    env.reset()
    env.step(np.zeros((2, 2)))
    with pytest.warns(UserWarning, match=words):
        *_, infos = env.step(np.zeros((2, 2)))
    assert words in infos[0]["failure"]


@pytest.mark.parametrize("seed", range(4))
def test_an_eye_inside_a_geom_is_named_with_its_animal_and_its_position(seed):
    """Both kinds of checks are covered, during the choice of a fidelity and without it."""
    draw = random.Random(seed)
    animal, rest = (Prey(), Predator()) if seed % 2 else (Predator(), Prey())
    mounts, number = list(animal.mounts), draw.randrange(animal.n_eyes)
    ahead = draw.uniform(0.01, 0.15)
    mounts[number] = sim.Mount(animal.body, offset=(ahead, 0, 0.02))
    animal.mounts, animal.fidelity = tuple(mounts), "auto" if seed < 2 else animal.fidelity
    start = 0 if animal.body == "prey" else 2
    words = (
        f"{type(animal).__name__}: mounts[{number}] on '{animal.body}': in the reference pose of the model, the eye at "
        f"({start + ahead:.3g}, 0, 0.32) m of the world is inside geom {1 if animal.body == 'prey' else 2} of body "
        f"'{animal.body}', "
    )
    with pytest.raises(ValueError, match=f"^{re.escape(words)}"):
        sim.make_vec_env(sim.Encounter(animal, rest).alone(type(animal).__name__, {}), n_envs=1)
