"""What one animal knows, in all worlds: what its eyes see, noise included, what it feels, and what it did last."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from sim.envs.observation import ROUNDING, SIGMAS, Memory
from sim.envs.task_fidelity import fidelity_among
from sim.envs.task_worlds import TaskWorlds
from sim.render.pending_frame import PendingFrame
from sim.render.receptor_noise import NoiseModel, Normals
from sim.robots.model_renderer import ModelRenderer
from sim.robots.poses import Poses


class Senses:
    """Of one animal of these worlds.

    number: which of their animals · memory: frames in an observation
    renderer: its eyes · action: what it did last, (world, number) float32
    observation_space, action_space: of one world
    """

    def __init__(self, worlds: TaskWorlds, number: int, memory: int) -> None:
        task = worlds.animals[number]
        self._worlds, self._number = worlds, number
        n, fidelity = len(worlds.datas), fidelity_among(worlds.animals, number)
        self.renderer = ModelRenderer(worlds.model, task.eye, task.mounts, n, fidelity, spectra=worlds.spectra)
        self._memory, self._noise = Memory(memory), NoiseModel.of(self.renderer.eye)
        frame = (len(task.mounts), self.renderer.eye.channels, *self.renderer.eye.resolution)
        self._normals = Normals(worlds.noise_keys[number], frame)
        self.action_space = spaces.Box(-1.0, 1.0, (task.n_actions(worlds.model),), np.float32)
        self.observation_space = self._space((memory, *frame))
        self.action = np.zeros((n, *self.action_space.shape), np.float32)

    def restart(self) -> None:
        """Draw noise from its beginning, as the worlds' seed has it."""
        self._normals.restart(self._worlds.noise_keys[self._number])

    def acted(self, commanded: np.ndarray) -> None:
        """Remember what was done: nothing, where an action was no number."""
        self.action = np.clip(np.nan_to_num(commanded, posinf=0, neginf=0), -1, 1)

    def begin(self, poses: Poses, worlds: np.ndarray) -> PendingFrame:
        """Begin to see these worlds, noise included: no other world's noise goes on."""
        looking, normals = self.renderer.begin(poses), self._normals.begin(worlds)

        def noisy(seen: np.ndarray) -> np.ndarray:
            return seen[worlds] if self._noise is None else self._noise(seen[worlds], normals.wait())

        return looking.then(noisy)

    def observation(self, seen: np.ndarray, fresh: np.ndarray) -> dict[str, np.ndarray]:
        """With a new frame of all worlds; fresh: those that have just begun."""
        return {"eyes": self._memory.remember(seen, fresh), **self._beside(slice(None))}

    def preview(self, seen: np.ndarray, worlds: np.ndarray) -> dict[str, np.ndarray]:
        """Of these worlds, with this frame of theirs; nothing is remembered."""
        return {"eyes": self._memory.preview(seen, worlds), **self._beside(worlds)}

    @property
    def begun(self) -> bool:
        """Whether it has seen anything yet."""
        return self._memory.begun

    @property
    def now(self) -> dict[str, np.ndarray]:
        """What it knows."""
        return {"eyes": self._memory.held, **self._beside(slice(None))}

    @property
    def newest(self) -> np.ndarray:
        """What its eyes saw last, (world, eye, channel, height, width)."""
        return self._memory.newest

    def state(self) -> dict[str, np.ndarray]:
        """What its future observations follow from, beside its worlds."""
        return {"remembered": self._memory.held, "noise": self._normals.place, "action": self.action.copy()}

    def bring_back(self, state: dict[str, np.ndarray]) -> None:
        """Inverse of `state`."""
        self._memory.hold(state["remembered"])
        self._normals.go_on_from(state["noise"])
        self.action = state["action"]

    def _beside(self, worlds: Any) -> dict[str, np.ndarray]:
        """What it knows beside what is seen."""
        known = {"previous_action": self.action[worlds].copy()}
        if "feels" in self.observation_space.spaces:
            known["feels"] = self._worlds.felt[self._number][worlds].copy()
        return known

    def _space(self, frames: tuple[int, ...]) -> spaces.Dict:
        brightest, spread = self.renderer.brightest, 0.0
        if self._noise is not None:
            spread = self._noise.largest(brightest)
        margin = SIGMAS * spread + ROUNDING * brightest
        # Lights at points are brighter the nearer they are.
        high = 2 * brightest + margin if self.renderer.only_directional else np.inf
        found: dict[str, spaces.Space[Any]] = {
            "eyes": spaces.Box(-margin if np.isfinite(high) else -np.inf, high, frames, np.float32),
            "previous_action": spaces.Box(-1.0, 1.0, self.action_space.shape, np.float32),
        }
        felt = self._worlds.felt[self._number].shape[1:]
        if felt[0]:
            found["feels"] = spaces.Box(-np.inf, np.inf, felt, np.float32)
        return spaces.Dict(found)
