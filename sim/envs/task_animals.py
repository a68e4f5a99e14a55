"""All animals of many worlds: those who learn, and those who act by a policy that stays as it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import drjit as dr
import numpy as np

from sim.envs import task_state
from sim.envs.task_senses import Seen, Senses
from sim.envs.task_worlds import StepOfWorld, TaskWorlds
from sim.scene.poses import Poses
from sim.tasks.encounter import Encounter, Frozen, name_of
from sim.tasks.user_task import Task, require_rewards

NOWHERE = np.empty(0, int)


class TaskAnimals:
    """Worlds, and what the animals in them know.

    task, n, seed, episode_steps: see TaskWorlds · memory: frames in the observations of those who learn
    learners: senses of those who learn · seeing: of all who look at anything, those who learn first
    """

    def __init__(
        self, task: Task | Encounter, n: int, seed: int | None, memory: int, episode_steps: int | None = None
    ) -> None:
        self.worlds = TaskWorlds(task, n, seed, min(dr.thread_count(), n), episode_steps)
        for learner in self.worlds.learners:
            require_rewards(learner)
        number = len(self.worlds.learners)
        self.learners = [Senses(self.worlds, k, memory) for k in range(number)]
        self._frozen = [
            (other, None if other.policy is None else Senses(self.worlds, k, other.memory))
            for k, other in enumerate(self.worlds.frozen, start=number)
        ]
        self.seeing = [*self.learners, *(senses for _, senses in self._frozen if senses is not None)]
        self._names = [name_of(self.worlds.animals[k]) for k in range(number)]
        self._names += [name_of(other.task) for other, senses in self._frozen if senses is not None]
        for other, senses in self._frozen:
            if senses is not None:
                _require_fit(other, senses)
        self._everyone = np.arange(n)

    def seed(self, seed: int) -> None:
        """Begin all chance anew."""
        self.worlds.seed(seed)
        for senses in self.seeing:
            senses.restart()

    def reset(self) -> list[dict[str, np.ndarray]]:
        """Begin all episodes; what those who learn observe."""
        self.worlds.reset(self._everyone)
        for senses in self.seeing:
            senses.acted(np.zeros_like(senses.action))
        return self.remember(self.look(self._everyone, self._everyone), self._everyone)

    def act(self, actions: Sequence[np.ndarray]) -> list[StepOfWorld]:
        """One action further; actions (world, number) of each that learns. What `TaskWorlds.step` returns."""
        everyones = list(actions)
        for other, senses in self._frozen:
            size = other.task.n_actions(self.worlds.model)
            shape = len(self._everyone), size
            everyones.append(np.zeros(shape, np.float32) if senses is None else other.actions(senses.now, shape))
        senses_of = [*self.learners, *(senses for _, senses in self._frozen)]
        for senses, commanded in zip(senses_of, everyones, strict=True):
            if senses is not None:
                senses.acted(commanded)
        return self.worlds.step(everyones)

    def look(self, worlds: np.ndarray, fresh: np.ndarray = NOWHERE) -> list[Seen]:
        """What all who look see in these worlds; all eyes are begun before any is waited for. fresh: worlds whose
        episode has just begun"""
        poses = Poses.of(self.worlds.datas)
        begun = [senses.begin(poses, worlds, fresh) for senses in self.seeing]
        return [{name: looking.wait() for name, looking in kinds.items()} for kinds in begun]

    def begin_again(self, ended: np.ndarray, seen: Sequence[Seen]) -> None:
        """New episodes in these worlds; what is seen there takes the place of what was."""
        for senses in self.seeing:
            senses.action[ended] = 0.0
        self.worlds.reset(ended)
        for frames, fresh in zip(seen, self.look(ended, ended), strict=True):
            for name, of_kind in frames.items():
                of_kind[ended] = fresh[name]

    def remember(self, seen: Sequence[Seen], fresh: np.ndarray) -> list[dict[str, np.ndarray]]:
        """Observations of those who learn; fresh: worlds that have just begun."""
        known = [senses.observation(frames, fresh) for senses, frames in zip(self.seeing, seen, strict=True)]
        return known[: len(self.learners)]

    def state(self) -> dict[str, np.ndarray]:
        """Where everything stands; each array's first axis is the world."""
        found = task_state.of_worlds(self.worlds)
        for number, senses in enumerate(self.seeing):
            found |= {self._key(number, name): array for name, array in senses.state().items()}
        return found

    def bring_back(self, state: Mapping[str, np.ndarray], chosen: np.ndarray) -> None:
        """These worlds as they were."""
        task_state.bring_back(self.worlds, state, chosen)
        for number, senses in enumerate(self.seeing):
            now = senses.state()
            for name, array in now.items():
                array[chosen] = state[self._key(number, name)][chosen]
            senses.bring_back(now)

    def _key(self, number: int, name: str) -> str:
        return name if number == 0 else f"{self._names[number]}.{name}"


def _require_fit(other: Frozen, senses: Senses) -> None:
    """Its policy takes what its eyes see, where it says what it takes.

    Raises:
        ValueError: it takes something else.
    """
    learnt = getattr(other.policy, "observation_space", None)
    if learnt is None:
        return
    spaces_of = [getattr(space, "spaces", {}) for space in (learnt, senses.observation_space)]
    wanted, here = ({name: space.shape for name, space in of.items()} for of in spaces_of)
    if wanted != here:
        raise ValueError(f"policy of {name_of(other.task)!r} takes {wanted}, its task gives {here}: must be alike")
