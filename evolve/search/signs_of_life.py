"""Record of the signs of life of a Dask scheduler and its workers, and of the time since the last sign of life."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

__all__ = ["SCHEDULER", "SignsOfLife"]

SCHEDULER = "an answer of the scheduler"
SHOWN = 3  # number of workers that a message names


@dataclass
class SignsOfLife:
    """Time without signs of life of a scheduler and its workers.

    An answer is a sign of life of the scheduler, and a heartbeat is a sign of life of a worker. Workers also send
    heartbeats while they train, so training may take longer than `patience_s`.

    patience_s: maximum time without a sign of life [s]
    regular_s: maximum time between two answers of a scheduler that is alive [s]; if the scheduler was silent for
        longer, the excess does not count as silence of the workers
    """

    patience_s: float
    regular_s: float
    _scheduler_s: float = 0.0
    _workers_s: float = 0.0
    _last_seen: dict[str, float] = field(default_factory=dict)
    _silent_s: dict[str, float] = field(default_factory=dict)
    _paused: tuple[str, ...] = ()

    def wait(self, seconds: float) -> None:
        """Add `seconds`, which passed without an answer of the scheduler, to the time of its silence."""
        self._scheduler_s += seconds

    def answer(self, workers: Mapping[str, Mapping[str, Any]]) -> None:
        """Record an answer of the scheduler.

        workers: address and description of each connected worker, as in the scheduler's `identity`
        """
        passed, self._scheduler_s = min(self._scheduler_s, self.regular_s), 0.0
        silent = {}
        for address, worker in workers.items():
            beats = worker["last_seen"] != self._last_seen.get(address)
            silent[address] = 0.0 if beats else self._silent_s[address] + passed
        self._silent_s = silent
        self._last_seen = {address: worker["last_seen"] for address, worker in workers.items()}
        self._paused = tuple(address for address, worker in workers.items() if not _usable(worker))
        alive = any(silence == 0.0 for address, silence in silent.items() if address not in self._paused)
        self._workers_s = 0.0 if alive else self._workers_s + passed

    def forget(self, address: str) -> None:
        """Forget a worker that was removed from the scheduler.

        If the next list of workers from the scheduler still contains this worker, it counts as a new worker.
        """
        self._silent_s.pop(address, None)
        self._last_seen.pop(address, None)

    @property
    def usable(self) -> int:
        """Number of connected workers that accept or evaluate candidates."""
        return len(self._silent_s.keys() - set(self._paused))

    @property
    def silence_s(self) -> float:
        """The longer of two times [s]: since the scheduler's last answer, and since the last heartbeat of any worker.

        Heartbeats of workers that neither accept nor evaluate candidates do not count.
        """
        return max(self._scheduler_s, self._workers_s)

    @property
    def exhausted(self) -> bool:
        """True if the scheduler, or all workers, have given no sign of life for at least `patience_s`.

        Heartbeats of workers that neither accept nor evaluate candidates do not count.
        """
        return self.silence_s >= self.patience_s

    @property
    def lost_workers(self) -> tuple[str, ...]:
        """Addresses of workers that have been silent for at least `patience_s`.

        The result is () if every worker that accepts or evaluates candidates has been silent for this time. The
        property `exhausted` reports this case.
        """
        if self._workers_s >= self.patience_s:
            return ()
        return tuple(address for address, silence in self._silent_s.items() if silence >= self.patience_s)

    @property
    def missing(self) -> str:
        """Part of a message: the sign of life that has been missing for the longest time.

        Signs of life are answers of the scheduler and heartbeats of workers.
        """
        if self._scheduler_s >= self._workers_s:
            return SCHEDULER
        if not self._silent_s:
            return "a worker (none is connected)"
        if silent := [address for address in self._silent_s if address not in self._paused]:
            return f"a heartbeat of {_named(silent)}"
        return f"a worker that accepts candidates ({_named(list(self._paused))} paused, usually for lack of memory)"


def _usable(worker: Mapping[str, Any]) -> bool:
    """Return whether a worker accepts new candidates or is evaluating a candidate."""
    return worker["status"] == "running" or bool(worker.get("metrics", {}).get("executing"))


def _named(addresses: list[str]) -> str:
    more = f" and {len(addresses) - SHOWN} more" if len(addresses) > SHOWN else ""
    return f"worker{'s' * (len(addresses) > 1)} {', '.join(addresses[:SHOWN])}{more}"
