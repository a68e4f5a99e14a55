"""Executor that evaluates candidates on a Dask cluster, for example under SLURM or Kubernetes (docs/cluster.md)."""

from __future__ import annotations

import contextlib
import uuid
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any

from evolve.config.assemble import to_toml
from evolve.search import dask_worker
from evolve.search.dask_connection import LISTEN_S, Connection, ConnectionLost
from evolve.search.job import ATTEMPTS, ExecutorError, Job, Progress
from evolve.search.scheduler import Scheduler
from evolve.store.atomic_files import write_whole
from evolve.store.evaluation import Evaluation

__all__ = ["DaskExecutor"]

REPLY_S = 10.0  # [s] time limit for a worker to send its result


def _ignore(note: str) -> None:
    """Ignore a note."""


@dataclass(frozen=True)
class _Trial:
    """A submitted job.

    counter: a distributed.Variable, stored by the scheduler; its value is the number of attempts so far
    order: the job in the form that is sent to a worker
    """

    job: Job
    counter: Any
    order: dask_worker.Order


@dataclass
class DaskExecutor:
    """Executor with the workers of a Dask scheduler. Each worker evaluates one candidate at a time.

    The executor is a context manager. A candidate whose worker dies is evaluated again, up to 3 times in
    total. If the connection to the scheduler is lost, all unfinished jobs are submitted again after reconnecting, and
    their attempts are counted again from 0.

    scheduler: the scheduler, or its address
    function: "module:name" of the function that evaluates a candidate; it takes the arguments of
        `evolve.learning.fitness.evaluate`
    patience_s: maximum time for which the scheduler, or all workers at once, may give no sign of life [s]; an
        evaluation may take longer, because workers also send heartbeats meanwhile
    note: function that is called with one line if the run waits for a sign of life, or removes a silent worker
    count: number of workers when the context was entered

    Raises:
        ConfigError: the address of the scheduler is malformed. On entry: the address begins with tls://, but no
            certificates for encrypted connections are given.
        ExecutorError: on entry, Dask is not installed, the scheduler does not answer, or no worker is connected.
    """

    scheduler: Scheduler | str
    function: str = "evolve.search.worker:evaluate_candidate"
    patience_s: float = 600.0
    note: Callable[[str], Any] = _ignore
    count: int = 0
    _name: str = field(default_factory=lambda: f"rhabdom-{uuid.uuid4().hex[:12]}")
    _connection: Any = None
    _reports: SimpleQueue[list[int]] = field(default_factory=SimpleQueue)

    def __post_init__(self) -> None:
        if isinstance(self.scheduler, str):
            self.scheduler = Scheduler(self.scheduler)
        self._scheduler, self._address = self.scheduler, self.scheduler.address

    def __enter__(self) -> DaskExecutor:
        self._connection = Connection(self._scheduler, self.patience_s, self.note, self._name, self._reports.put)
        try:
            self._connection.require_worker()
        except BaseException:
            self._connection.close()
            raise
        self.count = self._connection.signs.usable
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._connection.close()

    def run(self, jobs: Iterable[Job], progress: Progress | None = None) -> Iterator[tuple[Job, Evaluation]]:
        """Evaluate all jobs, and yield each with its outcome as soon as it is complete.

        If `jobs` is a deque, the caller may append further jobs between results.

        progress: function that is called with (candidate id, steps trained, steps planned); None: no function

        Raises:
            ExecutorError: a worker's software differs from that of this process, or a worker cannot use the run's
                settings or lacks resources such as disk space. The error is also raised if the scheduler, or all
                workers at once, have been silent for `patience_s`.
            ConfigError: the run has a user task, and was opened without naming it (argument `task`).
            OSError: this process cannot read or write a policy or a checkpoint.
        """
        waiting = jobs if isinstance(jobs, deque) else deque(jobs)
        under_way: dict[Any, _Trial] = {}
        try:
            while waiting or under_way:
                if self._connection.lost:
                    self._connection.restore()
                    waiting.extendleft(trial.job for trial in reversed(under_way.values()))
                    under_way.clear()
                with contextlib.suppress(ConnectionLost):
                    yield from self._round(waiting, under_way)
                self._report(progress)
        finally:
            self._withdraw(under_way)

    def _round(self, waiting: deque[Job], under_way: dict[Any, _Trial]) -> Iterator[tuple[Job, Evaluation]]:
        """Submit all waiting jobs, and yield each complete job with its outcome."""
        while waiting:
            trial = self._trial(waiting[0])
            under_way[self._submit(trial)] = trial
            waiting.popleft()
        for future in self._done(under_way):
            trial = under_way[future]
            if future.status in ("cancelled", "lost"):
                waiting.append(under_way.pop(future).job)
            elif self._may_be_repeated(trial, future):
                under_way[self._submit(trial)] = trial
                del under_way[future]
            elif (outcome := self._outcome(trial, future)) is not None:
                del under_way[future]
                yield trial.job, outcome
        self._connection.check()
        self._connection.remove_lost_workers()

    def _trial(self, job: Job) -> _Trial:
        """Return a job with a new counter of its attempts, which is 0.

        The scheduler stores the counter, because a worker that is killed cannot report its attempt.
        """
        from distributed import Variable

        name = f"{self._name}-{job.id}-{uuid.uuid4().hex[:6]}"
        counter = Variable(name, client=self._connection.client)
        self._connection.ask(lambda: counter.set(0))
        return _Trial(job, counter, dask_worker.encode(job, to_toml(job.config), self.function, name, self._name))

    def _submit(self, trial: _Trial) -> Any:
        key = f"{trial.order.counter}-{uuid.uuid4().hex[:6]}"
        try:
            return self._connection.client.submit(dask_worker.evaluate, trial.order, key=key, pure=False, retries=0)
        except Exception:
            if self._connection.lost:
                raise ConnectionLost from None
            raise

    def _may_be_repeated(self, trial: _Trial, future: Any) -> bool:
        """Return whether a job that failed because its worker died may be submitted again.

        It may if it has had fewer attempts than the maximum number.
        """
        from distributed import KilledWorker

        if future.status != "error" or not isinstance(future.exception(), KilledWorker):
            return False
        try:
            return int(self._connection.ask(lambda: trial.counter.get(timeout=REPLY_S))) < ATTEMPTS
        except TimeoutError:  # a scheduler that was restarted has no counter
            self._connection.ask(lambda: trial.counter.set(0))
            return True

    def _done(self, under_way: dict[Any, _Trial]) -> list[Any]:
        """Wait up to 0.5 s for a result, and return all futures that are no longer pending."""
        from distributed import wait

        with contextlib.suppress(Exception):  # no result within LISTEN_S, or a lost connection, which `run` handles
            wait(list(under_way), timeout=LISTEN_S, return_when="FIRST_COMPLETED")
        return [future for future in under_way if future.status != "pending"]

    def _outcome(self, trial: _Trial, future: Any) -> Evaluation | None:
        """Return the evaluation of a candidate, and write its policy and checkpoint.

        If the worker that stores the result does not send it in time, for example because it has died, return None.

        Raises:
            ExecutorError: the worker cannot evaluate candidates.
            ConnectionLost: the connection was lost before the worker sent the result.
            OSError: the policy or the checkpoint cannot be written.
        """
        from distributed import KilledWorker

        if future.status == "error":
            error = future.exception()
            if isinstance(error, KilledWorker):
                return Evaluation.failed(f"its worker process died {ATTEMPTS} times")
            if isinstance(error, dask_worker.UnfitWorker):
                raise ExecutorError(f"{self._address}: {error}")
            return Evaluation.failed(f"{type(error).__name__}: {error}")
        try:
            reply = self._connection.ask(future.result, REPLY_S)
        except (TimeoutError, KilledWorker):
            return None
        outcome, policy, checkpoint = dask_worker.decode(reply)
        # If the worker that stores a result dies, Dask repeats the evaluation, unless the result has been released.
        with contextlib.suppress(Exception):  # if the connection is lost, the scheduler releases both
            future.release()
            trial.counter.delete()
        if policy:
            write_whole(trial.job.policy_path, policy)
        if checkpoint and trial.job.rung is not None:
            write_whole(trial.job.rung.checkpoints[-1], checkpoint)
        return outcome

    def _report(self, progress: Progress | None) -> None:
        """Call `progress` with each report of progress that workers have sent."""
        with contextlib.suppress(Empty):
            while True:
                report = self._reports.get_nowait()
                if progress is not None:
                    progress(*report)

    def _withdraw(self, under_way: dict[Any, _Trial]) -> None:
        """Cancel unfinished jobs; a worker stops its evaluation at its next progress report."""
        with contextlib.suppress(Exception):  # an unreachable scheduler has no jobs to cancel
            self._connection.client.cancel(list(under_way), force=True)
