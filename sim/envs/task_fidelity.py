"""How finely a task of one's own is seen: as it says, or as a few moments of its episodes want."""

from __future__ import annotations

import contextlib
import copy
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

import optics
from sim.envs.task_worlds import TaskWorlds
from sim.eyes.allowed_error import allowed_error
from sim.render.fidelity import Fidelity
from sim.render.model_fidelity import choose_model_fidelity
from sim.scene.poses import Poses
from sim.scene.variation import Variation
from sim.tasks.encounter import Frozen, among, cast
from sim.tasks.eye_kinds import EYES, kinds_of, several
from sim.tasks.user_task import Task

AUTO = "auto"
WORLDS, LATER = 6, 12  # episodes that are looked into: at their beginnings, and so many random actions later


def fidelities_of(task: Task) -> dict[str, Fidelity]:
    """Of each kind of eyes, the task's own, or, "auto", what `sim.choose_model_fidelity` finds; same task, same
    fidelity.

    Raises:
        ValueError: it is neither, and what the task's model and eyes raise.
    """
    kinds = kinds_of(task)
    for kind in kinds:
        if not isinstance(kind.fidelity, Fidelity) and kind.fidelity != AUTO:
            said = f"fidelity = {kind.fidelity!r}"
            raise ValueError(f"{type(task).__name__}: {said}: must be a sim.Fidelity, or {AUTO!r}")
    found = {kind.name: kind.fidelity for kind in kinds if isinstance(kind.fidelity, Fidelity)}
    if len(found) < len(kinds):
        with contextlib.closing(TaskWorlds(task, WORLDS, 0)) as worlds:
            datas, model, spectra = _moments(worlds), worlds.model, worlds.spectra
            variation, varied = worlds.variation, worlds.bodies.varied
        for kind in kinds:
            if kind.name not in found:
                tolerance = None if variation is None else _in_brightest(variation, kind.eye)
                found[kind.name] = choose_model_fidelity(
                    model, kind.eye, kind.mounts, datas, tolerance, spectra=spectra, varied=varied
                )
    return found


def _in_brightest(variation: Variation, eye: optics.Eye) -> float:
    """What may be wrong of a signal, where lights are brighter in some episodes, and errors with them."""
    most = variation.extremes(np.asarray(eye.spectral_bands.wavelengths)).max()
    return allowed_error(eye, None) / max(float(most), 1.0)


def fidelity_of(task: Task) -> Fidelity:
    """Of a task with eyes of one kind.

    Raises:
        ValueError: see `fidelities_of`.
    """
    (found,) = fidelities_of(task).values()
    return found


def fidelities_among(animals: Sequence[Task], number: int) -> dict[str, Fidelity]:
    """Of one of them, by what it sees of the others.

    Raises:
        ValueError: see `fidelities_of`.
    """
    others = [Frozen(animal) for k, animal in enumerate(animals) if k != number]
    return fidelities_of(among(animals[number], others))


def with_settled_others(task: Task) -> Task:
    """The same task, whose others see as finely as they want to: so that it need not be found out in every environment
    anew.

    Raises:
        ValueError: see `fidelities_of`.
    """
    _, frozen = cast(task)
    animals = [task, *(other.task for other in frozen)]
    settled = []
    for number, other in enumerate(frozen, start=1):
        body = copy.copy(other.task)
        if other.policy is not None:
            found = fidelities_among(animals, number)
            body.fidelity = found if several(body) else found[EYES]
        settled.append(replace(other, task=body))
    return among(task, settled)


def _moments(worlds: TaskWorlds) -> Poses:
    random, everyone = np.random.default_rng(0), np.arange(WORLDS)
    worlds.reset(everyone)
    first = Poses.of(worlds.datas)
    for _ in range(min(LATER, worlds.episode_steps - 1)):
        sizes = [animal.n_actions(worlds.model) for animal in worlds.animals]
        outcomes = worlds.step([random.uniform(-1, 1, (WORLDS, size)) for size in sizes])
        ended = [outcome.terminated or outcome.truncated for outcome in outcomes]
        if any(ended):
            worlds.reset(np.flatnonzero(ended))
    return Poses.joined(first, Poses.of(worlds.datas))
