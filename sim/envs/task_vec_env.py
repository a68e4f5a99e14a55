"""Tasks of one's own as a stable-baselines3 VecEnv: all eyes of all worlds in one kernel launch per step."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sim.envs import task_state
from sim.envs.one_environment import OneEnvironment
from sim.envs.task_animals import TaskAnimals
from sim.envs.task_pictures import TaskPictures
from sim.envs.task_senses import Senses
from sim.envs.task_worlds import StepOfWorld, TaskWorlds
from sim.render.model_renderer import ModelRenderer
from sim.tasks.encounter import Encounter
from sim.tasks.user_task import Task


class TaskVecEnv(OneEnvironment):
    """Many worlds of a `sim.Task`, or of a `sim.Encounter` whose animals, alike, learn one policy.

    Worlds start anew by themselves, as stable-baselines3 has it: what is returned is then the first observation of the
    new episode, info["terminal_observation"] the last of the old one, and `reset_infos` what is said of beginnings.
    Observations are "eyes" (memory, eye, channel, height, width), noise included (of several kinds of eyes an array
    each, by their names), "previous_action", and "feels", if the task's animal feels anything. `info` has reward_terms,
    is_success, varied (if the task varies anything), and failure where one of the task's methods fails: that ends the
    world's episode, and the others go on. Of an encounter, the first animal of all worlds comes first, then the second.

    failures: of the tasks' methods, and how many episodes each has ended

    task: what is done · n_envs: number of worlds · seed: of episodes and noise
    memory: frames in an observation · render_mode: "rgb_array" (with the animals' eyes and the rims of their fields of
        view), "eyes" or None
    episode_steps: actions, then an episode is truncated; None: as many as the task has

    Raises:
        ValueError: animals that learn together are not alike.
    """

    def __init__(
        self,
        task: Task | Encounter,
        n_envs: int,
        seed: int | None,
        memory: int = 1,
        render_mode: str | None = None,
        episode_steps: int | None = None,
    ) -> None:
        self.animals = TaskAnimals(task, n_envs, seed, memory, episode_steps)
        self.task, self.render_mode = task, render_mode
        self._pictures = TaskPictures(self.animals, render_mode)
        self._learners, self._everyone = self.animals.learners, np.arange(n_envs)
        if isinstance(task, Encounter):
            _require_alike(task, self._learners)
        first = self._learners[0]
        super().__init__(n_envs * len(self._learners), first.observation_space, first.action_space)
        self._commanded = np.zeros((self.num_envs, *self.action_space.shape), np.float32)
        self._returns, self.failures = np.zeros(self.num_envs), Counter[str]()

    @property
    def worlds(self) -> TaskWorlds:
        """Their physics."""
        return self.animals.worlds

    @property
    def renderer(self) -> ModelRenderer:
        """The eyes of the animal that learns; of the first, where several do, and of the first kind it has."""
        return self._learners[0].renderer

    def reset(self) -> dict[str, np.ndarray]:
        if self._seeds[0] is not None:
            self.animals.seed(self._seeds[0])
        self._reset_seeds()
        self._reset_options()
        self._returns[:] = 0.0
        observations = self.animals.reset()
        self.reset_infos = [self._first_info(row) for row in range(self.num_envs)]
        return _rows(observations)

    def step_async(self, actions: np.ndarray) -> None:
        actions = np.asarray(actions, np.float32)
        if actions.shape != self._commanded.shape:
            raise ValueError(f"actions have shape {actions.shape}: must be {self._commanded.shape}")
        self._commanded = actions

    def step_once(
        self, actions: np.ndarray
    ) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """One action without starting ended worlds anew: observation, reward, terminated, truncated, info."""
        self.step_async(actions)
        outcomes = self._moved()
        infos = self._infos(outcomes)
        reward = np.array([sum(outcome.terms.values()) for outcome in outcomes])
        terminated, truncated = (np.array([getattr(o, name) for o in outcomes]) for name in ("terminated", "truncated"))
        observations = self.animals.remember(self.animals.look(self._everyone), self._everyone[:0])
        return _rows(observations), reward, terminated, truncated, infos

    def step_wait(self) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, list[dict[str, Any]]]:
        outcomes = self._moved()
        infos, seen = self._infos(outcomes), self.animals.look(self._everyone)
        done = np.array([outcome.terminated or outcome.truncated for outcome in outcomes])
        n = len(self._everyone)
        ended = np.flatnonzero(done[:n])  # an episode ends for all its animals at once
        if len(ended):
            for number, senses in enumerate(self._learners):
                last = senses.preview(seen[number], ended)
                for k, world in enumerate(ended):
                    row = {name: array[k] for name, array in last.items()}
                    infos[number * n + world]["terminal_observation"] = row
            self._returns[done] = 0.0
            self.animals.begin_again(ended, seen)
            for index in np.flatnonzero(done).tolist():
                self.reset_infos[index] = self._first_info(index)
        reward = np.array([sum(outcome.terms.values()) for outcome in outcomes], np.float32)
        return _rows(self.animals.remember(seen, ended)), reward, done, infos

    def get_state(self) -> dict[str, np.ndarray]:
        """Where all worlds stand, as plain arrays whose first axis is the world: what follows from here depends on them
        and on the actions alone. What a task keeps in itself is the task's own business.

        Raises:
            RuntimeError: before the first reset, and where bodies may sleep.
        """
        self._require_begun()
        returns = self._returns.reshape(len(self._learners), -1).T
        return {**self.animals.state(), "returns": returns.copy()}

    def set_state(self, state: Mapping[str, np.ndarray], worlds: Sequence[int] | None = None) -> dict[str, np.ndarray]:
        """Go on from where these worlds (None: all) stood; the observation they had there.

        Raises:
            ValueError: the state is of another task or number of worlds, or there are no such worlds.
            RuntimeError: before the first reset, and where bodies may sleep.
        """
        task_state.checked(state, self.get_state())
        chosen = task_state.chosen_worlds(worlds, len(self._everyone))
        self.animals.bring_back(state, chosen)
        self._returns.reshape(len(self._learners), -1)[:, chosen] = state["returns"][chosen].T
        return _rows([senses.now for senses in self._learners])

    def close(self) -> None:
        self.worlds.close()

    def get_images(self) -> list[np.ndarray]:
        """Pictures (y, x, 3) uint8 of every world, as `render_mode` asks; none without.

        Raises:
            RuntimeError: before the first reset.
        """
        self._require_begun()
        return self._pictures.taken()

    def _moved(self) -> list[StepOfWorld]:
        """One action later.

        Raises:
            RuntimeError: before the first reset.
        """
        self._require_begun()
        return self.animals.act(np.split(self._commanded, len(self._learners)))

    def _require_begun(self) -> None:
        if not self._learners[0].begun:
            raise RuntimeError("the worlds have not begun: call reset first")

    def _infos(self, outcomes: list[StepOfWorld]) -> list[dict[str, Any]]:
        infos: list[dict[str, Any]] = []
        for row, outcome in enumerate(outcomes):
            self._returns[row] += sum(outcome.terms.values())
            info: dict[str, Any] = {"reward_terms": outcome.terms, "is_success": outcome.success}
            if outcome.failure is not None:
                info["failure"] = outcome.failure
                self._count(outcome.failure, row)
            if self.worlds.variation is not None:
                info |= self._varied(row)
            if outcome.terminated or outcome.truncated:
                info["TimeLimit.truncated"] = outcome.truncated
                steps = self.worlds.steps[row % len(self._everyone)]
                info["episode"] = {"r": float(self._returns[row]), "l": int(steps)}
            infos.append(info)
        return infos

    def _first_info(self, row: int) -> dict[str, Any]:
        """Before an episode's first action."""
        return {"reward_terms": {}, "is_success": False, **self._varied(row)}

    def _varied(self, row: int) -> dict[str, Any]:
        """How the world of a row differs from others, if they differ."""
        return self.worlds.told(row % len(self._everyone))

    def _count(self, failure: str, row: int) -> None:
        """And warn once of each. Where several learn, the episode is one of all of them."""
        if row >= len(self._everyone):
            return
        self.failures[failure] += 1
        if self.failures[failure] == 1:
            warnings.warn(f"{type(self.task).__name__}: {failure}; its episode ends here", stacklevel=4)


def _rows(observations: Sequence[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Of all who learn, one after the other."""
    first, *more = observations
    return {name: np.concatenate([of[name] for of in observations]) for name in first} if more else first


def _require_alike(encounter: Encounter, learners: Sequence[Senses]) -> None:
    """They can have one policy."""
    shapes = [
        {**{name: space.shape for name, space in one.observation_space.items()}, "action": one.action_space.shape}
        for one in learners
    ]
    for name, shape in zip(encounter.names, shapes, strict=True):
        if shape != shapes[0]:
            raise ValueError(
                f"Encounter: {encounter.names[0]} has {shapes[0]}, {name} has {shape}: must be alike to learn one "
                "policy; `alone` lets one of them learn, sim.make_parallel_env each its own"
            )
