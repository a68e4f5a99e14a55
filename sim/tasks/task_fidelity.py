"""Fidelity of the eyes in a task: the accuracy with which their images are rendered.

The task's setting `fidelity` states it. If the setting is "auto", the fidelity is chosen by trial renderings of a few
moments of the task's episodes.
"""

from __future__ import annotations

import contextlib
import copy
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sim.eyes.allowed_error import allowed_error
from sim.eyes.compound_eye import WorldEye
from sim.render.fidelity import Fidelity
from sim.render.model_fidelity import choose_model_fidelity
from sim.scene.poses import Poses
from sim.scene.variation import Variation
from sim.tasks.batch_task import BatchTask
from sim.tasks.encounter import Frozen, among, split_agents
from sim.tasks.eye_kinds import EYES, named_in_errors, several
from sim.tasks.per_world import PerWorld
from sim.tasks.simulation import Simulation
from sim.tasks.task import Task

AUTO = "auto"
# Fidelities are compared in WORLDS episodes, at their start and after LATER random actions.
WORLDS, LATER = 6, 12


def fidelities_of(task: BatchTask | Task) -> dict[str, Fidelity]:
    """Return the accuracy with which the first agent's eyes are rendered: a fidelity for each kind of eyes, by name.

    It is the task's setting `fidelity`. If this is "auto", `sim.choose_model_fidelity` chooses a fidelity. The result
    is reproducible.

    Raises:
        ValueError: `fidelity` is neither a `sim.Fidelity` nor "auto", or the task's model or eyes are invalid.
        RuntimeError: a method of a `sim.Task` fails at the start of an episode.
    """
    batch = PerWorld(task) if isinstance(task, Task) else task
    animal = batch.agents()[0]
    kinds = animal.kinds
    for kind in kinds:
        if not isinstance(kind.fidelity, Fidelity) and kind.fidelity != AUTO:
            said = f"fidelity = {kind.fidelity!r}"
            raise ValueError(f"{type(task).__name__}: {said}: must be a sim.Fidelity, or {AUTO!r}")
    found = {kind.name: kind.fidelity for kind in kinds if isinstance(kind.fidelity, Fidelity)}
    if len(found) < len(kinds):
        with contextlib.closing(Simulation(batch, WORLDS, 0)) as worlds:
            poses, model, variation, varied = (
                _moments(worlds),
                worlds.physics.model,
                worlds.variation,
                worlds.physics.varied,
            )
        for kind in kinds:
            if kind.name not in found:
                tolerance = None if variation is None else _in_brightest(variation, kind.eye)
                with named_in_errors(animal.name):
                    found[kind.name] = choose_model_fidelity(
                        model,
                        kind.eye,
                        kind.mounts,
                        poses,
                        tolerance,
                        spectra=batch.spectra,
                        varied=varied,
                        medium=batch.medium,
                    )
    return found


def fidelities_among(task: BatchTask, number: int) -> dict[str, Fidelity]:
    """Return the accuracy with which one agent's eyes are rendered: a fidelity for each kind of eyes, by name.

    If the agent's task has the setting fidelity = "auto", the fidelity is chosen from scenes that contain the other
    agents.

    number: index of the agent

    Raises:
        ValueError: see `fidelities_of`.
        RuntimeError: see `fidelities_of`.
    """
    if not isinstance(task, PerWorld):
        return fidelities_of(task)
    others = [Frozen(animal) for k, animal in enumerate(task.animals) if k != number]
    return fidelities_of(among(task.animals[number], others))


def resolve_other_fidelities(task: Task) -> Task:
    """Return a copy of the task in which the eyes of other animals have a chosen fidelity instead of "auto".

    A fidelity is the accuracy with which eyes are rendered. The other animals are those that do not learn, in the
    task's attribute `others`. Environments then need not choose fidelities for these eyes again. Animals without a
    policy are unchanged, because environments do not render their eyes.

    Raises:
        ValueError: see `fidelities_of`.
    """
    _, frozen = split_agents(task)
    batch, settled = PerWorld(task), []
    for number, other in enumerate(frozen, start=1):
        body = copy.copy(other.task)
        if other.policy is not None:
            found = fidelities_among(batch, number)
            body.fidelity = found if several(body) else found[EYES]
        settled.append(replace(other, task=body))
    return among(task, settled)


def _in_brightest(variation: Variation, eye: WorldEye) -> float:
    """Return the allowed error of an eye's signal in renderings with the model's own, unvaried lights.

    Errors are proportional to the light, and episodes may multiply the lights. If the largest such factor is above 1,
    the allowed error is divided by it, so that the error is also small enough in the brightest episode.
    """
    most = variation.extremes(np.asarray(eye.spectral_bands.wavelengths)).max()
    return allowed_error(eye, None) / max(float(most), 1.0)


def _moments(worlds: Simulation) -> Poses:
    random = np.random.default_rng(0)
    worlds.reset()
    first = worlds.poses()
    for _ in range(min(LATER, worlds.episode_steps - 1)):
        commanded: Sequence[np.ndarray] = [random.uniform(-1, 1, (WORLDS, agent.n_actions)) for agent in worlds.agents]
        step = worlds.step(np.concatenate(commanded, axis=1))
        ended = step.done.reshape(worlds.learners, WORLDS).any(axis=0)
        if ended.any():
            worlds.restart(np.flatnonzero(ended))
    return Poses.joined(first, worlds.poses())
