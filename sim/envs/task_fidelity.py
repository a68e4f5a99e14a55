"""How finely a task of one's own is seen: as it says, or as a few moments of its episodes want."""

from __future__ import annotations

import contextlib

import numpy as np

from sim.envs.task_worlds import TaskWorlds
from sim.render.fidelity import Fidelity
from sim.robots.model_fidelity import choose_model_fidelity
from sim.robots.poses import Poses
from sim.robots.task import Task

AUTO = "auto"
WORLDS, LATER = 6, 12  # episodes that are looked into: at their beginnings, and so many random actions later


def fidelity_of(task: Task) -> Fidelity:
    """The task's own, or, "auto", what `sim.choose_model_fidelity` finds; same task, same fidelity.

    Raises:
        ValueError: it is neither, and what the task's model and eyes raise.
    """
    asked = task.fidelity
    if isinstance(asked, Fidelity):
        return asked
    if asked != AUTO:
        raise ValueError(f"{type(task).__name__}: fidelity = {asked!r}: must be a sim.Fidelity, or {AUTO!r}")
    with contextlib.closing(TaskWorlds(task, WORLDS, 0)) as worlds:
        datas = _moments(worlds)
        return choose_model_fidelity(worlds.model, task.eye, task.mounts, datas, spectra=task.spectra)


def _moments(worlds: TaskWorlds) -> Poses:
    random, everyone = np.random.default_rng(0), np.arange(WORLDS)
    worlds.reset(everyone)
    first = Poses.of(worlds.datas)
    for _ in range(min(LATER, worlds.task.episode_steps - 1)):
        outcomes = worlds.step(random.uniform(-1, 1, (WORLDS, worlds.task.n_actions(worlds.model))))
        ended = [outcome.terminated or outcome.truncated for outcome in outcomes]
        if any(ended):
            worlds.reset(np.flatnonzero(ended))
    return Poses.joined(first, Poses.of(worlds.datas))
