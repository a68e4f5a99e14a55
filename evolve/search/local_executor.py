"""Executor with processes on this machine; each process evaluates one candidate at a time."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from types import TracebackType
from typing import Any

from evolve.search.job import ATTEMPTS, ExecutorError, Job, Progress
from evolve.search.worker import Message, work
from evolve.store.evaluation import Evaluation

__all__ = ["ExecutorError", "Job", "LocalExecutor", "Progress", "cores", "interrupts_held"]

# Several processes share the cores, so each process uses one thread. Numerical libraries read these environment
# variables when they are imported.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
STOPPING_S = 5.0  # [s] time after which a process that does not end is killed
KILLED = "by SIGKILL"  # how a killed process ended, as in `_remove`
OUT_OF_MEMORY = (
    f"the worker of candidate {{}} was killed {ATTEMPTS} times (SIGKILL), probably because memory ran out; use fewer "
    "workers (workers in config.toml), or free some memory, then use evolve resume"
)


@dataclass
class _Worker:
    """A worker process, the executor's end of the pipe to it, and its current job, which is None for an idle worker."""

    process: Any
    connection: Connection
    job: Job | None = None


@dataclass
class LocalExecutor:
    """Executor with worker processes on this machine. Each process evaluates one candidate at a time.

    The executor is a context manager, which ends its processes on exit. If `evaluate` raises an exception, the
    candidate counts as failed; the exceptions OSError, MemoryError and ConfigError end the run instead. A worker that
    dies is replaced, and its candidate is evaluated again, up to 3 times in total. After the last attempt, the
    candidate counts as failed. If SIGKILL ended every attempt, however, the run ends, because operating systems kill
    processes in this way when memory runs out.

    evaluate: function that is called as `evaluate(*job.arguments, progress=...)`
    count: number of workers; 0: one for each core that this process may use
    prepare: function that is called once in each new worker; an exception in it ends the run, because no worker could
        evaluate candidates

    Raises:
        ValueError: `count` is negative.
    """

    evaluate: Callable[..., Evaluation]
    count: int = 0
    prepare: Callable[[], None] | None = None
    _workers: list[_Worker] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.count < 0:
            raise ValueError(f"count = {self.count}: must be 0, one per core, or more")
        self.count = self.count or cores()

    def __enter__(self) -> LocalExecutor:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for worker in self._workers:
            worker.process.terminate()
        for worker in self._workers:
            _end(worker)
        self._workers.clear()

    def run(self, jobs: Iterable[Job], progress: Progress | None = None) -> Iterator[tuple[Job, Evaluation]]:
        """Evaluate all jobs, and yield each with its outcome as soon as it is complete.

        If `jobs` is a deque, the caller may append further jobs between results.

        progress: function that is called with (candidate id, steps trained, steps planned); None: no function

        Raises:
            ExecutorError: a worker cannot be prepared, the machine lacks resources such as disk space or memory, or the
                run's settings cannot be used.
        """
        waiting = jobs if isinstance(jobs, deque) else deque(jobs)
        deaths: dict[int, list[str]] = {}
        while waiting or any(worker.job for worker in self._workers):
            self._assign(waiting)
            for worker, message in self._messages():
                job = worker.job
                if message.kind == "progress" and job and progress:
                    progress(job.id, *message.content)
                elif message.kind == "unfit":
                    raise ExecutorError(message.content)
                elif message.kind == "done" and job:
                    worker.job = None
                    yield job, message.content
                elif message.kind == "died":
                    how = self._remove(worker)
                    if job is None:
                        continue
                    deaths.setdefault(job.id, []).append(how)
                    if len(deaths[job.id]) < ATTEMPTS:
                        waiting.appendleft(job)
                        continue
                    if set(deaths[job.id]) == {KILLED}:
                        raise ExecutorError(OUT_OF_MEMORY.format(job.id))
                    yield job, Evaluation.failed(f"its worker process died {ATTEMPTS} times, at last {how}")

    def _assign(self, waiting: deque[Job]) -> None:
        """Send waiting jobs to idle workers, and start further workers if needed, up to `count` workers."""
        idle = [worker for worker in self._workers if worker.job is None]
        while waiting and (idle or len(self._workers) < self.count):
            worker = idle.pop() if idle else self._hire()
            worker.job = waiting.popleft()
            try:
                worker.connection.send(worker.job.arguments)
            except (BrokenPipeError, ConnectionResetError):
                continue  # the process has died; `_messages` reports this next

    def _hire(self) -> _Worker:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=work, args=(theirs, self.evaluate, self.prepare), daemon=True)
        with _environment(ONE_THREAD), _without_main(), interrupts_held():
            process.start()
        theirs.close()
        self._workers.append(_Worker(process, ours))
        return self._workers[-1]

    def _messages(self) -> Iterator[tuple[_Worker, Message]]:
        """Wait until a worker sends a message or dies, and yield the messages that have arrived."""
        by_connection = {worker.connection: worker for worker in self._workers}
        for ready in wait(list(by_connection)):
            worker = by_connection[ready]  # type: ignore[index]
            try:
                yield worker, worker.connection.recv()
            except (EOFError, OSError):  # the pipe was closed, possibly within a message
                yield worker, Message("died")

    def _remove(self, worker: _Worker) -> str:
        """Remove a worker whose pipe is closed, and return how its process ended, such as "with exit code 1"."""
        self._workers.remove(worker)
        _end(worker)
        code = worker.process.exitcode
        return f"by {signal.Signals(-code).name}" if code is not None and code < 0 else f"with exit code {code}"


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _end(worker: _Worker) -> None:
    """Wait for a worker's process to end, or kill it after 5 s, and close the pipe."""
    worker.process.join(STOPPING_S)
    if worker.process.is_alive():
        worker.process.kill()
        worker.process.join()
    worker.connection.close()


@contextmanager
def _environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables for a child process within the context, and restore them afterwards."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def _without_main() -> Iterator[None]:
    """Prevent multiprocessing from executing the caller's script again in a child.

    Workers do not need the script. If the script starts a run, each worker would otherwise start another run.
    """
    main = sys.modules["__main__"]
    hidden: dict[str, Any] = {name: vars(main).pop(name) for name in ("__file__", "__spec__") if name in vars(main)}
    main.__spec__ = None
    try:
        yield
    finally:
        vars(main).update(hidden)


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Block Ctrl-C within the context. A child process inherits the block, so that only the parent receives Ctrl-C."""
    # With the first child, multiprocessing also starts its resource tracker, and unblocks interrupts after that. The
    # tracker is therefore started before the interrupts are blocked.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
