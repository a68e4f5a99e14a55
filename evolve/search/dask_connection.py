"""Connection to a Dask scheduler.

A call fails if the scheduler, or all workers at once, have given no sign of life for `patience_s`.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import math
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from evolve.search.job import ExecutorError
from evolve.search.scheduler import Scheduler, close
from evolve.search.signs_of_life import SCHEDULER, SignsOfLife

__all__ = ["LISTEN_S", "Connection", "ConnectionLost"]

CONNECT_S = 8.0  # [s] time limit for an attempt to connect
LISTEN_S = 0.5  # [s] interval between checks
QUESTION_S = 5.0  # [s] maximum interval between requests to the scheduler for a list of all workers
NOTICE_S = 10.0  # [s] time without a sign of life after which the user is notified
Events = Callable[[Any], Any]


class ConnectionLost(Exception):
    """The connection to the scheduler was lost during a call."""


@dataclass
class Connection:
    """Connection to a scheduler, from which a list of the connected workers is requested regularly.

    scheduler: the scheduler
    patience_s: maximum time for which the scheduler, or all workers at once, may be silent [s]
    note: function that is called with one line if the run waits for an answer or a heartbeat, or removes a silent
        worker
    topic, events: Dask topic to subscribe to, and the function that receives its events

    Raises:
        ExecutorError: the scheduler does not answer, or Dask is not installed. All methods except `close` raise an
            ExecutorError after `patience_s` without an answer of the scheduler, or without a heartbeat of any worker.
        ConfigError: the address of the scheduler requires certificates, but there are none.
    """

    scheduler: Scheduler
    patience_s: float
    note: Callable[[str], Any]
    topic: str
    events: Events
    client: Any = None
    signs: SignsOfLife = field(init=False)
    _question: concurrent.futures.Future[Any] | None = None
    _asked: float = field(init=False)
    _checked: float = field(init=False)
    _noted: bool = False

    def __post_init__(self) -> None:
        self.signs = SignsOfLife(self.patience_s, 2 * self._interval + LISTEN_S)
        self._open()
        self._checked = time.monotonic()

    @property
    def lost(self) -> bool:
        """True if Dask's client is not connected to the scheduler."""
        return bool(self.client.status != "running")

    def restore(self) -> None:
        """Connect again, with repeated attempts for at most `patience_s`.

        Dask's client also reconnects, but gives up after a few seconds, so a new client replaces it.
        """
        while True:
            self._pass_time(CONNECT_S + LISTEN_S)
            self.close()
            with contextlib.suppress(ExecutorError):
                return self._open()
            time.sleep(LISTEN_S)

    def require_worker(self) -> None:
        """Wait until a worker is connected."""
        while not self.signs.usable:
            self.check()
            if self.lost:
                self.restore()
            time.sleep(LISTEN_S / 10)

    def check(self) -> None:
        """Record signs of life that have arrived since the last check, and request new ones."""
        if self._question is not None and self._question.done():
            question, self._question = self._question, None
            if not question.cancelled() and question.exception() is None:
                self.signs.answer(question.result()["workers"])
                self._noted = self._noted and self.signs.silence_s > 0
        if self._question is None and not self.lost and time.monotonic() - self._asked >= self._interval:
            self._asked = time.monotonic()
            self._question = self._start(lambda: self.client.scheduler.identity(n_workers=-1))
        self._pass_time(2 * LISTEN_S)

    def ask(self, call: Callable[[], Awaitable[Any]], timeout: float = math.inf) -> Any:
        """Return the result of a call of Dask.

        Exceptions of the call are passed on, unless they show that the connection was lost.

        call: function that returns an awaitable, which is awaited in the thread of Dask's client
        timeout: maximum duration of the call [s]; by default, it is unlimited while the scheduler answers
            and at least one worker sends heartbeats

        Raises:
            ConnectionLost: the connection was lost during the call.
            TimeoutError: the call has taken longer than `timeout`.
        """
        from distributed.client import ClosedClientError

        deadline = time.monotonic() + timeout
        answer = self._start(call)
        try:
            while not concurrent.futures.wait([answer], timeout=LISTEN_S).done:
                self.check()
                if self.lost:
                    raise ConnectionLost
                if time.monotonic() > deadline:
                    raise TimeoutError
            return answer.result()
        except TimeoutError:
            raise
        except (OSError, concurrent.futures.CancelledError, asyncio.CancelledError, ClosedClientError):
            raise ConnectionLost from None
        finally:
            answer.cancel()

    def remove_lost_workers(self) -> None:
        """Make the scheduler remove workers that were silent for `patience_s`, and give other workers their candidates.

        Raises:
            ConnectionLost: the connection was lost.
        """
        for address in self.signs.lost_workers:
            silence = f"worker {address} has given no sign of life for {self.patience_s:g} s"
            self.note(f"{self.scheduler.address}: {silence}; its candidates are evaluated by other workers")
            self.ask(partial(self.client.scheduler.unregister, address=address, stimulus_id=self.topic))
            self.signs.forget(address)

    def close(self) -> None:
        """Close the connection. Errors are ignored."""
        if self._question is not None:
            self._question.cancel()
            self._question = None
        close(self.client)

    @property
    def _interval(self) -> float:
        return min(QUESTION_S, self.patience_s / 10)

    def _open(self) -> None:
        self.client = self.scheduler.client(min(CONNECT_S, self.patience_s))
        self.client.subscribe_topic(self.topic, lambda event: self.events(event[1]))
        self._asked = -math.inf

    def _start(self, call: Callable[[], Awaitable[Any]]) -> concurrent.futures.Future[Any]:
        """Start a call in the thread of Dask's client, and return its future."""

        async def awaited() -> Any:
            return await call()

        return asyncio.run_coroutine_threadsafe(awaited(), self.client.loop.asyncio_loop)

    def _pass_time(self, longest: float) -> None:
        """Count the time since the last check as silence, and notify the user of a long silence or a lost connection.

        longest: maximum time that is counted [s]; if more has passed, this process was suspended, which is not silence

        Raises:
            ExecutorError: the silence has lasted for `patience_s`.
        """
        before, self._checked = self._checked, time.monotonic()
        self.signs.wait(min(self._checked - before, longest))
        missing = SCHEDULER if self.lost else self.signs.missing
        if not self._noted and (self.lost or self.signs.silence_s >= min(NOTICE_S, self.patience_s / 4)):
            self._noted = True
            self.note(
                f"{self.scheduler.address}: waiting for {missing}; without a sign of life the run ends after "
                f"{self.patience_s:g} s"
            )
        if self.signs.exhausted:
            raise ExecutorError(
                f"{self.scheduler.address}: waited {self.patience_s:g} s for {missing}; all evaluated candidates are "
                "on record: continue with evolve resume as soon as the cluster works again"
            )
