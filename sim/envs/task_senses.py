"""What one animal knows, in all worlds: what its eyes see, noise included, what it feels, and what it did last."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from sim.envs.auxiliary import Auxiliary, checked
from sim.envs.task_fidelity import fidelities_among
from sim.envs.task_sight import EyesOfKind
from sim.envs.task_worlds import TaskWorlds
from sim.render.model_renderer import ModelRenderer
from sim.render.pending_frame import PendingFrame, settled
from sim.scene.poses import Poses
from sim.tasks.eye_kinds import kinds_of, several

Seen = dict[str, np.ndarray]  # by kind of eyes: (world, eye, channel, height, width); and what there is beside


class Senses:
    """Of one animal of these worlds.

    number: which of their animals · memory: frames in an observation
    sights: its eyes, by their kind · action: what it did last, (world, number) float32
    observation_space, action_space: of one world
    """

    def __init__(self, worlds: TaskWorlds, number: int, memory: int) -> None:
        task = worlds.animals[number]
        self._worlds, self._number = worlds, number
        n, kinds, fidelities = len(worlds.datas), kinds_of(task), fidelities_among(worlds.animals, number)
        keys = worlds.noise_keys[number]
        self.sights = {
            kind.name: EyesOfKind(worlds, kind, fidelities[kind.name], keys[k], memory) for k, kind in enumerate(kinds)
        }
        names = checked(task.auxiliary, f"{type(task).__name__}: auxiliary")
        prefixes = [f"{name}_" if several(task) else "" for name in self.sights] if names else []
        self._auxiliary = [
            Auxiliary(sight.renderer, names, prefix)
            for prefix, sight in zip(prefixes, self.sights.values(), strict=False)
        ]
        self._told: Seen = {}
        self.action_space = spaces.Box(-1.0, 1.0, (task.n_actions(worlds.model),), np.float32)
        self.observation_space = self._space()
        self.action = np.zeros((n, *self.action_space.shape), np.float32)

    @property
    def renderer(self) -> ModelRenderer:
        """Its eyes of the first kind."""
        return next(iter(self.sights.values())).renderer

    def restart(self) -> None:
        """Draw noise from its beginning, as the worlds' seed has it."""
        for sight, keys in zip(self.sights.values(), self._worlds.noise_keys[self._number], strict=True):
            sight.restart(keys)

    def acted(self, commanded: np.ndarray) -> None:
        """Remember what was done: nothing, where an action was no number."""
        self.action = np.clip(np.nan_to_num(commanded, posinf=0, neginf=0), -1, 1)

    def begin(self, poses: Poses, worlds: np.ndarray, fresh: np.ndarray) -> dict[str, PendingFrame]:
        """Begin to see these worlds with eyes of every kind; fresh: those whose episode has just begun."""
        begun = {name: sight.begin(poses, worlds) for name, sight in self.sights.items()}
        for auxiliary in self._auxiliary:
            begun |= {name: settled(array[worlds]) for name, array in auxiliary.look(poses, fresh).items()}
        return begun

    def observation(self, seen: Seen, fresh: np.ndarray) -> dict[str, np.ndarray]:
        """With new frames of all worlds; fresh: those that have just begun."""
        remembered = {name: sight.memory.remember(seen[name], fresh) for name, sight in self.sights.items()}
        self._told = {name: seen[name] for auxiliary in self._auxiliary for name in auxiliary.spaces}
        return {**remembered, **self._copied(), **self._beside(slice(None))}

    def preview(self, seen: Seen, worlds: np.ndarray) -> dict[str, np.ndarray]:
        """Of these worlds, with these of the new frames of all; nothing is remembered."""
        frames = {name: sight.memory.preview(seen[name][worlds], worlds) for name, sight in self.sights.items()}
        told = {name: seen[name][worlds] for auxiliary in self._auxiliary for name in auxiliary.spaces}
        return {**frames, **told, **self._beside(worlds)}

    @property
    def begun(self) -> bool:
        """Whether it has seen anything yet."""
        return all(sight.memory.begun for sight in self.sights.values())

    @property
    def now(self) -> dict[str, np.ndarray]:
        """What it knows."""
        frames = {name: sight.memory.held for name, sight in self.sights.items()}
        return {**frames, **self._copied(), **self._beside(slice(None))}

    def state(self) -> dict[str, np.ndarray]:
        """What its future observations follow from, beside its worlds."""
        parts = {
            _part(k, name, what): array
            for k, (name, sight) in enumerate(self.sights.items())
            for what, array in sight.state().items()
        }
        return {**parts, **self._copied(), "action": self.action.copy()}

    def bring_back(self, state: dict[str, np.ndarray]) -> None:
        """Inverse of `state`."""
        for k, (name, sight) in enumerate(self.sights.items()):
            sight.bring_back(*(state[_part(k, name, what)] for what in ("remembered", "noise")))
        self.action = state["action"]
        self._told = {name: state[name] for name in self._told}
        for auxiliary in self._auxiliary:
            auxiliary.go_on_from(Poses.of(self._worlds.datas))

    def _copied(self) -> Seen:
        """What it was told last beside what is seen."""
        return {name: array.copy() for name, array in self._told.items()}

    def _beside(self, worlds: Any) -> dict[str, np.ndarray]:
        """What it knows beside what is seen."""
        known = {"previous_action": self.action[worlds].copy()}
        if "feels" in self.observation_space.spaces:
            known["feels"] = self._worlds.felt[self._number][worlds].copy()
        return known

    def _space(self) -> spaces.Dict:
        found: dict[str, spaces.Space[Any]] = {name: sight.space for name, sight in self.sights.items()}
        for auxiliary in self._auxiliary:
            found |= auxiliary.spaces
        found["previous_action"] = spaces.Box(-1.0, 1.0, self.action_space.shape, np.float32)
        felt = self._worlds.felt[self._number].shape[1:]
        if felt[0]:
            found["feels"] = spaces.Box(-np.inf, np.inf, felt, np.float32)
        return spaces.Dict(found)


def _part(number: int, kind: str, what: str) -> str:
    """What a kind's part of a state is called."""
    return what if number == 0 else f"{kind}.{what}"
