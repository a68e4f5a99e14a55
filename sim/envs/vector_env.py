"""All worlds as one Gymnasium vector environment: `gymnasium.make_vec("rhabdom/Detection-v0", num_envs=64)`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from sim.envs.assembly import IN_RESET, make_vec_env, refuse
from sim.envs.follow_camera import RENDER_MODES
from sim.eyes.eyes import Eyes
from sim.tasks.encounter import Encounter
from sim.tasks.task import Task

_OF_THE_BATCH = {"seed": IN_RESET, "n_envs": "it is num_envs here"}


class EyesVectorEnv(VectorEnv[dict[str, np.ndarray], np.ndarray, np.ndarray]):
    """The batched environment with Gymnasium's vector interface.

    Worlds restart in the step that ends their episode (`AutoresetMode.SAME_STEP`), as in Gymnasium's `SyncVectorEnv`.
    The returned observation and info are then those of the start of the new episode. info["final_obs"] and
    info["final_info"] contain the last observation and info of the old episode.

    `reset` accepts one seed or, like Gymnasium's `SyncVectorEnv`, a list with a seed for each world. With a list, the
    episodes of each world are then the same as those of a single environment with this world's seed. A world whose seed
    is None continues with its own random numbers.

    num_envs: number of worlds
    task: one of `sim.TASKS`, a `sim.Task` or a `sim.BatchTask`; for a `sim.Encounter`, use the result of its method
        `alone`
    eyes, memory, mode ...: see `sim.make_vec_env`

    Raises:
        ValueError: an argument is invalid or unknown, or `seed` or `n_envs` was given.
        optics.AccuracyError: the pupil spreads light too far for the PSF to be computed.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
        RuntimeError: a method of a `sim.Task` fails at the start of the first episode. An exception of a
            `sim.BatchTask` is raised unchanged.
    """

    metadata = {  # noqa: RUF012 (Gymnasium's own declaration)
        "render_modes": [*RENDER_MODES],
        "render_fps": 5,
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }

    def __init__(self, num_envs: int = 1, *, task: str | Task, eyes: Eyes | None = None, **options: Any) -> None:
        if isinstance(task, Encounter):
            raise ValueError(
                "task: several animals learn in a sim.Encounter: pass the result of `alone`, or use sim.make_vec_env"
            )
        refuse(options, _OF_THE_BATCH)
        self._batch = make_vec_env(task, eyes, n_envs=num_envs, seed=None, **options)
        self.num_envs, self.render_mode = num_envs, self._batch.render_mode
        self.single_observation_space = self._batch.observation_space
        self.single_action_space = self._batch.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        if options:
            raise ValueError(f"reset: options = {options!r}: must be left out, reset has no options")
        given: Any = seed
        if isinstance(given, Sequence | np.ndarray) and not isinstance(given, str | bytes) and np.ndim(given):
            self._batch.seed_worlds(list(given))
        elif given is not None:
            self._batch.seed(given)
        return self._batch.reset(), self._together(self._batch.reset_infos)

    def step(
        self, actions: np.ndarray
    ) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        observation, reward, done, infos = self._batch.step(actions)
        truncated = np.array([info.get("TimeLimit.truncated", False) for info in infos])
        last: dict[str, Any] = {}
        for world in np.flatnonzero(done):
            ended, infos[world] = infos[world], self._batch.reset_infos[world]
            ended.pop("episode")  # entry of stable-baselines3; Gymnasium reserves this name for its wrappers
            seen = ended.pop("terminal_observation")
            last = self._add_info(last, {"final_obs": seen, "final_info": ended}, world)
        return observation, reward, done & ~truncated, done & truncated, last | self._together(infos)

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Return an image (y, x, 3) uint8 of every world, as set by `render_mode`; None if `render_mode` is None.

        Raises:
            RuntimeError: `render_mode` is not None, and either there has been no reset yet or `close` has been called.
        """
        return None if self.render_mode is None else tuple(self._batch.get_images())

    def close_extras(self, **kwargs: Any) -> None:
        self._batch.close()

    def _together(self, infos: list[dict[str, Any]]) -> dict[str, Any]:
        """Return one array for each key of the infos, with a mask of the worlds whose info has this key."""
        found: dict[str, Any] = {}
        for world, info in enumerate(infos):
            found = self._add_info(found, info, world)
        return found
