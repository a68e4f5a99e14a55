"""Kinds of eyes of one animal, for example two wide, coarse eyes and a narrow, sharp one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from optics.numerics.arguments import did_you_mean, items, shown
from sim.eyes.compound_eye import WorldEye, world_eye
from sim.eyes.mounts import Mount, mounts_of
from sim.render.fidelity import Fidelity

if TYPE_CHECKING:
    from sim.tasks.task_settings import TaskSettings

EYES = "eyes"  # name of a single kind
AUXILIARY = ("depth", "ids", "flow")  # auxiliary entries of an observation, see `sim.Task`
TAKEN = ("previous_action", "feels", *AUXILIARY)  # names that are reserved for other entries of an observation


@dataclass(frozen=True)
class EyeKind:
    """Eyes of an animal that have the same optics and retina.

    name: name of the eyes' signals in an observation
    eye: optics and retina, or a compound eye
    mounts: places of the eyes
    fidelity: accuracy with which the eyes' views are rendered; "auto": it is chosen automatically
    """

    name: str
    eye: WorldEye
    mounts: tuple[Mount, ...]
    fidelity: Fidelity | str


def several(task: TaskSettings) -> bool:
    """Return whether a task defines several kinds of eyes, in dictionaries by name."""
    return isinstance(task.eye, Mapping) or isinstance(task.mounts, Mapping)


def kinds_of(task: TaskSettings) -> tuple[EyeKind, ...]:
    """Return the kinds of eyes of a task, in the order of the task's dictionary, or the single kind "eyes".

    Raises:
        ValueError: `eye`, `mounts` and `fidelity` define different kinds, or a name or a value is invalid.
    """
    where, eye, mounts, fidelity = type(task).__name__, task.eye, task.mounts, task.fidelity
    if not isinstance(eye, Mapping) and not isinstance(mounts, Mapping):
        if isinstance(fidelity, Mapping):
            raise ValueError(f"{where}: fidelity has kinds {_listed(fidelity)}: eye and mounts must have the same")
        return (EyeKind(EYES, world_eye(f"{where}: eye", eye), mounts_of(f"{where}: mounts", mounts), fidelity),)
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
            world_eye(f"{where}: eye[{name!r}]", eyes[name]),
            mounts_of(f"{where}: mounts[{name!r}]", places[name]),
            fidelities[name],
        )
        for name in eyes
    )


@contextmanager
def named_in_errors(animal: str) -> Iterator[None]:
    """Begin the message of each ValueError that is raised in this context with the name of an animal."""
    try:
        yield
    except ValueError as error:
        error.args = (f"{animal}: {error}",)
        raise


def auxiliary_of(names: Iterable[str], where: str) -> tuple[str, ...]:
    """Return the requested names of auxiliary entries, in the order "depth", "ids", "flow".

    where: beginning of the error message

    Raises:
        ValueError: a name is unknown.
    """
    if isinstance(names, str):
        raise ValueError(f"{where} = {names!r}: must be several names, such as ({names!r},)")
    asked = items(where, names, str, repr(AUXILIARY[0]))
    for name in asked:
        if name not in AUXILIARY:
            hint = did_you_mean(name, AUXILIARY) or f": must be of {', '.join(map(repr, AUXILIARY))}"
            raise ValueError(f"{where}: {name!r}{hint}")
    return tuple(name for name in AUXILIARY if name in asked)


def _by_name(where: str, said: Any, names: Mapping[str, Any] | Sequence[str]) -> Mapping[str, Any]:
    """Return the value of a setting for each kind of eyes, by the kind's name.

    where: beginning of the error message
    said: the setting: a mapping from the names of kinds to values, or a single value for all kinds
    names: names of the kinds to which a single value applies; empty: a single value is not allowed

    Raises:
        ValueError: the setting is an empty mapping, or a single value although `names` is empty.
    """
    if isinstance(said, Mapping) and said:
        return said
    if names and not isinstance(said, Mapping):
        return dict.fromkeys(names, said)
    raise ValueError(
        f"{where} = {shown(said)}: must have an entry for each kind of eyes, {{'wide': ..., 'sharp': ...}}"
    )


def _listed(names: Mapping[str, Any]) -> str:
    return ", ".join(map(repr, names))
