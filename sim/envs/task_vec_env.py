"""Tasks of one's own as a stable-baselines3 VecEnv: all eyes of all worlds in one kernel launch per step."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import drjit as dr
import mujoco
import numpy as np
from gymnasium import spaces

from sim.envs import task_state
from sim.envs.observation import ROUNDING, SIGMAS, Memory
from sim.envs.one_environment import OneEnvironment
from sim.envs.retina_images import side_by_side
from sim.envs.task_fidelity import fidelity_of
from sim.envs.task_worlds import StepOfWorld, TaskWorlds
from sim.pictures.quick_camera import QuickCamera
from sim.render.receptor_noise import NoiseModel, Normals
from sim.robots.eye_marks import with_eyes
from sim.robots.model_renderer import ModelRenderer
from sim.robots.poses import Poses
from sim.robots.task import Task
from sim.scene.cameras import Viewpoint

PICTURE = (360, 480)  # pixels (height, width)
RIMS = 0.15  # of the model's extent: how far the rims of fields of view are drawn


class TaskVecEnv(OneEnvironment):
    """Many worlds of a `sim.Task`.

    Worlds start anew by themselves, as stable-baselines3 has it: what is returned is then the first observation of the
    new episode, and info["terminal_observation"] the last of the old one. Observations are "eyes" (memory, eye,
    channel, height, width), noise included, "previous_action", and "feels", if the task's animal feels anything. `info`
    has reward_terms, is_success, and failure where one of the task's methods fails: that ends the world's episode, and
    the others go on.

    task: what is done · n_envs: number of worlds · seed: of episodes and noise
    memory: frames in an observation · render_mode: "rgb_array" (with the animal's eyes and the rims of their fields of
        view), "eyes" or None
    """

    def __init__(
        self, task: Task, n_envs: int, seed: int | None, memory: int = 1, render_mode: str | None = None
    ) -> None:
        self.worlds = TaskWorlds(task, n_envs, seed, min(dr.thread_count(), n_envs))
        self.task, self.render_mode = task, render_mode
        fidelity = fidelity_of(task)
        self.renderer = ModelRenderer(self.worlds.model, task.eye, task.mounts, n_envs, fidelity, spectra=task.spectra)
        self._memory = Memory(memory)
        self._camera: QuickCamera | None = None
        self._noise = NoiseModel.of(self.renderer.eye)
        frame = (len(task.mounts), self.renderer.eye.channels, *self.renderer.eye.resolution)
        self._normals = Normals(self.worlds.noise_keys, frame)
        self._everyone = np.arange(n_envs)
        super().__init__(n_envs, self._space((memory, *frame)), self._actions())
        self._commanded = self._action = np.zeros((n_envs, *self.action_space.shape), np.float32)
        self._returns, self._told = np.zeros(n_envs), set[str]()

    def reset(self) -> dict[str, np.ndarray]:
        if self._seeds[0] is not None:
            self.worlds.seed(self._seeds[0])
            self._normals.restart(self.worlds.noise_keys)
        self._reset_seeds()
        self._reset_options()
        self.worlds.reset(self._everyone)
        self._returns[:], self._action = 0.0, np.zeros_like(self._action)
        self.reset_infos = [{"reward_terms": {}, "is_success": False} for _ in self._everyone]
        return self._observation(self._look(self._everyone), self._everyone)

    def step_async(self, actions: np.ndarray) -> None:
        actions = np.asarray(actions, np.float32)
        if actions.shape != self._action.shape:
            raise ValueError(f"actions have shape {actions.shape}: must be {self._action.shape}")
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
        return self._observation(self._look(self._everyone), self._everyone[:0]), reward, terminated, truncated, infos

    def step_wait(self) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, list[dict[str, Any]]]:
        outcomes = self._moved()
        infos, seen = self._infos(outcomes), self._look(self._everyone)
        done = np.array([outcome.terminated or outcome.truncated for outcome in outcomes])
        ended = np.flatnonzero(done)
        if len(ended):
            last = {"eyes": self._memory.preview(seen[ended], ended), **self._known(ended)}
            for k, world in enumerate(ended):
                infos[world]["terminal_observation"] = {name: array[k] for name, array in last.items()}
            self._returns[ended], self._action[ended] = 0.0, 0.0
            self.worlds.reset(ended)
            seen[ended] = self._look(ended)
        reward = np.array([sum(outcome.terms.values()) for outcome in outcomes], np.float32)
        return self._observation(seen, ended), reward, done, infos

    def get_state(self) -> dict[str, np.ndarray]:
        """Where all worlds stand, as plain arrays whose first axis is the world: what follows from here depends on them
        and on the actions alone. What a task keeps in itself is the task's own business.

        Raises:
            RuntimeError: before the first reset.
        """
        if not self._memory.begun:
            raise RuntimeError("the worlds have not begun: call reset first")
        return {
            **task_state.of_worlds(self.worlds),
            "remembered": self._memory.held,
            "noise": self._normals.place,
            "returns": self._returns.copy(),
            "action": self._action.copy(),
        }

    def set_state(self, state: Mapping[str, np.ndarray], worlds: Sequence[int] | None = None) -> dict[str, np.ndarray]:
        """Go on from where these worlds (None: all) stood; the observation they had there.

        Raises:
            ValueError: the state is of another task or number of worlds, or there are no such worlds.
            RuntimeError: before the first reset.
        """
        now = self.get_state()
        task_state.checked(state, now)
        chosen = task_state.chosen_worlds(worlds, self.num_envs)
        task_state.bring_back(self.worlds, state, chosen)
        for name in ("remembered", "noise", "returns", "action"):
            now[name][chosen] = state[name][chosen]
        self._memory.hold(now["remembered"])
        self._normals.go_on_from(now["noise"])
        self._returns, self._action = now["returns"], now["action"]
        return {"eyes": self._memory.held, **self._known(self._everyone)}

    def close(self) -> None:
        self.worlds.close()

    def get_images(self) -> list[np.ndarray]:
        """A picture of every world, (y, x, 3) uint8, as `render_mode` asks; none without."""
        if self.render_mode == "eyes":
            return [side_by_side(frame, self.renderer.eye) for frame in self._memory.newest]
        if self.render_mode == "rgb_array":
            self._camera = self._camera or QuickCamera(self.worlds.model, self.renderer.spectra)
            return [self._picture(self._camera, data) for data in self.worlds.datas]
        return []

    def _picture(self, camera: QuickCamera, data: mujoco.MjData) -> np.ndarray:
        """With the animal's eyes in it."""
        named = self.task.camera or _overview(self.worlds.model)
        picture = camera.picture(data, named, PICTURE[1], PICTURE[0])
        pupils, frames = self.renderer.eye_frames(Poses.of([data]))
        reach = RIMS * float(self.worlds.model.stat.extent)
        fov, view = self.renderer.eye.fov_deg, camera.mirror.viewpoint(named)
        return with_eyes(picture, view, (pupils[0], frames[0]), fov, reach)

    def _moved(self) -> list[StepOfWorld]:
        """One action later. Remembered is what was done: nothing, where an action was no number."""
        self._action = np.clip(np.nan_to_num(self._commanded, posinf=0, neginf=0), -1, 1)
        return self.worlds.step(self._commanded)

    def _look(self, worlds: np.ndarray) -> np.ndarray:
        """All eyes of these worlds, noise included: no other world's noise goes on."""
        looking, normals = self.renderer.begin(self.worlds.datas), self._normals.begin(worlds)
        seen = looking.wait()[worlds]
        return seen if self._noise is None else self._noise(seen, normals.wait())

    def _observation(self, seen: np.ndarray, fresh: np.ndarray) -> dict[str, np.ndarray]:
        return {"eyes": self._memory.remember(seen, fresh), **self._known(self._everyone)}

    def _known(self, worlds: np.ndarray) -> dict[str, np.ndarray]:
        """Beside what is seen."""
        known = {"previous_action": self._action[worlds].copy()}
        if "feels" in self.observation_space.spaces:
            known["feels"] = self.worlds.felt[worlds].copy()
        return known

    def _infos(self, outcomes: list[StepOfWorld]) -> list[dict[str, Any]]:
        infos: list[dict[str, Any]] = []
        for world, outcome in enumerate(outcomes):
            self._returns[world] += sum(outcome.terms.values())
            info: dict[str, Any] = {"reward_terms": outcome.terms, "is_success": outcome.success}
            if outcome.failure is not None:
                info["failure"] = outcome.failure
                self._warn(outcome.failure)
            if outcome.terminated or outcome.truncated:
                info["TimeLimit.truncated"] = outcome.truncated
                info["episode"] = {"r": float(self._returns[world]), "l": int(self.worlds.steps[world])}
            infos.append(info)
        return infos

    def _warn(self, failure: str) -> None:
        """Once of each."""
        if failure not in self._told:
            self._told.add(failure)
            warnings.warn(f"{type(self.task).__name__}: {failure}; its episode ends here", stacklevel=4)

    def _space(self, frame: tuple[int, ...]) -> spaces.Dict:
        brightest, spread = self.renderer.brightest, 0.0
        if self._noise is not None:
            spread = self._noise.largest(brightest)
        margin = SIGMAS * spread + ROUNDING * brightest
        # Lights at points are brighter the nearer they are.
        high = 2 * brightest + margin if self.renderer.only_directional else np.inf
        found: dict[str, spaces.Space[Any]] = {
            "eyes": spaces.Box(-margin if np.isfinite(high) else -np.inf, high, frame, np.float32),
            "previous_action": spaces.Box(-1.0, 1.0, self._actions().shape, np.float32),
        }
        if self.worlds.felt.shape[1]:
            found["feels"] = spaces.Box(-np.inf, np.inf, self.worlds.felt.shape[1:], np.float32)
        return spaces.Dict(found)

    def _actions(self) -> spaces.Box:
        return spaces.Box(-1.0, 1.0, (self.task.n_actions(self.worlds.model),), np.float32)


def _overview(model: mujoco.MjModel) -> Viewpoint:
    """From the side, above."""
    centre, extent = np.array(model.stat.center), float(model.stat.extent)
    return Viewpoint.looking_at(centre + extent * np.array([-0.9, -1.6, 1.2]), centre, 45.0)
