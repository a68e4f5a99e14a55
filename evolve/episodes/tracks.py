"""Tracks of an animal, seen from above, in several episodes at once."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass

import numpy as np

from evolve.config.run_config import RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.learning.animal_task import animal_task
from evolve.learning.final_figures import require_fit
from evolve.learning.played_episodes import Episodes, play
from evolve.learning.policy import EyePolicy
from sim.envs.prepared_task import PreparedTask
from sim.envs.vec_env import EyesVecEnv
from sim.eyes.mounts import Mount
from sim.worlds.ground_plan import GroundPlan

__all__ = ["Track", "tracks"]


@dataclass(frozen=True)
class Track:
    """Track of an animal during one episode. In the shapes of arrays, t is the time step.

    position: position before each action [m], (t, 2)
    objects: positions of the objects in `plan` before each action [m], (t, object, 2)
    total: return of the episode
    solved: True if the episode counts as solved
    plan: ground plan of the world, with walls, goal region and objects; None if the task has no ground plan
    """

    position: np.ndarray
    objects: np.ndarray
    total: float
    solved: bool
    plan: GroundPlan | None

    @property
    def length(self) -> float:
        """Length of the track [m]."""
        return float(np.linalg.norm(np.diff(self.position, axis=0), axis=1).sum())


def tracks(
    phenotype: Phenotype,
    config: RunConfig,
    policy: EyePolicy,
    seed: int = 0,
    episodes: int | None = None,
    mode: str = "evaluation",
) -> list[Track]:
    """Play episodes without exploration, and return the animal's tracks. The same arguments give the same tracks.

    Animals with different eyes start in the same states, so that their tracks can be compared.

    seed: seed of the episodes
    episodes: number of episodes; None: the run's setting `evaluation.episodes`
    mode: "training", "evaluation" or "test", which may have different layouts

    Raises:
        UnfitPolicy: the policy was trained with different eyes.
        TrainingDiverged: the policy's actions are not finite.
        ConfigError: the run was opened without the "FILE.py:CLASS" of its user task, or its code cannot be executed.
        ValueError: `episodes` is below 1, or `seed` is negative.
        RuntimeError: a method of the user task fails at the start of an episode.
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
    """
    count = config.evaluation.episodes if episodes is None else episodes
    prepared = PreparedTask(animal_task(phenotype, config, mode))
    mount = prepared.task.agents()[0].kinds[0].mounts[0]
    with contextlib.closing(prepared.vec_env(count, seed, phenotype.memory_frames)) as worlds:
        require_fit(policy, worlds)
        watcher = _Watcher(worlds, mount)
        played = play(policy, worlds, seed, watcher.watch)
    return watcher.tracks(played)


class _Watcher:
    """Recorder of the positions of the animal and of objects while episodes are played.

    worlds: environments in which the episodes are played
    mount: place of the animal's first eye on a body, site or camera of the model; the position of this body, site or
        camera is recorded as the animal's position
    """

    def __init__(self, worlds: EyesVecEnv, mount: Mount) -> None:
        self._worlds, self._carrier = worlds, mount.found_in(worlds.worlds.model)
        self._plans: list[GroundPlan | None] = []
        self._positions, self._objects = list[np.ndarray](), list[np.ndarray]()
        self._lengths = np.zeros(worlds.num_envs, int)

    def watch(self, playing: np.ndarray) -> None:
        """Record the positions before an action; playing: True for worlds whose episode has not ended, (world,)."""
        poses = self._worlds.simulation.poses()
        position = poses.frames(*self._carrier)[0][:, :2].copy()
        self._plans = self._plans or [self._worlds.batch_task.ground_plan(start) for start in position]
        bodies = [] if self._plans[0] is None else list(self._plans[0].object_bodies)
        self._positions.append(position)
        self._objects.append(poses.xpos[:, bodies, :2].copy())
        self._lengths += playing

    def tracks(self, played: Episodes) -> list[Track]:
        """Return the recorded tracks with the results of the episodes."""
        position, objects = (np.stack(rows, axis=1) for rows in (self._positions, self._objects))
        ends = zip(self._lengths, played.returns, played.successes, self._plans, strict=True)
        return [
            Track(position[i, :n], objects[i, :n], float(total), bool(solved), plan)
            for i, (n, total, solved, plan) in enumerate(ends)
        ]
