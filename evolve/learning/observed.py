"""Entries of an observation other than the eyes' signals: names, sizes and limits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

__all__ = ["CONTACT", "FEELS", "Entry", "entries_from_record", "entries_of", "known_beside_eyes"]

EYES, LAST = "eyes", "previous_action"
FEELS = "feels"  # name of the proprioception of a `sim.Task` in observations


@dataclass(frozen=True)
class Entry:
    """An entry of an observation.

    name: key in the observation
    size: number of elements
    low, high: lower and upper limit of the elements; if both are infinite, a policy normalises the entry
    """

    name: str
    size: int
    low: float = -math.inf
    high: float = math.inf

    @property
    def normalised(self) -> bool:
        """True if a policy normalises the entry by its running mean and standard deviation."""
        return math.isinf(self.low) and math.isinf(self.high)

    @property
    def space(self) -> spaces.Box:
        return spaces.Box(self.low, self.high, (self.size,), np.float32)

    def record(self) -> list[Any]:
        """Return the entry as JSON values [name, size, low, high]; an infinite limit becomes None."""
        limits = (None if math.isinf(limit) else limit for limit in (self.low, self.high))
        return [self.name, self.size, *limits]

    @classmethod
    def from_record(cls, stored: Sequence[Any]) -> Entry:
        """Return the entry from the values that `record` returned.

        Raises:
            TypeError: the stored value is not a list.
            ValueError: the list does not describe an entry.
        """
        name, size, low, high = stored
        if not isinstance(name, str):
            raise ValueError(f"{name!r} is not the name of an entry")
        return cls(name, int(size), -math.inf if low is None else float(low), math.inf if high is None else float(high))


CONTACT = Entry("contact", 1, 0.0, 1.0)


def known_beside_eyes(space: spaces.Dict) -> dict[str, int]:
    """Return the sizes of the entries other than "eyes" by name, in the order in which policies receive them."""
    return {name: math.prod(part.shape or (1,)) for name, part in sorted(space.spaces.items()) if name != EYES}


def entries_of(space: spaces.Dict) -> tuple[Entry, ...]:
    """Return the entries other than the eyes' signals and the previous action, in the order of `known_beside_eyes`."""
    sizes = known_beside_eyes(space)
    limits = {name: part for name, part in space.spaces.items() if isinstance(part, spaces.Box)}
    return tuple(
        Entry(name, size, float(np.min(limits[name].low)), float(np.max(limits[name].high)))
        for name, size in sizes.items()
        if name != LAST
    )


def entries_from_record(stored: Mapping[str, Any]) -> tuple[Entry, ...]:
    """Return a policy's entries of the observation other than the eyes' signals and the previous action.

    Older versions stored only the size of the proprioception, or, for built-in tasks, nothing.

    stored: record of the policy's shape, see `PolicyConfig.record`

    Raises:
        TypeError: a stored entry is not a list.
        ValueError: a list does not describe an entry.
    """
    if "beside" in stored:
        return tuple(Entry.from_record(entry) for entry in stored["beside"])
    if FEELS in stored:
        size = int(stored[FEELS])
        return (Entry(FEELS, size),) if size else ()
    return (CONTACT,)
