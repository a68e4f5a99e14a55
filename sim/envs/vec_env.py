"""The natively batched stable-baselines3 VecEnv: one physics call and one kernel launch per step for all worlds."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from gymnasium import spaces

from sim.envs.auxiliary import Auxiliary
from sim.envs.follow_camera import FollowCamera
from sim.envs.info import first_infos, infos_of
from sim.envs.observation import STANDING, Memory, action_space, observation_space
from sim.envs.one_environment import OneEnvironment
from sim.envs.retina_images import side_by_side
from sim.envs.simulation import LEAST_RETURN, NOWHERE, Simulation, Step
from sim.envs.world_poses import WorldPoses, model_renderer
from sim.render.batched_renderer import BatchedRenderer
from sim.render.noisy_signals import NoisySignals
from sim.render.pending_frame import PendingFrame
from sim.scene.variation import Variation
from sim.worlds.state import WorldState

_STANDING = np.array(STANDING, np.float32)


class EyesVecEnv(OneEnvironment):
    """Many agents with eyes, each in its own world.

    Observations, rewards, endings and `info` are in docs/tasks.md. Worlds start anew by themselves; the
    observation returned is then the first of the new episode, and info["terminal_observation"] the last of the
    old one, and `reset_infos` are of the episodes' beginnings. World i's episodes depend on the seed and i alone, not
    on the number of worlds.

    failures: what worlds could not go on for, and how many episodes each has ended
    """

    def __init__(
        self,
        simulation: Simulation,
        renderer: BatchedRenderer,
        memory: int,
        render_mode: str | None = None,
        variation: Variation | None = None,
        auxiliary: tuple[str, ...] = (),
    ) -> None:
        self.simulation, self.renderer, self.eyes = simulation, renderer, renderer.eyes
        self.render_mode = render_mode
        self._follow_camera: FollowCamera | None = None
        self._memory = Memory(memory)
        self._signals = NoisySignals(renderer, simulation.streams.noise_keys)
        self._variation = variation
        if variation is not None:
            self._signals.level = np.ones(simulation.n)
        space = observation_space(self.eyes, renderer.eye.channels, memory, renderer.brightest, self._signals.spread)
        self._auxiliary: Auxiliary | None = None
        if auxiliary:
            world = simulation.world
            self._poses = WorldPoses(world)
            self._auxiliary = Auxiliary(model_renderer(world, self.eyes, renderer.eye, simulation.n), auxiliary)
            space = spaces.Dict({**space.spaces, **self._auxiliary.spaces})
        super().__init__(simulation.n, space, action_space())
        self._commanded = self._actions = np.zeros((self.num_envs, 2), np.float32)
        self._returns, self._lengths = np.zeros(self.num_envs), np.zeros(self.num_envs, int)
        self.failures = Counter[str]()

    @property
    def state(self) -> WorldState:
        """All worlds as they are now."""
        return self.simulation.state

    def reset(self) -> dict[str, np.ndarray]:
        if self._seeds[0] is not None:
            self.simulation.seed(self._seeds[0])
            self._signals.restart(self.simulation.streams.noise_keys)
        self.simulation.reset()
        self._light_anew(np.arange(self.num_envs))
        self._reset_seeds()
        self._reset_options()
        self._returns[:], self._lengths[:] = 0.0, 0
        self.reset_infos = self._with_light(first_infos(self.state))
        untouched = np.zeros(self.num_envs, bool)
        everyone = np.arange(self.num_envs)
        seen = self._signals.begin(self.state).wait()
        return self._observation(seen, everyone, untouched) | self._told(self.state, everyone)

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
        observation = self._observation(self._seen(looking, step), NOWHERE, step.contact) | self._told(step.state)
        return observation, reward, step.terminated, step.truncated, infos

    def step_wait(self) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, list[dict[str, Any]]]:
        step, looking = self._advance()
        reward, done = step.reward, step.done
        ended = np.flatnonzero(done)
        infos = self._infos(step, reward, ended)
        # First looks of new episodes run beside the last looks of all, but not beside those at objects put elsewhere.
        beginning = self._begin_anew(ended) if len(ended) and not len(step.respawned) else None
        seen, told = self._seen(looking, step), self._told(step.state)
        if len(ended):
            self._add_terminal_observations(infos, step, ended, seen[ended])
            for name, array in told.items():
                for world in ended:
                    infos[world]["terminal_observation"][name] = array[world].copy()
            seen[ended] = (beginning or self._begin_anew(ended)).wait()
            for name, array in self._told(self.state, ended).items():
                told[name][ended] = array[ended]
        observation = self._observation(seen, ended, step.contact) | told
        return observation, reward.astype(np.float32), done, infos

    def _begin_anew(self, ended: np.ndarray) -> PendingFrame:
        """Start the episodes of these worlds anew, and look at them."""
        self._returns[ended], self._lengths[ended] = 0.0, 0
        self._light_anew(ended)
        state = self.simulation.restart(ended)
        for world, info in zip(ended, self._with_light(first_infos(state.take(ended)), ended), strict=True):
            self.reset_infos[world] = info
        return self._signals.begin_some(state, ended)

    def _advance(self) -> tuple[Step, PendingFrame]:
        """Move, and look while it is judged what that led to."""
        moved = self.simulation.move(self._commanded)
        looking = self._signals.begin(moved.state)
        self._actions = moved.actions
        return self.simulation.judge(moved), looking

    def _seen(self, looking: PendingFrame, step: Step) -> np.ndarray:
        """What is there to see after the step, objects that were put elsewhere included."""
        seen = looking.wait()
        if len(step.respawned):
            seen[step.respawned] = self._signals.begin_some(step.state, step.respawned).wait()
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
            self._follow_camera = self._follow_camera or FollowCamera(self.simulation.world, self.eyes)
            return [self._follow_camera.picture(state, world) for world in range(state.n)]
        return []

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

    def _told(self, state: WorldState, fresh: np.ndarray = NOWHERE) -> dict[str, np.ndarray]:
        """What observations hold beside; fresh: worlds that have just begun."""
        return {} if self._auxiliary is None else self._auxiliary.look(self._poses.of(state), fresh)

    # --- light

    def _light_anew(self, worlds: np.ndarray) -> None:
        """What the next episodes of these worlds have."""
        variation, level = self._variation, self._signals.level
        if variation is not None and level is not None:
            level[worlds] = [variation.draw(self.simulation.streams.light[world])["light"] for world in worlds]

    def _with_light(
        self, infos: list[dict[str, Any]], worlds: np.ndarray | slice = slice(None)
    ) -> list[dict[str, Any]]:
        if self._signals.level is not None:
            for info, level in zip(infos, self._signals.level[worlds].tolist(), strict=True):
                info["varied"] = {"light": level}
        return infos

    # --- info

    def _infos(self, step: Step, reward: np.ndarray, ended: np.ndarray) -> list[dict[str, Any]]:
        infos = self._with_light(infos_of(step))
        self._returns += reward
        self._lengths += 1
        for world in ended:
            infos[world]["TimeLimit.truncated"] = bool(step.truncated[world])
            infos[world]["episode"] = {"r": float(self._returns[world]), "l": int(self._lengths[world])}
            if step.given_up[world]:
                infos[world]["given_up"] = LEAST_RETURN
        for index, reason in step.failure.items():
            infos[index]["failure"] = reason
            self.failures[reason] += 1
        return infos
