"""Observations of one agent in all worlds.

They contain noisy signals of its eyes, proprioception, its last action and other entries.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from sim.envs.auxiliary import Auxiliary
from sim.envs.eyes_of_kind import EyesOfKind
from sim.envs.renderers import AgentRenderers
from sim.render.eye_renderer import EyeRenderer
from sim.render.pending_frame import PendingFrame
from sim.scene.poses import Poses
from sim.tasks.simulation import Simulation

Arrays = dict[str, np.ndarray]  # arrays by name; the first axis is the world


class Senses:
    """Observations of one agent.

    simulation: the worlds
    number: index of the agent in the simulation
    renderers: renderers of the agent's eyes
    memory: number of frames in an observation
    sights: signals of the agent's eyes (`EyesOfKind`), by kind
    action: the agent's last action, (world, n_actions) float32
    observation_space, action_space: spaces of one world
    """

    def __init__(self, simulation: Simulation, number: int, renderers: AgentRenderers, memory: int) -> None:
        self._simulation, self._number, self.agent = simulation, number, simulation.agents[number]
        self.sights = {
            name: EyesOfKind(simulation, renderer, keys, memory)
            for (name, renderer), keys in zip(
                renderers.eyes.items(), simulation.streams.noise_keys[number], strict=True
            )
        }
        prefixes = [f"{name}_" if len(self.sights) > 1 else "" for name in self.sights]
        self._auxiliary = [
            Auxiliary(renderer, self.agent.auxiliary, prefix)
            for prefix, renderer in zip(prefixes, renderers.auxiliary, strict=False)
        ]
        self._last_auxiliary: Arrays = {}
        self.action_space = spaces.Box(-1.0, 1.0, (self.agent.n_actions,), np.float32)
        self.observation_space = self._space()
        self.action = np.tile(self.agent.first_action, (simulation.n, 1))

    @property
    def renderer(self) -> EyeRenderer:
        """Renderer of the agent's first kind of eyes."""
        return next(iter(self.sights.values())).renderer

    def restart(self) -> None:
        """Restart the noise from the seed of the worlds."""
        for sight, keys in zip(self.sights.values(), self._simulation.streams.noise_keys[self._number], strict=True):
            sight.restart(keys)

    def launch(self, poses: Poses, worlds: np.ndarray | None = None, fresh: bool = False) -> dict[str, PendingFrame]:
        """Launch the rendering of these worlds (None: all) with all kinds of eyes.

        fresh: True if these worlds begin an episode
        """
        return {name: sight.launch(poses, worlds, fresh) for name, sight in self.sights.items()}

    def update_auxiliary(self, poses: Poses, fresh: np.ndarray) -> None:
        """Update the auxiliary entries of the observation: depth, geom ids and optic flow, if the task requests them.

        fresh: indices of the worlds whose episode has just begun. If there are any, only the entries of these worlds
            are updated.
        """
        for auxiliary in self._auxiliary:
            for name, array in auxiliary.render(poses, fresh).items():
                if len(fresh) and name in self._last_auxiliary:
                    self._last_auxiliary[name][fresh] = array[fresh]
                else:
                    self._last_auxiliary[name] = array

    @property
    def has_auxiliary(self) -> bool:
        """True if observations contain auxiliary entries."""
        return bool(self._auxiliary)

    def observation(self, seen: Arrays, fresh: np.ndarray) -> Arrays:
        """Add new frames to the memory, and return the observations.

        seen: new frames of all worlds, by kind of eyes
        fresh: indices of the worlds whose episode has just begun
        """
        remembered = {name: sight.memory.remember(seen[name], fresh) for name, sight in self.sights.items()}
        return {**remembered, **self.other_entries(slice(None))}

    def preview(self, seen: Arrays, worlds: np.ndarray) -> Arrays:
        """Return the memory as it would be in these worlds after the new frames, without storing these frames.

        seen: new frames of all worlds, by kind of eyes
        """
        return {name: sight.memory.preview(seen[name][worlds], worlds) for name, sight in self.sights.items()}

    def other_entries(self, worlds: Any) -> Arrays:
        """Return copies of all entries of these worlds' observations, except for the signals of eyes."""
        known = {**self._last_auxiliary, "previous_action": self.action, **self._simulation.felt[self._number]}
        return {name: array[worlds].copy() for name, array in known.items()}

    @property
    def begun(self) -> bool:
        """True after the first frame."""
        return all(sight.memory.begun for sight in self.sights.values())

    @property
    def now(self) -> Arrays:
        """The current observation."""
        return {
            **{name: sight.memory.frames_held for name, sight in self.sights.items()},
            **self.other_entries(slice(None)),
        }

    def get_state(self) -> Arrays:
        """Return all arrays on which future observations depend, apart from the state of the worlds."""
        parts = {
            _part(k, name, what): array
            for k, (name, sight) in enumerate(self.sights.items())
            for what, array in sight.get_state().items()
        }
        return {
            **parts,
            **{name: array.copy() for name, array in self._last_auxiliary.items()},
            "action": self.action.copy(),
        }

    def set_state(self, state: Arrays) -> None:
        """Restore a state from `get_state`."""
        for k, (name, sight) in enumerate(self.sights.items()):
            sight.set_state(**{what: state[_part(k, name, what)] for what in sight.get_state()})
        self.action = state["action"]
        self._last_auxiliary = {name: state[name] for name in self._last_auxiliary}
        for auxiliary in self._auxiliary:
            auxiliary.go_on_from(self._simulation.poses())

    def _space(self) -> spaces.Dict:
        found: dict[str, spaces.Space[Any]] = {name: sight.space for name, sight in self.sights.items()}
        for auxiliary in self._auxiliary:
            found |= auxiliary.spaces
        found["previous_action"] = spaces.Box(-1.0, 1.0, self.action_space.shape, np.float32)
        for name, felt in self._simulation.felt[self._number].items():
            low, high = self._simulation.task.proprioception_ranges.get(name, (-np.inf, np.inf))
            found[name] = spaces.Box(low, high, felt.shape[1:], np.float32)
        return spaces.Dict(found)


def _part(number: int, kind: str, what: str) -> str:
    """Return the name under which a stored state holds an array that belongs to one kind of eyes.

    For the agent's first kind of eyes, it is the plain name of the array. For all others, the name of the kind precedes
    it, as in "side.noise".

    number: index of the kind of eyes
    kind: name of the kind of eyes
    what: name of the array, such as "noise"
    """
    return what if number == 0 else f"{kind}.{what}"
