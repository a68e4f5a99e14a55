"""One world of several animals as a PettingZoo parallel environment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from optics.numerics.arguments import did_you_mean
from sim.envs.animals import Animals
from sim.envs.calls import CallOrder, one_worlds_action, seed_of
from sim.envs.follow_camera import RENDER_MODES
from sim.envs.prepared_task import PreparedTask
from sim.envs.renderers import renderers_for
from sim.envs.world_pictures import WorldPictures
from sim.tasks.encounter import Encounter
from sim.tasks.simulation import Simulation
from sim.tasks.user_tasks import batched


class EncounterEnv(ParallelEnv[str, dict[str, np.ndarray], np.ndarray]):
    """Several animals that act at the same time, each with its own policy, as a PettingZoo parallel environment.

    Each animal's observations and `info` are the same as in an environment of `make_vec_env`, except for the entries
    that stable-baselines3 needs at the end of an episode.

    encounter: the animals
    seed: seed of episodes and noise, used until `reset` receives a seed
    memory: number of frames in an observation
    render_mode: "rgb_array", "eyes" or None
    """

    metadata = {"render_modes": [*RENDER_MODES], "name": "rhabdom_encounter"}  # noqa: RUF012 (PettingZoo's declaration)

    def __init__(self, encounter: Encounter, seed: int | None, memory: int, render_mode: str | None) -> None:
        self.possible_agents, self.agents = list(encounter.names), list[str]()
        self.render_mode = render_mode
        task = batched(encounter)
        simulation = Simulation(task, 1, seed)
        renderers = renderers_for(simulation, simulation.agents, PreparedTask(task).fidelities, None)
        self._animals = Animals(simulation, renderers, memory)
        self._pictures = WorldPictures(self._animals, render_mode)
        self._calls = CallOrder()
        self.observation_spaces = self._named([senses.observation_space for senses in self._animals.learners])
        self.action_spaces = self._named([senses.action_space for senses in self._animals.learners])

    def observation_space(self, agent: str) -> spaces.Dict:
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Box:
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, dict[str, np.ndarray]], dict[str, dict[str, Any]]]:
        """Start an episode; return the observations and infos by animal.

        Options are accepted, because PettingZoo's tests pass some, but have no effect.

        Raises:
            ValueError: the seed is neither a whole number of at least 0 nor None.
            RuntimeError: `close` has been called, or a method of a task fails.
        """
        self._calls.start_reset()
        seed = seed_of("seed", seed)
        if seed is not None:
            self._animals.seed(seed)
        self.agents = list(self.possible_agents)
        observations, varied = self._observed(self._animals.reset()), self._animals.simulation.variation_info(0)
        self._calls.finish_reset()
        return observations, {name: {"reward_terms": {}, "is_success": False, **varied} for name in self.agents}

    def step(
        self, actions: Mapping[str, np.ndarray]
    ) -> tuple[
        dict[str, dict[str, np.ndarray]],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
        """Take one action of every animal; return observations, rewards, terminations, truncations and infos by animal.

        Steps after the end of an episode have no effect, and return empty dictionaries.

        Raises:
            ValueError: an action is missing, belongs to an unknown animal, has the wrong shape, or does not consist of
                finite numbers.
            RuntimeError: there has been no reset yet, or `close` has been called.
        """
        self._calls.require_begun()
        if not self.agents:
            return {}, {}, {}, {}, {}
        advanced = self._animals.advance(self._commanded(actions))
        step, nobody = advanced.step, np.empty(0, int)
        observations = self._observed(self._animals.remember(self._animals.seen(advanced), nobody))
        terminated, truncated = self._named(step.terminated.tolist()), self._named(step.truncated.tolist())
        rewards = self._named(step.reward.tolist())
        if any(terminated.values()) or any(truncated.values()):
            self.agents = []  # an episode ends for all animals at once
        failure = {"failure": step.failure[0]} if step.failure else {}
        infos = {
            name: {
                "reward_terms": terms,
                "is_success": success,
                **failure,
                **self._animals.simulation.variation_info(0),
            }
            for name, terms, success in zip(self.possible_agents, step.terms.rows, step.success.tolist(), strict=True)
        }
        return observations, rewards, terminated, truncated, infos

    def render(self) -> np.ndarray | list[np.ndarray] | None:
        """Return an image (y, x, 3) uint8 of the world, or a list with an image of each animal's signals.

        `render_mode` selects one of the two. Without a mode, the result is None.

        Raises:
            RuntimeError: `render_mode` is not None, and either there has been no reset yet or `close` has been called.
        """
        if self.render_mode is None:
            return None
        self._calls.require_begun()
        pictures = self._pictures.taken()
        return pictures[0] if self.render_mode == "rgb_array" else pictures

    def close(self) -> None:
        """Stop all threads. Only further calls of `close` may follow."""
        self._calls.close()
        self._animals.simulation.close()

    def _named(self, values: Any) -> dict[str, Any]:
        return dict(zip(self.possible_agents, values, strict=True))

    def _observed(self, observations: list[dict[str, np.ndarray]]) -> dict[str, dict[str, np.ndarray]]:
        return self._named([{name: array[0] for name, array in known.items()} for known in observations])

    def _commanded(self, actions: Mapping[str, np.ndarray]) -> list[np.ndarray]:
        """Return the action of each animal, (1, n_actions).

        Raises:
            ValueError: an animal has no action, an action has a wrong shape or value, or a name is not that of an
                animal in the episode.
        """
        for name in actions:
            if name not in self.agents:
                known = did_you_mean(name, self.agents) or f": there are {', '.join(self.agents)}"
                raise ValueError(f"actions: no animal {name!r}{known}")
        found = []
        for name in self.agents:
            if name not in actions:
                raise ValueError(f"actions: {name!r} has none: must have one for each of {', '.join(self.agents)}")
            shape = self.action_spaces[name].shape
            found.append(one_worlds_action(f"action of {name!r}", actions[name], shape)[None])
        return found
