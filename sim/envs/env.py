"""One world as a Gymnasium environment, implemented as a batch with a single world."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from sim.envs.assembly import IN_RESET, make_vec_env, refuse
from sim.envs.calls import seed_of
from sim.envs.follow_camera import RENDER_MODES
from sim.eyes.eyes import Eyes
from sim.tasks.batch_task import BatchTask
from sim.tasks.encounter import Encounter
from sim.tasks.task import Task

_OF_BATCHES = {"seed": IN_RESET, "n_envs": "this is one world: make_vec_env has several"}


class EyesEnv(gymnasium.Env[dict[str, np.ndarray], np.ndarray]):
    """One agent with eyes in one world. Spaces, rewards, endings and `info` are documented in docs/tasks.md.

    task: one of `sim.TASKS`, a `sim.Task` or a `sim.BatchTask`; for a `sim.Encounter`, use the result of its method
        `alone`
    eyes, memory, mode, rays_per_receptor, fidelity, world_seed, mazes, course, layouts, wall_height, least_return,
        episode_steps, spectra, medium, vary, auxiliary, render_mode: see `sim.make_vec_env` and `sim.build_world`

    Raises:
        ValueError: an argument is invalid or unknown, or `seed` or `n_envs` was given.
        optics.AccuracyError: the pupil spreads light too far for the PSF to be computed.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
        RuntimeError: a method of a `sim.Task` fails at the start of the first episode. An exception of a
            `sim.BatchTask` is raised unchanged.
    """

    metadata = {"render_modes": [*RENDER_MODES], "render_fps": 5}  # noqa: RUF012 (Gymnasium's own declaration)

    def __init__(
        self, task: str | Task | BatchTask, eyes: Eyes | None = None, *, render_mode: str | None = None, **options: Any
    ) -> None:
        if isinstance(task, Encounter):
            raise ValueError(
                "task: several animals learn in a sim.Encounter: use the result of `alone`, or make_parallel_env"
            )
        refuse(options, _OF_BATCHES)
        self._batch = make_vec_env(task, eyes, n_envs=1, seed=None, render_mode=render_mode, **options)
        self.render_mode = render_mode
        self.observation_space = self._batch.observation_space
        self.action_space = self._batch.action_space

    @property
    def state(self) -> Any:
        """Current state of the world, as a batch of one world.

        Its type depends on the physics; for the built-in tasks, it is `WorldState`.

        Raises:
            RuntimeError: there has been no reset yet.
        """
        return self._batch.state

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Start an episode; return its first observation and `info`.

        seed: new seed of episodes and noise; None: the random numbers continue

        Raises:
            ValueError: the seed is neither a whole number of at least 0 nor None, or `options` are given.
            RuntimeError: `close` has been called, or a method of a `sim.Task` fails. An exception of a `sim.BatchTask`
                is raised unchanged.
        """
        seed = seed_of("seed", seed)
        super().reset(seed=seed)
        if options:
            raise ValueError(f"reset: options = {options!r}: must be left out, reset has no options")
        if seed is not None:
            self._batch.seed(seed)
        observation = self._batch.reset()
        return _only(observation), self._batch.reset_infos[0]

    def step(self, action: np.ndarray) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """Take one action; return observation, reward, terminated, truncated and `info`.

        If a method of a `sim.Task` fails, the episode ends, and info["failure"] is the reason. An exception of a
        `sim.BatchTask` is raised unchanged.

        Raises:
            ValueError: the action has another shape, is masked, or does not consist of real, finite numbers; or a
                `sim.BatchTask` returns an invalid array.
            RuntimeError: there has been no reset yet, or `close` has been called.
        """
        observation, reward, terminated, truncated, info = self._batch.step_once(action)
        info[0].pop("episode", None)  # entry of Stable-Baselines3; Gymnasium reserves this name for its wrappers
        return _only(observation), float(reward[0]), bool(terminated[0]), bool(truncated[0]), info[0]

    def render(self) -> np.ndarray | None:
        """Return an image (y, x, 3) uint8 as set by `render_mode`; None without a mode.

        Raises:
            RuntimeError: with a render mode, if there has been no reset yet or if `close` has been called.
        """
        return None if self.render_mode is None else self._batch.get_images()[0]

    def close(self) -> None:
        self._batch.close()


def make_env(task: str | Task | BatchTask, eyes: Eyes | None = None, **options: Any) -> EyesEnv:
    """Return a single world as a Gymnasium environment; see `EyesEnv` (errors) and `make_vec_env` (arguments)."""
    return EyesEnv(task, eyes, **options)


def _only(batch: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: array[0] for name, array in batch.items()}
