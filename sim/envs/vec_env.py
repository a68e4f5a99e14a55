"""Natively batched stable-baselines3 VecEnv: all worlds are stepped together, and all eyes are rendered together."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sim.envs import held_state
from sim.envs.animals import Advanced, Animals
from sim.envs.calls import CallOrder, actions_of, one_worlds_action, seed_of
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
    """Many worlds of one task.

    In a `sim.Encounter`, all animals learn one policy, and have equal observation and action spaces. The rows of the
    first animal in all worlds come first, followed by those of the second animal. Observations, rewards, endings and
    `info` are documented in docs/tasks.md. When an episode ends, its world starts the next one automatically. The
    returned observation is then the first one of the new episode, and info["terminal_observation"] is the last one of
    the old episode. `reset_infos` contains the info of each episode's first observation. The episodes of a world depend
    only on the seed, the index of the world and the actions in it. An exception in a `sim.Task` during an episode ends
    it as a failure, whereas an exception in a `sim.BatchTask` is raised.

    simulation, renderers: the worlds, and for each agent the renderers of its eyes
    memory, render_mode: see `sim.make_vec_env`
    failures: attribute, for each reason of failure, the number of episodes that ended for this reason

    Raises:
        ValueError: animals that learn a single policy have different observation or action spaces.
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
        self._calls = CallOrder()
        if isinstance(self.task, Encounter):
            _require_alike(self.task, self._learners)
        first = self._learners[0]
        super().__init__(simulation.rows, first.observation_space, first.action_space)
        self._commanded = np.zeros((self.num_envs, *self.action_space.shape), np.float32)
        self._returns, self.failures = np.zeros(self.num_envs), Counter[str]()

    @property
    def state(self) -> Any:
        """Current state of all worlds, as their physics represents it: `WorldState` for the built-in tasks.

        Raises:
            RuntimeError: there has been no reset yet.
        """
        return self.simulation.state

    @property
    def batch_task(self) -> BatchTask:
        """The task in its batched form, whose methods take and return arrays with one row for each world."""
        return self.simulation.task

    @property
    def eyes(self) -> Any:
        """Eyes of a built-in task's agent: a `sim.Eyes`, or a dictionary {name: `sim.Eyes`}; None for other tasks."""
        return getattr(self.simulation.task, "eyes", None)

    @property
    def worlds(self) -> Any:
        """The physics of the worlds."""
        return self.simulation.physics

    @property
    def renderer(self) -> EyeRenderer:
        """Renderer of the first learning agent's first kind of eyes."""
        return self._learners[0].renderer

    def reset(self) -> Arrays:
        """Start an episode in every world; return the first observations.

        Raises:
            RuntimeError: the environment is closed, an action is pending, or a method of a `sim.Task` fails.
        """
        self._calls.start_reset()
        if self._seeds[0] is not None:
            self.animals.seed(self._seeds[0])
        self._reset_seeds()
        self._reset_options()
        self._returns[:] = 0.0
        observations = self.animals.reset()
        self.reset_infos = self._first_infos(self._everyone)
        self._calls.finish_reset()
        return _rows(observations)

    def seed_worlds(self, seeds: Sequence[int | None]) -> None:
        """Give each world its own seed at the next reset; a world whose seed is None draws a seed itself.

        The episodes of a world are then the same as in a single environment with the world's seed.

        Raises:
            ValueError: there is not one seed per world, or a seed is neither None nor a whole number of at least 0.
            RuntimeError: `close` has been called, or an action is pending.
        """
        self._calls.require_open()
        own = self.simulation.streams.episodes
        if len(seeds) != len(own):
            raise ValueError(f"seed has {len(seeds)} numbers: must have one for each of {len(own)} worlds")
        known = [seed_of(f"seed[{world}]", seed) for world, seed in enumerate(seeds)]
        drawn = (int(rng.integers(2**63)) if seed is None else seed for seed, rng in zip(known, own, strict=True))
        self.animals.seed(tuple(drawn))

    def step_async(self, actions: np.ndarray) -> None:
        """Store actions (num_envs, *action_space.shape) for `step_wait`; a non-finite action ends its world's episode.

        Raises:
            ValueError: the actions are not real numbers, are masked, or do not have this shape.
            RuntimeError: there has been no reset yet, `close` has been called, or another `step_async` is pending.
        """
        self._calls.require_begun()
        self._commanded = actions_of("actions", actions, self._commanded.shape)
        self._calls.expect_wait()

    def step_once(self, action: np.ndarray) -> tuple[Arrays, np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Take one action in the only world, without restarting it if its episode ends.

        Return the observation, reward, terminated, truncated and info, all as batches of one.

        Raises:
            ValueError: there are several worlds, the action is not finite or does not have the shape of the action
                space, or an array of the task is invalid.
            RuntimeError: there has been no reset yet, `close` has been called, or an action is pending.
        """
        self._calls.require_begun()
        self.step_async(one_worlds_action("action", action, self.action_space.shape)[None])
        advanced = self._advance()
        step = advanced.step
        infos = self._infos(step)
        observations = self.animals.remember(self.animals.seen(advanced), self._everyone[:0])
        return _rows(observations), step.reward, step.terminated, step.truncated, infos

    def step_wait(self) -> tuple[Arrays, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Take the actions of `step_async`; return the observations, rewards, ends of episodes and infos.

        Each of these has one row for each learning animal in each world.

        Raises:
            ValueError: a `sim.BatchTask` returns an invalid array.
            RuntimeError: no action is pending, `close` was called, or a `sim.Task` fails at the start of an episode.
        """
        advanced = self._advance()
        step = advanced.step
        infos, done = self._infos(step), step.done
        (ended,) = done[: len(self._everyone)].nonzero()  # an episode ends for all its agents at once
        last = [senses.other_entries(ended) for senses in self._learners] if len(ended) else []
        # The first frames of new episodes are rendered together with the last frames of all worlds, unless the task
        # moved bodies after the action. Some of the last frames must then be rendered again first.
        early = bool(len(ended)) and not len(step.changed)
        beginning = self._start_episodes(ended) if early else None
        seen = self.animals.seen(advanced)
        if len(ended):
            self._add_terminal_observations(infos, seen, ended, last)
            self.animals.replace(seen, ended, beginning or self._start_episodes(ended))
        return _rows(self.animals.remember(seen, ended)), step.reward.astype(np.float32), done, infos

    def get_state(self) -> dict[str, np.ndarray]:
        """Return the state of all worlds as plain arrays whose first axis is the world.

        It contains all values on which future steps depend, except those that a task stores in its own attributes.

        Raises:
            RuntimeError: there was no reset, `close` was called, an action is pending, or MuJoCo's "sleep" is enabled.
        """
        self._calls.require_begun()
        return self.animals.get_state()

    def set_state(self, state: Mapping[str, np.ndarray], worlds: Sequence[int] | None = None) -> Arrays:
        """Restore a stored state in these worlds (None: all); return the current observations of all worlds.

        Raises:
            ValueError: the state is from another task or another number of worlds, or a world's index is out of range.
            RuntimeError: there was no reset, `close` was called, an action is pending, or MuJoCo's "sleep" is enabled.
        """
        held_state.checked(state, self.get_state())
        chosen = held_state.chosen_worlds(worlds, len(self._everyone))
        self.animals.set_state(state, chosen)
        self._returns.reshape(len(self._learners), -1)[:, chosen] = state["returns"][chosen].T
        return _rows([senses.now for senses in self._learners])

    def close(self) -> None:
        """Stop all threads. Only further calls of `close` may follow."""
        self._calls.close()
        self.simulation.close()

    def get_images(self) -> list[np.ndarray]:
        """Return images (y, x, 3) uint8, see `WorldPictures.taken`; an empty list if `render_mode` is None.

        Raises:
            RuntimeError: there has been no reset yet, `close` has been called, or an action is pending.
        """
        self._calls.require_begun()
        return self._pictures.taken()

    def _advance(self) -> Advanced:
        """Take the pending actions."""
        self._calls.take()
        return self.animals.advance(np.split(self._commanded, len(self._learners)))

    def _start_episodes(self, ended: np.ndarray) -> Any:
        """Start new episodes in these worlds, and launch their rendering."""
        n = len(self._everyone)
        self._returns.reshape(len(self._learners), n)[:, ended] = 0.0
        pending = self.animals.start_episodes(ended)
        for k, info in enumerate(self._first_infos(ended)):
            self.reset_infos[k // len(ended) * n + ended[k % len(ended)]] = info
        return pending

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
                info |= self.simulation.variation_info(row % n)
        for row in step.done.nonzero()[0].tolist():
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
        """Return the infos before the first action: for each learner in turn, one info for each of these worlds."""
        simulation = self.simulation
        more = simulation.task.first_info(simulation.physics, worlds) or [{}] * len(worlds)
        return [
            {"reward_terms": {}, "is_success": False, **extra, **simulation.variation_info(world)}
            for _ in self._learners
            for world, extra in zip(worlds, more, strict=True)
        ]

    def _count(self, failure: str) -> None:
        """Count a failure, and warn at its first occurrence."""
        self.failures[failure] += 1
        if self.failures[failure] == 1:
            warnings.warn(f"{type(self.task).__name__}: {failure}; its episode ends here", stacklevel=5)


def _rows(observations: Sequence[Arrays]) -> Arrays:
    """Concatenate the observations of all learners, entry by entry, along the first axis."""
    first, *more = observations
    return {name: np.concatenate([of[name] for of in observations]) for name in first} if more else first


def _require_alike(encounter: Encounter, learners: Sequence[Senses]) -> None:
    """Refuse learners whose observations or actions differ in shape, since they cannot share one policy."""
    shapes = [
        {**{name: space.shape for name, space in one.observation_space.items()}, "action": one.action_space.shape}
        for one in learners
    ]
    for name, shape in zip(encounter.names, shapes, strict=True):
        if shape != shapes[0]:
            raise ValueError(
                f"Encounter: {encounter.names[0]} has {shapes[0]}, {name} has {shape}: must be alike to learn one "
                "policy; use `alone` to train one of them, or sim.make_parallel_env for separate policies"
            )
