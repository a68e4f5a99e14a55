"""A task prepared for several environments, so that expensive steps are done only once.

The scenes are built, and a fidelity is chosen for each kind of eyes. A fidelity is the accuracy with which the world is
rendered for these eyes. For example, it contains the number of rays per receptor.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import replace

import drjit as dr

from sim.envs.frame_choice import with_frames
from sim.envs.renderers import renderers_for, scenes_for
from sim.envs.vec_env import EyesVecEnv
from sim.render.edge_rays import FIRST
from sim.render.eye_renderer import EyeRenderer
from sim.render.fidelity import EDGES, RAYS, Fidelity
from sim.render.world_fidelity import chosen_fidelity
from sim.scene.variation import Variation
from sim.tasks.batch_task import Agent, BatchTask
from sim.tasks.built_in import AgentTask
from sim.tasks.simulation import Simulation
from sim.tasks.task_fidelity import fidelities_among

__all__ = ["PreparedTask"]

Fidelities = Mapping[str, Fidelity]  # fidelity of each kind of an agent's eyes, by name of the kind


class PreparedTask:
    """A task, its scenes, and the fidelity of all eyes: the accuracy with which the world is rendered for these eyes.

    task: the task
    fidelity: fidelity of the learners' eyes; None: the fidelities that the task defines, or an automatic choice
    fidelities: attribute, the resulting list with one entry per agent. The entry is a dictionary from the name of each
        kind of the agent's eyes to its fidelity, or None if the agent's eyes are not used.

    Raises:
        ValueError: the task's settings, model or eyes are invalid.
    """

    def __init__(self, task: BatchTask, fidelity: Fidelity | None = None) -> None:
        self.task, agents = task, task.agents()
        layout = isinstance(task, AgentTask) and not (task.vary and Variation(task.vary).of_appearances)
        self._scenes = scenes_for(task) if layout and isinstance(task, AgentTask) else None
        self.fidelities: list[Fidelities | None] = [
            self._fidelities(number, agent, fidelity) if agent.learns or agent.policy is not None else None
            for number, agent in enumerate(agents)
        ]
        self.fidelities = with_frames(task, self.fidelities, self._scenes)

    def _fidelities(self, number: int, agent: Agent, fidelity: Fidelity | None) -> Fidelities:
        if agent.learns and fidelity is not None:
            return dict.fromkeys((kind.name for kind in agent.kinds), fidelity)
        if self._scenes is None:
            return fidelities_among(self.task, number)
        return {
            kind.name: kind.fidelity
            if isinstance(kind.fidelity, Fidelity)
            else chosen_fidelity(self._scenes[kind.name])
            for kind in agent.kinds
        }

    @property
    def fidelity(self) -> Fidelity:
        """Accuracy with which the world is rendered for the first learner's first kind of eyes."""
        first = self.fidelities[0]
        assert first is not None
        return next(iter(first.values()))

    def at_most(self, rays_per_receptor: float) -> PreparedTask:
        """Return the same task with at most this number of rays per receptor for the learners' eyes."""
        found = copy.copy(self)
        found.fidelities = [
            {name: _at_most(fidelity, rays_per_receptor) for name, fidelity in of.items()}
            if of and agent.learns
            else of
            for agent, of in zip(self.task.agents(), self.fidelities, strict=True)
        ]
        return found

    def in_mode(self, mode: str) -> PreparedTask:
        """Return the same task in another mode."""
        found = copy.copy(self)
        found.task = self.task.in_mode(mode)
        return found

    def elsewhere(self, task: BatchTask) -> PreparedTask:
        """Return `task` prepared with these fidelities; it has the same eyes, but another layout of the world."""
        found = copy.copy(self)
        found.task = task
        found._scenes = None if self._scenes is None or not isinstance(task, AgentTask) else scenes_for(task)
        return found

    def vec_env(
        self,
        n_envs: int,
        seed: int | None,
        memory: int = 1,
        *,
        least_return: float | None = None,
        episode_steps: int | None = None,
        render_mode: str | None = None,
    ) -> EyesVecEnv:
        """Return a batched environment; see `sim.make_vec_env` for the arguments."""
        threads = min(dr.thread_count(), n_envs)
        simulation = Simulation(self.task, n_envs, seed, threads, least_return, episode_steps)
        renderers = renderers_for(simulation, simulation.agents, self.fidelities, self._scenes)
        return EyesVecEnv(simulation, renderers, memory, render_mode)

    def renderer(self, simulation: Simulation) -> EyeRenderer:
        """Return a renderer of the first agent's first kind of eyes, for the worlds of a simulation.

        The renderer has the eyes of this prepared task. The simulation may run the same task with other eyes.
        """
        (first,) = renderers_for(simulation, self.task.agents()[:1], self.fidelities[:1], self._scenes)
        assert first is not None
        return next(iter(first.eyes.values()))


def _at_most(fidelity: Fidelity, rays_per_receptor: float) -> Fidelity:
    """Return a fidelity with at most this number of rays per receptor.

    If the limit is below the number of rays with which adaptive edge sampling starts, all receptors get the same number
    of rays.
    """
    rays = min(fidelity.rays_per_receptor, rays_per_receptor)
    samples = RAYS if fidelity.samples == EDGES and rays < FIRST else fidelity.samples
    return replace(fidelity, rays_per_receptor=rays, samples=samples)
