"""One world as a Gymnasium environment: the batched environment with a batch of one."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from sim.agent import Eyes
from sim.eye_images import side_by_side
from sim.picture import Onlooker
from sim.state import WorldState
from sim.vec_env import make_vec_env

RENDER_MODES = ("rgb_array", "eyes")


class EyesEnv(gymnasium.Env[dict[str, np.ndarray], np.ndarray]):
    """One agent with eyes in one world. Spaces, rewards, endings and `info` are in docs/tasks.md.

    task, eyes, memory, mode, rays_per_receptor, world_seed, spectra as in `sim.make_vec_env`
    render_mode  "rgb_array": the agent seen from behind, with its eyes' fields of view; "eyes": what each eye reports,
                 side by side; None

    Raises ValueError for a bad argument.
    """

    metadata = {"render_modes": [*RENDER_MODES], "render_fps": 5}  # noqa: RUF012 (Gymnasium's own declaration)

    def __init__(self, task: str, eyes: Eyes | None = None, *, render_mode: str | None = None, **options: Any) -> None:
        if render_mode not in (None, *RENDER_MODES):
            raise ValueError(
                f"render_mode = {render_mode!r}, must be one of {', '.join(map(repr, RENDER_MODES))} or None"
            )
        self.render_mode = render_mode
        self._onlooker: Onlooker | None = None
        self._seen: np.ndarray | None = None
        self._batch = make_vec_env(task, eyes, n_envs=1, seed=None, **options)
        self.observation_space = self._batch.observation_space
        self.action_space = self._batch.action_space

    @property
    def state(self) -> WorldState:
        """The world as it is now, a batch of one."""
        return self._batch.state

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        super().reset(seed=seed)
        if seed is not None:
            self._batch.seed(seed)
        observation = self._observed(self._batch.reset())
        return observation, self._batch.reset_infos[0]

    def step(self, action: np.ndarray) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        observation, reward, terminated, truncated, info = self._batch.step_once(np.asarray(action)[None])
        return self._observed(observation), float(reward[0]), bool(terminated[0]), bool(truncated[0]), info[0]

    def render(self) -> np.ndarray | None:
        if self.render_mode is None:
            return None
        if self._seen is None:
            raise RuntimeError("the world has not begun: call reset before render")
        if self.render_mode == "eyes":
            return side_by_side(self._seen, self._batch.renderer.eye)
        if self._onlooker is None:
            self._onlooker = Onlooker(self._batch.simulation.world, self._batch.eyes)
        return self._onlooker.picture(self.state)

    def close(self) -> None:
        self._batch.close()

    def _observed(self, batch: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The only world's observation; what the eyes report is kept for pictures."""
        observation = {name: array[0] for name, array in batch.items()}
        self._seen = observation["eyes"][-1].copy()
        return observation


def make_env(task: str, eyes: Eyes | None = None, **options: Any) -> EyesEnv:
    """A single environment; see `EyesEnv`."""
    return EyesEnv(task, eyes, **options)
