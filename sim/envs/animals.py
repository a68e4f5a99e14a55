"""All agents of many worlds: learning agents, and agents with frozen policies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sim.envs.renderers import AgentRenderers
from sim.envs.senses import Arrays, Senses
from sim.render.pending_frame import PendingFrame
from sim.tasks.encounter import Frozen
from sim.tasks.outcome import NOWHERE, Step
from sim.tasks.per_world import PerWorld
from sim.tasks.simulation import Simulation

Pending = list[dict[str, PendingFrame]]  # for each agent with eyes: frames by kind of eyes


@dataclass(frozen=True)
class Advanced:
    """The outcome of an action, and frames that are still being rendered.

    step: outcome of the action
    pending: frames after the action, for each agent whose eyes are used, learners first
    """

    step: Step
    pending: Pending


class Animals:
    """All agents of a batch of worlds, and their observations.

    simulation: the worlds
    renderers: for each agent, the renderers of its eyes, or None if its eyes are not used
    memory: number of frames in the observations of learning agents
    learners: attribute, one `Senses` (an agent's observations) for each learning agent
    seeing: attribute, one `Senses` for each agent whose eyes are used, learners first
    """

    def __init__(self, simulation: Simulation, renderers: Sequence[AgentRenderers | None], memory: int) -> None:
        self.simulation, task = simulation, simulation.task
        frozen: Sequence[Frozen] = task.frozen if isinstance(task, PerWorld) else ()
        number = simulation.learners
        self.learners = [Senses(simulation, k, of, memory) for k, of in enumerate(renderers[:number]) if of is not None]
        self._frozen = [
            (other, None if of is None else Senses(simulation, k, of, other.memory))
            for k, (other, of) in enumerate(zip(frozen, renderers[number:], strict=True), start=number)
        ]
        self._of_agents: list[Senses | None] = [*self.learners, *(senses for _, senses in self._frozen)]
        self.seeing = [senses for senses in self._of_agents if senses is not None]
        self._with_auxiliary = [senses for senses in self.seeing if senses.has_auxiliary]
        for other, senses in self._frozen:
            if senses is not None:
                _require_fit(other, senses)

    def seed(self, seed: int | tuple[int, ...]) -> None:
        """Restart all random streams from one seed, or from one seed per world."""
        self.simulation.seed(seed)
        for senses in self.seeing:
            senses.restart()

    def reset(self) -> list[Arrays]:
        """Start all episodes; return the observations of the learning agents."""
        everyone = np.arange(self.simulation.n)
        pending = self.start_episodes(everyone)
        return self.remember(_waited(pending), everyone)

    def advance(self, actions: Sequence[np.ndarray]) -> Advanced:
        """Take one action in all worlds, and launch the rendering of the frames after it.

        actions: one array (world, n_actions) for each learning agent
        """
        simulation = self.simulation
        commanded = self._all_actions(actions)
        failed = simulation.move(np.concatenate(commanded, axis=1))
        first = 0
        for agent, senses in zip(simulation.agents, self._of_agents, strict=True):
            if senses is not None:
                senses.action = simulation.taken[:, first : first + agent.n_actions]
            first += agent.n_actions
        pending = self.launch() if simulation.task.renders_early else None
        step = simulation.judge(failed)
        pending = pending or self.launch()
        if self._with_auxiliary:
            poses = simulation.poses()
            for senses in self._with_auxiliary:
                senses.update_auxiliary(poses, NOWHERE)
        return Advanced(step, pending)

    def seen(self, advanced: Advanced) -> list[Arrays]:
        """Wait for the frames after an action, and return them for each agent whose eyes are used, learners first.

        Worlds in which the task moved bodies after the action (`Step.changed`) are rendered again first.
        """
        frames, changed = _waited(advanced.pending), advanced.step.changed
        if len(changed):
            _put(frames, changed, _waited(self.launch(changed)))
        return frames

    def start_episodes(self, worlds: np.ndarray) -> Pending:
        """Start new episodes in these worlds, and return their first frames, which are still being rendered.

        There are frames for each agent whose eyes are used, in the order of the attribute `seeing`.

        worlds: indices of the worlds

        Raises:
            RuntimeError: a method of a `sim.Task` fails, or the task changes the model of all worlds.
        """
        self.simulation.restart(worlds)
        for senses in self.seeing:
            senses.action = senses.action.copy()
            senses.action[worlds] = senses.agent.first_action
        poses = self.simulation.poses()
        for senses in self._with_auxiliary:
            senses.update_auxiliary(poses, worlds)
        everyone = len(worlds) == self.simulation.n
        return [senses.launch(poses, None if everyone else worlds, fresh=True) for senses in self.seeing]

    def remember(self, seen: Sequence[Arrays], fresh: np.ndarray) -> list[Arrays]:
        """Add frames to the memories, and return the observations of the learning agents.

        seen: the new frames, one entry for each agent whose eyes are used; learning agents come before frozen ones
        fresh: indices of the worlds whose episode has just begun
        """
        known = [senses.observation(frames, fresh) for senses, frames in zip(self.seeing, seen, strict=True)]
        return known[: len(self.learners)]

    @staticmethod
    def replace(seen: Sequence[Arrays], worlds: np.ndarray, pending: Pending) -> None:
        """Replace the last frames of these worlds by the first frames of their new episodes.

        seen: frames of each agent whose eyes are used, changed in place
        worlds: indices of the worlds that have started a new episode
        pending: their first frames, from `start_episodes`
        """
        _put(seen, worlds, _waited(pending))

    def get_state(self) -> Arrays:
        """Return all arrays on which future steps depend, by name; the first axis of each array is the world."""
        found = self.simulation.get_state()
        for number, senses in enumerate(self.seeing):
            found |= {self._key(number, name): array for name, array in senses.get_state().items()}
        return found

    def set_state(self, state: Mapping[str, np.ndarray], chosen: np.ndarray) -> None:
        """Restore the state that `get_state` returned, in the worlds with the indices `chosen`."""
        self.simulation.set_state(state, chosen)
        for number, senses in enumerate(self.seeing):
            now = senses.get_state()
            for name, array in now.items():
                array[chosen] = state[self._key(number, name)][chosen]
            senses.set_state(now)

    def launch(self, worlds: np.ndarray | None = None) -> Pending:
        """Launch the rendering of these worlds (None: all) for all agents whose eyes are used, without waiting."""
        poses = self.simulation.poses()
        return [senses.launch(poses, worlds) for senses in self.seeing]

    def _all_actions(self, actions: Sequence[np.ndarray]) -> list[np.ndarray]:
        found = list(actions)
        for agent, (other, senses) in zip(self.simulation.agents[len(actions) :], self._frozen, strict=True):
            shape = self.simulation.n, agent.n_actions
            found.append(np.zeros(shape, np.float32) if senses is None else other.actions(senses.now, shape))
        return found

    def _key(self, number: int, name: str) -> str:
        return name if number == 0 else f"{self.seeing[number].agent.name}.{name}"


def _waited(pending: Pending) -> list[Arrays]:
    return [{name: frame.wait() for name, frame in kinds.items()} for kinds in pending]


def _put(seen: Sequence[Arrays], worlds: np.ndarray, fresh: Sequence[Arrays]) -> None:
    for frames, new in zip(seen, fresh, strict=True):
        for name, of_kind in frames.items():
            of_kind[worlds] = new[name]


def _require_fit(other: Frozen, senses: Senses) -> None:
    """Check that a frozen policy fits the observations of its animal. A policy without observation space is accepted.

    Raises:
        ValueError: the policy's observation space has other entries, or entries of other shapes.
    """
    learnt = getattr(other.policy, "observation_space", None)
    if learnt is None:
        return
    spaces_of = [getattr(space, "spaces", {}) for space in (learnt, senses.observation_space)]
    wanted, here = ({name: space.shape for name, space in of.items()} for of in spaces_of)
    if wanted != here:
        raise ValueError(f"policy of {senses.agent.name!r} takes {wanted}, its task gives {here}: must be alike")
