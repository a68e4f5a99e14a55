"""Executor that evaluates candidates on a Dask cluster, for example under SLURM or Kubernetes (docs/cluster.md)."""

from __future__ import annotations

import contextlib
import time
import uuid
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any

from evolve.config.assemble import to_toml
from evolve.search import dask_worker
from evolve.search.job import ATTEMPTS, ExecutorError, Job, Progress
from evolve.search.scheduler import Scheduler
from evolve.store.atomic_files import write_whole
from evolve.store.evaluation import Evaluation

__all__ = ["DaskExecutor"]

CONNECT_S = 8.0
LISTEN_S = 0.5  # interval between progress updates
REPLY_S = 10.0  # time limit for a worker to send its result


@dataclass(frozen=True)
class _Trial:
    """A submitted job.

    counter: the scheduler's variable that counts the attempts
    """

    job: Job
    counter: Any
    order: dask_worker.Order


@dataclass
class DaskExecutor:
    """Workers of a Dask scheduler. Each worker evaluates one candidate at a time.

    The executor is a context manager. A candidate whose worker dies is evaluated again, up to `ATTEMPTS` times in
    total. If the connection to the scheduler was lost, all unfinished jobs are submitted again after reconnecting.

    scheduler: the scheduler, or its address
    function: "module:name" of the function that evaluates a candidate; it takes the arguments of
        `evolve.learning.fitness.evaluate`
    patience_s: maximum time to wait for the first worker, and for an unreachable scheduler [s]
    count: number of workers at the start

    Raises:
        ExecutorError: Dask is not installed, the scheduler does not answer, or no worker can evaluate candidates.
    """

    scheduler: Scheduler | str
    function: str = "evolve.search.worker:evaluate_candidate"
    patience_s: float = 600.0
    count: int = 0
    _name: str = field(default_factory=lambda: f"rhabdom-{uuid.uuid4().hex[:12]}")
    _client: Any = None
    _told: SimpleQueue[list[int]] = field(default_factory=SimpleQueue)

    def __post_init__(self) -> None:
        if isinstance(self.scheduler, str):
            self.scheduler = Scheduler(self.scheduler)
        self._scheduler, self._address = self.scheduler, self.scheduler.address

    def __enter__(self) -> DaskExecutor:
        self._client = self._connected(min(CONNECT_S, self.patience_s))
        try:
            self._client.wait_for_workers(1, timeout=self.patience_s)
        except TimeoutError:
            self._client.close()
            raise ExecutorError(f"{self._address}: no worker has connected within {self.patience_s:g} s") from None
        self.count = len(self._client.scheduler_info(n_workers=-1)["workers"])
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with contextlib.suppress(Exception):  # closing fails if the connection is already lost
            self._client.close()

    def run(self, jobs: Iterable[Job], progress: Progress | None = None) -> Iterator[tuple[Job, Evaluation]]:
        """Evaluate all jobs, and yield each with its outcome as soon as it is complete.

        If `jobs` is a deque, the caller may append further jobs between results.

        Raises:
            ExecutorError: no worker can evaluate candidates, a worker's machine lacks resources such as disk space, the
                run's settings cannot be used there, or the scheduler remains unreachable.
        """
        waiting = jobs if isinstance(jobs, deque) else deque(jobs)
        under_way: dict[Any, _Trial] = {}
        try:
            while waiting or under_way:
                if self._client.status != "running":
                    self._reconnect()
                    waiting.extendleft(trial.job for trial in reversed(under_way.values()))
                    under_way.clear()
                while waiting:
                    trial = self._trial(waiting.popleft())
                    under_way[self._submit(trial)] = trial
                for future in self._done(under_way):
                    trial = under_way.pop(future)
                    if future.status in ("cancelled", "lost"):
                        waiting.append(trial.job)
                    elif self._died_too_few_times(trial, future):
                        under_way[self._submit(trial)] = trial
                    elif (outcome := self._outcome(trial, future)) is not None:
                        yield trial.job, outcome
                    else:
                        under_way[future] = trial
                self._tell(progress)
        finally:
            self._withdraw(under_way)

    def _trial(self, job: Job) -> _Trial:
        """Return a job with a new counter of its attempts.

        The scheduler stores the counter, because a worker that is killed cannot report the attempt.
        """
        from distributed import Variable

        name = f"{self._name}-{job.id}-{uuid.uuid4().hex[:6]}"
        counter = Variable(name, client=self._client)
        counter.set(0)
        return _Trial(job, counter, dask_worker.encode(job, to_toml(job.config), self.function, name, self._name))

    def _submit(self, trial: _Trial) -> Any:
        key = f"{trial.order.counter}-{uuid.uuid4().hex[:6]}"
        return self._client.submit(dask_worker.evaluate, trial.order, key=key, pure=False, retries=0)

    def _died_too_few_times(self, trial: _Trial, future: Any) -> bool:
        """Return whether the scheduler gave up a job because its workers died, although attempts remain."""
        from distributed import KilledWorker

        killed = future.status == "error" and isinstance(future.exception(), KilledWorker)
        return killed and int(trial.counter.get()) < ATTEMPTS

    def _done(self, under_way: dict[Any, _Trial]) -> list[Any]:
        """Wait up to LISTEN_S for a first result, and return all futures that are no longer pending."""
        from distributed import wait

        with contextlib.suppress(Exception):  # no result within LISTEN_S, or a lost connection, which `run` handles
            wait(list(under_way), timeout=LISTEN_S, return_when="FIRST_COMPLETED")
        return [future for future in under_way if future.status != "pending"]

    def _outcome(self, trial: _Trial, future: Any) -> Evaluation | None:
        """Return the evaluation of a candidate, and write its policy and checkpoint.

        The result is None if the worker that stores it does not send it in time, for example because it has died.
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
            outcome, policy, checkpoint = dask_worker.decode(future.result(timeout=REPLY_S))
        except TimeoutError:
            return None
        # If the worker that stores a result dies, Dask repeats the evaluation, unless the result has been released.
        future.release()
        trial.counter.delete()
        if policy:
            write_whole(trial.job.policy_path, policy)
        if checkpoint and trial.job.rung is not None:
            write_whole(trial.job.rung.checkpoints[-1], checkpoint)
        return outcome

    def _tell(self, progress: Progress | None) -> None:
        with contextlib.suppress(Empty):
            while True:
                report = self._told.get_nowait()
                if progress is not None:
                    progress(*report)

    def _connected(self, timeout: float) -> Any:
        security = self._scheduler.security()
        from distributed import Client

        try:
            client = Client(self._address, timeout=timeout, security=security, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            reason = (str(error) or type(error).__name__).splitlines()[0]
            raise ExecutorError(f"no Dask scheduler answers at {self._address}: {reason}") from None
        client.subscribe_topic(self._name, lambda event: self._told.put(event[1]))
        return client

    def _reconnect(self) -> None:
        """Wait until the scheduler can be reached again, for at most `patience_s`."""
        deadline = time.monotonic() + self.patience_s
        while self._client.status != "running":
            if self._client.status == "connecting":  # Dask's client is already trying to reconnect
                time.sleep(LISTEN_S)
            else:
                try:
                    self._client = self._connected(min(CONNECT_S, self.patience_s))
                except ExecutorError:
                    time.sleep(LISTEN_S)
            if time.monotonic() > deadline:
                raise ExecutorError(f"{self._address}: the scheduler has been unreachable for {self.patience_s:g} s")

    def _withdraw(self, under_way: dict[Any, _Trial]) -> None:
        """Cancel unfinished jobs; a worker stops its evaluation at its next progress report."""
        with contextlib.suppress(Exception):  # an unreachable scheduler has no jobs to cancel
            self._client.cancel(list(under_way), force=True)
