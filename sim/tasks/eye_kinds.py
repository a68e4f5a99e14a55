"""Kinds of eyes of one animal: two that are wide and coarse, say, and one that is narrow and sharp."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import optics
from optics.numerics.arguments import did_you_mean, items, of_kind
from sim.eyes.mounts import Mount, mounts_of
from sim.render.fidelity import Fidelity

if TYPE_CHECKING:
    from sim.tasks.task_settings import TaskSettings

EYES = "eyes"  # what an only kind is called
AUXILIARY = ("depth", "ids", "flow")  # of each receptor, what an observation may hold, see `sim.Task`
TAKEN = ("previous_action", "feels", *AUXILIARY)  # what else an observation holds


@dataclass(frozen=True)
class EyeKind:
    """name: of what they see in an observation · eye: optics and retina · mounts: where they are · fidelity: how finely
    they see, or "auto" """

    name: str
    eye: optics.Eye
    mounts: tuple[Mount, ...]
    fidelity: Fidelity | str


def several(task: TaskSettings) -> bool:
    """Whether a task says eyes of more kinds than one, by name."""
    return isinstance(task.eye, Mapping) or isinstance(task.mounts, Mapping)


def kinds_of(task: TaskSettings) -> tuple[EyeKind, ...]:
    """In the task's order.

    Raises:
        ValueError: names that do not go together, or are no names.
    """
    where, eye, mounts, fidelity = type(task).__name__, task.eye, task.mounts, task.fidelity
    if not isinstance(eye, Mapping) and not isinstance(mounts, Mapping):
        if isinstance(fidelity, Mapping):
            raise ValueError(f"{where}: fidelity has kinds {_listed(fidelity)}: eye and mounts must have the same")
        return (EyeKind(EYES, _an_eye(f"{where}: eye", eye), mounts_of(f"{where}: mounts", mounts), fidelity),)
    eyes, places = _by_name(f"{where}: eye", eye, ()), _by_name(f"{where}: mounts", mounts, ())
    if eyes.keys() != places.keys():
        raise ValueError(f"{where}: eye has kinds {_listed(eyes)}, mounts {_listed(places)}: must be the same")
    fidelities = _by_name(f"{where}: fidelity", fidelity, eyes)
    if fidelities.keys() != eyes.keys():
        raise ValueError(f"{where}: fidelity has kinds {_listed(fidelities)}, eye {_listed(eyes)}: must be the same")
    for name in eyes:
        if not (isinstance(name, str) and name.isidentifier()) or name in TAKEN:
            raise ValueError(
                f"{where}: eye: kind {name!r}: must be a name such as 'sharp', and not {' or '.join(TAKEN)}"
            )
        for what in AUXILIARY:
            if f"{name}_{what}" in eyes:
                raise ValueError(
                    f"{where}: eye: kind '{name}_{what}': must have another name, {name!r} has {what!r}, too"
                )
    return tuple(
        EyeKind(
            name,
            _an_eye(f"{where}: eye[{name!r}]", eyes[name]),
            mounts_of(f"{where}: mounts[{name!r}]", places[name]),
            fidelities[name],
        )
        for name in eyes
    )


def auxiliary_of(names: Iterable[str], where: str) -> tuple[str, ...]:
    """Names of what is wanted, in the order of AUXILIARY.

    Raises:
        ValueError: one is unknown; `where` it was asked for.
    """
    if isinstance(names, str):
        raise ValueError(f"{where} = {names!r}: must be several names, such as ({names!r},)")
    asked = items(where, names, str, repr(AUXILIARY[0]))
    for name in asked:
        if name not in AUXILIARY:
            hint = did_you_mean(name, AUXILIARY) or f": must be of {', '.join(map(repr, AUXILIARY))}"
            raise ValueError(f"{where}: {name!r}{hint}")
    return tuple(name for name in AUXILIARY if name in asked)


def _an_eye(where: str, said: Any) -> optics.Eye:
    eye: optics.Eye = of_kind(where, said, optics.Eye, "optics.Eye(resolution=(15, 15))")
    return eye


def _by_name(where: str, said: Any, names: Mapping[str, Any] | Sequence[str]) -> Mapping[str, Any]:
    """What is said of each kind; one word for all where `names` says which there are."""
    if isinstance(said, Mapping) and said:
        return said
    if names and not isinstance(said, Mapping):
        return dict.fromkeys(names, said)
    raise ValueError(f"{where} = {said!r:.80}: must have an entry for each kind of eyes, {{'wide': ..., 'sharp': ...}}")


def _listed(names: Mapping[str, Any]) -> str:
    return ", ".join(map(repr, names))
