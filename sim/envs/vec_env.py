"""The natively batched stable-baselines3 VecEnv: all worlds move together, and all eyes are rendered together."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sim.envs import held_state
from sim.envs.animals import Advanced, Animals
from sim.envs.one_environment import OneEnvironment
from sim.envs.renderers import AgentRenderers
from sim.envs.senses import Arrays, Senses
from sim.envs.world_pictures import WorldPictures
from sim.render.eye_renderer import EyeRenderer
from sim.tasks.batch_task import BatchTask
from sim.tasks.encounter import Encounter
from sim.tasks.outcome import Step
from sim.tasks.simulation import LEAST_RETURN, Simulation


class EyesVecEnv(OneEnvironment):
    """Many worlds of a task: a built-in one, a `sim.BatchTask`, a `sim.Task`, or a `sim.Encounter` whose animals are
    alike and learn one policy.

    Observations, rewards, endings and `info` are in docs/tasks.md. Worlds start new episodes by themselves: the
    observation returned is then the first of the new episode, info["terminal_observation"] is the last of the old one,
    and `reset_infos` are of the episodes' beginnings. A world's episodes depend on the seed and its number alone, not
    on the number of worlds. Of an encounter, the first animal of all worlds comes first, then the second.

    simulation: worlds in motion · renderers: of every agent's eyes · memory: frames in an observation
    render_mode: "rgb_array", "eyes" or None
    failures: why worlds could not go on, and how many episodes each reason has ended

    Raises:
        ValueError: animals that learn together are not alike.
    """

    def __init__(
        self,
        simulation: Simulation,
        renderers: Sequence[AgentRenderers | None],
        memory: int = 1,
        render_mode: str | None = None,
    ) -> None:
        self.simulation, self.render_mode = simulation, render_mode
        self.animals = Animals(simulation, renderers, memory)
        self.task: Any = getattr(simulation.task, "task", simulation.task)
        self._pictures = WorldPictures(self.animals, render_mode)
        self._learners, self._everyone = self.animals.learners, np.arange(simulation.n)
        if isinstance(self.task, Encounter):
            _require_alike(self.task, self._learners)
        first = self._learners[0]
        super().__init__(simulation.rows, first.observation_space, first.action_space)
        self._commanded = np.zeros((self.num_envs, *self.action_space.shape), np.float32)
        self._returns, self.failures = np.zeros(self.num_envs), Counter[str]()

    @property
    def state(self) -> Any:
        """All worlds as they are now, in their physics' own type: of the built-in tasks a `WorldState`.

        Raises:
            RuntimeError: before the first reset.
        """
        return self.simulation.state

    @property
    def batch_task(self) -> BatchTask:
        """The task, for arrays of all worlds."""
        return self.simulation.task

    @property
    def eyes(self) -> Any:
        """`sim.Eyes` of a built-in task's agent; None if a user's task says where eyes are."""
        return getattr(self.simulation.task, "eyes", None)

    @property
    def worlds(self) -> Any:
        """What moves the worlds."""
        return self.simulation.physics

    @property
    def renderer(self) -> EyeRenderer:
        """The eyes of the agent that learns; of the first, if several do, and of the first kind it has."""
        return self._learners[0].renderer

    def reset(self) -> Arrays:
        if self._seeds[0] is not None:
            self.animals.seed(self._seeds[0])
        self._reset_seeds()
        self._reset_options()
        self._returns[:] = 0.0
        observations = self.animals.reset()
        self.reset_infos = self._first_infos(self._everyone)
        return _rows(observations)

    def step_async(self, actions: np.ndarray) -> None:
        actions = np.asarray(actions, np.float32)
        if actions.shape != self._commanded.shape:
            raise ValueError(f"actions have shape {actions.shape}: must be {self._commanded.shape}")
        self._commanded = actions

    def step_once(self, actions: np.ndarray) -> tuple[Arrays, np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """One action without starting ended worlds again, as a single environment needs it: observation, reward,
        terminated, truncated, info."""
        self.step_async(actions)
        advanced = self._advance()
        step = advanced.step
        infos = self._infos(step)
        observations = self.animals.remember(self.animals.seen(advanced), self._everyone[:0])
        return _rows(observations), step.reward, step.terminated, step.truncated, infos

    def step_wait(self) -> tuple[Arrays, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        advanced = self._advance()
        step = advanced.step
        infos, done = self._infos(step), step.done
        ended = np.flatnonzero(done[: len(self._everyone)])  # an episode ends for all its agents at once
        last = [senses.beside(ended) for senses in self._learners] if len(ended) else []
        # First frames of new episodes are rendered beside the last frames of all, but not beside those of worlds that
        # the task has changed.
        early = bool(len(ended)) and not len(step.changed)
        beginning = self._begin_again(ended) if early else None
        seen = self.animals.seen(advanced)
        if len(ended):
            self._add_terminal_observations(infos, seen, ended, last)
            self.animals.replace(seen, ended, beginning or self._begin_again(ended))
        return _rows(self.animals.remember(seen, ended)), step.reward.astype(np.float32), done, infos

    def get_state(self) -> dict[str, np.ndarray]:
        """Where all worlds stand, as plain arrays whose first axis is the world: what follows from here depends on them
        and on the actions alone. What a task keeps in itself is the task's own business.

        Raises:
            RuntimeError: before the first reset, and if bodies may sleep.
        """
        self._require_begun()
        return self.animals.state()

    def set_state(self, state: Mapping[str, np.ndarray], worlds: Sequence[int] | None = None) -> Arrays:
        """Go on from where these worlds (None: all) stood; returns the observation they had there.

        Raises:
            ValueError: the state is of another task or number of worlds, or there are no such worlds.
            RuntimeError: before the first reset, and if bodies may sleep.
        """
        held_state.checked(state, self.get_state())
        chosen = held_state.chosen_worlds(worlds, len(self._everyone))
        self.animals.bring_back(state, chosen)
        self._returns.reshape(len(self._learners), -1)[:, chosen] = state["returns"][chosen].T
        return _rows([senses.now for senses in self._learners])

    def close(self) -> None:
        self.simulation.close()

    def get_images(self) -> list[np.ndarray]:
        """Pictures (y, x, 3) uint8 of every world, as `render_mode` has them; none without.

        Raises:
            RuntimeError: before the first reset.
        """
        self._require_begun()
        return self._pictures.taken()

    def _advance(self) -> Advanced:
        """One action later.

        Raises:
            RuntimeError: before the first reset.
        """
        self._require_begun()
        learners = len(self._learners)
        return self.animals.advance(np.split(self._commanded, learners) if learners > 1 else [self._commanded])

    def _begin_again(self, ended: np.ndarray) -> Any:
        """Start new episodes in these worlds, and begin to render them."""
        n = len(self._everyone)
        self._returns.reshape(len(self._learners), n)[:, ended] = 0.0
        pending = self.animals.begin_again(ended)
        for k, info in enumerate(self._first_infos(ended)):
            self.reset_infos[k // len(ended) * n + ended[k % len(ended)]] = info
        return pending

    def _require_begun(self) -> None:
        if not self._learners[0].begun:
            raise RuntimeError("the worlds have not begun: call reset first")

    def _add_terminal_observations(
        self, infos: list[dict[str, Any]], seen: list[Arrays], ended: np.ndarray, last: list[Arrays]
    ) -> None:
        for number, senses in enumerate(self._learners):
            known = {**senses.preview(seen[number], ended), **last[number]}
            for k, world in enumerate(ended):
                row = number * len(self._everyone) + world
                infos[row]["terminal_observation"] = {name: array[k] for name, array in known.items()}

    def _infos(self, step: Step) -> list[dict[str, Any]]:
        self._returns += step.reward
        more = step.info or [{}] * self.num_envs
        infos: list[dict[str, Any]] = [
            {"reward_terms": terms, "is_success": success, **extra}
            for terms, success, extra in zip(step.terms.rows, step.success.tolist(), more, strict=True)
        ]
        n = len(self._everyone)
        if self.simulation.varied:
            for row, info in enumerate(infos):
                info |= self.simulation.told(row % n)
        for row in np.flatnonzero(step.done).tolist():
            infos[row]["TimeLimit.truncated"] = bool(step.truncated[row])
            steps = self.simulation.steps[row % n]
            infos[row]["episode"] = {"r": float(self._returns[row]), "l": int(steps)}
            if step.given_up[row]:
                infos[row]["given_up"] = LEAST_RETURN
        for world, reason in step.failure.items():
            for info in infos[world::n]:
                info["failure"] = reason
            self._count(reason)
        return infos

    def _first_infos(self, worlds: np.ndarray) -> list[dict[str, Any]]:
        """Before the first action of episodes in these worlds, for each learner in turn."""
        simulation = self.simulation
        more = simulation.task.first_info(simulation.physics, worlds) or [{}] * len(worlds)
        return [
            {"reward_terms": {}, "is_success": False, **extra, **simulation.told(world)}
            for _ in self._learners
            for world, extra in zip(worlds, more, strict=True)
        ]

    def _count(self, failure: str) -> None:
        """And warn once of each."""
        self.failures[failure] += 1
        if self.failures[failure] == 1:
            warnings.warn(f"{type(self.task).__name__}: {failure}; its episode ends here", stacklevel=5)


def _rows(observations: Sequence[Arrays]) -> Arrays:
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
