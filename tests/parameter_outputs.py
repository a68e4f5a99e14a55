"""Outputs that a setting or a gene must change. Each is a function of a config and the first animal."""

from collections import Counter
from contextlib import ExitStack, closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar
from unittest import mock

import numpy as np
import pytest

import sim
from evolve.learning import fitness
from evolve.learning.animal_task import animal_task
from evolve.learning.training_envs import TrainingEnvs, worlds_of
from evolve.runs import carry_on
from evolve.search.loop import evolve as carry
from evolve.store.directory import Run
from sim.envs.prepared_task import PreparedTask
from tests.closed_form import ClosedForm
from tests.evolve.learning.bright_spot import BrightSpot


class Pen(BrightSpot):
    """A spot of light on a plane, observed without rendering.

    Moving has a cost, in the reward term that contact has in sim's worlds.
    """

    failures: ClassVar = Counter()

    def step_wait(self):
        observation, reward, done, infos = super().step_wait()
        cost = -0.1 * np.abs(self.action[:, 0])
        for info, contact in zip(infos, cost, strict=True):
            info["reward_terms"]["contact"] = contact
        return observation, reward + cost, done, infos


def pens(animal, config, *seeds):
    """Replace `worlds_of`: return environments without rendering."""
    episodes = config.evaluation.episodes
    return TrainingEnvs(*(Pen(n, memory=animal.memory_frames) for n in (config.learning.n_envs, episodes, episodes)))


def life(config, animal):
    """Return the result of a candidate: its training, and the returns of its evaluation episodes.

    Learning is real, in worlds that take milliseconds.
    """
    with TemporaryDirectory() as folder, mock.patch.object(fitness, "worlds_of", pens):
        outcome = fitness.evaluate(animal, config, 7, Path(folder) / "policy")
    assert outcome.failure is None
    return outcome.returns, outcome.steps, outcome.curve


def views(config, animal):
    """First observation of the animal in each of its training, selection and test environments."""
    found = []
    for each in vars(worlds_of(animal, config, 7, 8)).values():
        with closing(each):
            found.append(each.reset()["eyes"].tobytes())
    return found


def layouts(config, animal):
    """Walls and lengths of episodes of the worlds in training, evaluation and test."""
    found = []
    for where in (config.world.training, config.world.evaluation, config.world.test):
        world = sim.build_world(config.task, **where)
        found.append((world.episode_steps, world.model.geom_pos.tobytes(), world.model.geom_size.tobytes()))
    return found


def rides(config, animal):
    """Rewards and ends of training episodes. The animals go straight on at full speed, mostly into a wall."""
    lessons, *others = vars(worlds_of(animal, config, 7, 8)).values()
    with ExitStack() as stack:
        for each in (lessons, *others):
            stack.enter_context(closing(each))
        lessons.reset()
        ahead = np.tile(np.float32([1, 0]), (lessons.num_envs, 1))
        return [[part.tolist() for part in lessons.step(ahead)[1:3]] for _ in range(64)]


def sight(config, animal):
    """First observation of the animal in its world."""
    eyes, memory = animal.eyes(config.eye), animal.memory_frames
    worlds = sim.make_vec_env(config.task, eyes, 1, 7, memory=memory, rays_per_receptor=4)
    try:
        return worlds.reset()["eyes"].tobytes()
    finally:
        worlds.close()


def moving_sight(config, animal):
    """Observations of the animal while it moves in its world, without noise."""
    worlds = PreparedTask(animal_task(animal, config)).vec_env(1, 7, animal.memory_frames)
    with closing(worlds):
        worlds.reset()
        return [worlds.step(np.float32([[1, turn]]))[0]["eyes"].tobytes() for turn in (0.5, -0.2, 0.0)]


def own_sight(config, animal):
    """First observation of the animal in a user task."""
    worlds = PreparedTask(animal_task(animal, config)).vec_env(1, 7, animal.memory_frames)
    try:
        return worlds.reset()["eyes"].tobytes()
    finally:
        worlds.close()


def point_image(config, animal):
    """Image of a point on the retina, through pupil and relief."""
    return animal.eyes(config.eye).eye().kernel(3).tobytes()


def throughput(config, animal):
    """Fraction of the light that the pupil transmits."""
    return animal.eyes(config.eye).eye().throughput


def history(config, animal):
    """Candidates of the whole run with the seeds of their training, evaluated in closed form."""
    with TemporaryDirectory() as folder:
        run = Run.create(Path(folder) / "run", config)
        carry(run, ClosedForm(), mock.Mock())
        return [(candidate.genome, candidate.phenotype, candidate.seed) for candidate in run.candidates]


def budget_stages(config, animal):
    """Rungs after which candidates are evaluated, and the training steps of each."""
    with TemporaryDirectory() as folder:
        run = Run.create(Path(folder) / "run", config)
        carry(run, ClosedForm(), mock.Mock())
        return [(candidate.id, candidate.rung, candidate.steps) for candidate in run.in_order_of_finish]


def charges(config, animal):
    """Fitness of the candidates of a run, after costs."""
    with TemporaryDirectory() as folder:
        run = Run.create(Path(folder) / "run", config)
        carry(run, ClosedForm(), mock.Mock())
        return [(candidate.id, candidate.fitness) for candidate in run.candidates]


def hired(config, animal):
    """Number of workers that a run starts."""
    with TemporaryDirectory() as folder, mock.patch.object(carry_on, "LocalExecutor") as executor:
        executor.side_effect = KeyboardInterrupt
        with pytest.raises(KeyboardInterrupt):
            carry_on.carry_on(Run.create(Path(folder) / "run", config), mock.Mock())
        return executor.call_args.args[1]
