"""The natively batched stable-baselines3 VecEnv: one physics call and one kernel launch per step for all worlds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import drjit as dr
import numpy as np
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import tile_images

from optics.spectra.spectrum import Spectrum
from sim.envs.follow_camera import FollowCamera, check_render_mode
from sim.envs.info import first_infos, infos_of
from sim.envs.observation import STANDING, Memory, action_space, observation_space
from sim.envs.retina_images import side_by_side
from sim.envs.simulation import NOWHERE, Simulation, Step
from sim.eyes.eyes import Eyes
from sim.render.batched_renderer import BatchedRenderer
from sim.render.fidelity import Fidelity
from sim.render.noisy_signals import NoisySignals, Pending
from sim.worlds.state import WorldState
from sim.worlds.world import build_world

_STANDING = np.array(STANDING, np.float32)


class EyesVecEnv(VecEnv):
    """Many agents with eyes, each in its own world.

    Observations, rewards, endings and `info` are in docs/tasks.md. Worlds start anew by themselves; the
    observation returned is then the first of the new episode, and info["terminal_observation"] the last of the
    old one. World i's episodes depend on the seed and i alone, not on the number of worlds.
    """

    def __init__(
        self, simulation: Simulation, renderer: BatchedRenderer, memory: int, render_mode: str | None = None
    ) -> None:
        self.simulation, self.renderer, self.eyes = simulation, renderer, renderer.eyes
        self.render_mode = render_mode
        self._onlooker: FollowCamera | None = None
        self._memory = Memory(memory)
        self._retinas = NoisySignals(renderer, simulation.streams.noise_keys)
        space = observation_space(self.eyes, renderer.eye.channels, memory, renderer.brightest, self._retinas.spread)
        super().__init__(simulation.n, space, action_space())
        self._commanded = self._actions = np.zeros((self.num_envs, 2), np.float32)
        self._returns, self._lengths = np.zeros(self.num_envs), np.zeros(self.num_envs, int)

    @property
    def state(self) -> WorldState:
        """All worlds as they are now."""
        return self.simulation.state

    def reset(self) -> dict[str, np.ndarray]:
        if self._seeds[0] is not None:
            self.simulation.seed(self._seeds[0])
            self._retinas.restart(self.simulation.streams.noise_keys)
        self.simulation.reset()
        self._reset_seeds()
        self._reset_options()
        self._returns[:], self._lengths[:] = 0.0, 0
        self.reset_infos = first_infos(self.state)
        untouched = np.zeros(self.num_envs, bool)
        return self._observation(self._retinas.begin(self.state)(), np.arange(self.num_envs), untouched)

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seed all random streams at the next reset. World i draws from streams derived from (seed, i)."""
        self._seeds = [seed] * self.num_envs
        return self._seeds

    def step_async(self, actions: np.ndarray) -> None:
        actions = np.asarray(actions, np.float32)
        if actions.shape != (self.num_envs, 2):
            raise ValueError(f"actions have shape {actions.shape}: must be ({self.num_envs}, 2)")
        self._commanded = actions

    def step_once(
        self, actions: np.ndarray
    ) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """One action without starting ended worlds anew, as a single environment wants it: observation, reward,
        terminated, truncated, info."""
        self.step_async(actions)
        step, looking = self._advance()
        reward = step.reward
        infos = self._infos(step, reward, np.flatnonzero(step.done))
        observation = self._observation(self._seen(looking, step), NOWHERE, step.contact)
        return observation, reward, step.terminated, step.truncated, infos

    def step_wait(self) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, list[dict[str, Any]]]:
        step, looking = self._advance()
        reward, done = step.reward, step.done
        ended = np.flatnonzero(done)
        infos = self._infos(step, reward, ended)
        # First looks of new episodes run beside the last looks of all, but not beside those at objects put elsewhere.
        beginning = self._begin_anew(ended) if len(ended) and not len(step.respawned) else None
        seen = self._seen(looking, step)
        if len(ended):
            self._add_terminal_observations(infos, step, ended, seen[ended])
            seen[ended] = (beginning or self._begin_anew(ended))()
        observation = self._observation(seen, ended, step.contact)
        return observation, reward.astype(np.float32), done, infos

    def _begin_anew(self, ended: np.ndarray) -> Pending:
        """Start the episodes of these worlds anew, and look at them."""
        self._returns[ended], self._lengths[ended] = 0.0, 0
        return self._retinas.begin_some(self.simulation.restart(ended), ended)

    def _advance(self) -> tuple[Step, Pending]:
        """Move, and look while it is judged what that led to."""
        moved = self.simulation.move(self._commanded)
        looking = self._retinas.begin(moved.state)
        self._actions = moved.actions
        return self.simulation.judge(moved), looking

    def _seen(self, looking: Pending, step: Step) -> np.ndarray:
        """What is there to see after the step, objects that were put elsewhere included."""
        seen = looking()
        if len(step.respawned):
            seen[step.respawned] = self._retinas.begin_some(step.state, step.respawned)()
        return seen

    def close(self) -> None:
        self.simulation.close()

    # --- pictures

    def get_images(self) -> list[np.ndarray]:
        """A picture of every world, (y, x, 3) uint8, as `render_mode` asks; none without.

        Raises:
            RuntimeError: before the first reset.
        """
        state = self.state
        if self.render_mode == "eyes":
            return [side_by_side(frame, self.renderer.eye) for frame in self._memory.newest]
        if self.render_mode == "rgb_array":
            self._onlooker = self._onlooker or FollowCamera(self.simulation.world, self.eyes)
            return [self._onlooker.picture(state, world) for world in range(state.n)]
        return []

    def render(self, mode: str | None = None) -> np.ndarray | None:
        """All worlds' pictures, tiled."""
        if self.render_mode == "eyes" and mode in (None, "eyes"):
            return tile_images(self.get_images())
        return super().render(mode)

    # --- observations

    def _observation(self, seen: np.ndarray, fresh: np.ndarray, contact: np.ndarray) -> dict[str, np.ndarray]:
        """What is seen, felt and remembered; worlds that have just begun (`fresh`, their numbers) have only seen."""
        felt, action = contact.astype(np.float32)[:, None], self._actions.copy()
        if len(fresh):
            felt[fresh], action[fresh] = 0.0, _STANDING
        return {"eyes": self._memory.remember(seen, fresh), "contact": felt, "previous_action": action}

    def _add_terminal_observations(
        self, infos: list[dict[str, Any]], step: Step, ended: np.ndarray, seen: np.ndarray
    ) -> None:
        stacks = self._memory.preview(seen, ended)
        for stack, world in zip(stacks, ended, strict=True):
            infos[world]["terminal_observation"] = {
                "eyes": stack,
                "contact": step.contact[world : world + 1].astype(np.float32),
                "previous_action": self._actions[world].copy(),
            }

    # --- info

    def _infos(self, step: Step, reward: np.ndarray, ended: np.ndarray) -> list[dict[str, Any]]:
        infos = infos_of(step)
        self._returns += reward
        self._lengths += 1
        for world in ended:
            infos[world]["TimeLimit.truncated"] = bool(step.truncated[world])
            infos[world]["episode"] = {"r": float(self._returns[world]), "l": int(self._lengths[world])}
        for index, reason in step.failure.items():
            infos[index]["failure"] = reason
        return infos

    # --- the rest of the VecEnv contract: there is one environment behind all indices

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:
        if len(list(self._get_indices(indices))) != self.num_envs:
            raise ValueError("set_attr: the worlds share one environment; set an attribute for all of them")
        setattr(self, attr_name, value)

    def env_method(
        self, method_name: str, *args: Any, indices: int | Iterable[int] | None = None, **kwargs: Any
    ) -> list[Any]:
        if len(list(self._get_indices(indices))) != self.num_envs:
            raise ValueError("env_method: the worlds share one environment; call a method for all of them")
        result = getattr(self, method_name)(*args, **kwargs)
        return [result] * self.num_envs

    def env_is_wrapped(self, wrapper_class: type, indices: int | Iterable[int] | None = None) -> list[bool]:
        return [False for _ in self._get_indices(indices)]


def _require_whole(name: str, number: Any, least: int) -> None:
    if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < least:
        raise ValueError(f"{name} = {number!r}: must be a whole number, at least {least}")


def make_vec_env(
    task: str,
    eyes: Eyes | None = None,
    n_envs: int = 64,
    seed: int | None = 0,
    *,
    memory: int = 1,
    mode: str = "training",
    rays_per_receptor: float | str | Fidelity = "auto",
    world_seed: int = 0,
    mazes: int = 1,
    spectra: Mapping[str, Spectrum | str] | None = None,
    render_mode: str | None = None,
) -> EyesVecEnv:
    """A batched environment of one task.

    task: "detection", "foraging", "navigation" or "tracking"
    eyes: of every agent; default Eyes()
    n_envs: number of worlds
    seed: of episodes and noise; None draws one
    memory: frames in an observation
    mode: "training", or "evaluation" (objects respawn; rewards weighted as fitness)
    rays_per_receptor: rays traced for each receptor, in direct light; "auto": as few as its noise allows, and light
        that was reflected twice where it counts, see `sim.BatchedRenderer`; or a whole Fidelity
    world_seed, mazes: of the layout that all worlds share: navigation's mazes, and how many
    spectra: of materials and lights, by name, in the place of their colours: see `sim.build_world`
    render_mode: "rgb_array": the agent seen from behind, with its eyes' fields of view; "eyes": what each eye reports,
        side by side

    Physics takes as many threads as Dr.Jit has: limit both with drjit.set_thread_count.

    Raises:
        ValueError: a bad argument.
    """
    eyes = Eyes() if eyes is None else eyes
    if not isinstance(eyes, Eyes):
        raise ValueError(f"eyes = {eyes!r}: must be sim.Eyes or None, the default ones")
    for name, number, least in (("n_envs", n_envs, 1), ("memory", memory, 1), ("world_seed", world_seed, 0)):
        _require_whole(name, number, least)
    if seed is not None:
        _require_whole("seed", seed, 0)
    check_render_mode(render_mode)
    world = build_world(task, seed=world_seed, mazes=mazes, spectra=spectra)
    simulation = Simulation(world, n_envs, seed, mode, threads=min(dr.thread_count(), n_envs))
    renderer = BatchedRenderer(world, eyes, n_envs, rays_per_receptor)
    return EyesVecEnv(simulation, renderer, memory, render_mode)
