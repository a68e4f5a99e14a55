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

__all__ = ["ExecutorError", "Job", "LocalExecutor", "Progress", "cores"]

# Several processes share the cores, so each uses one thread; numerical libraries read these variables on import.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
STOPPING_S = 5.0
KILLED = "by SIGKILL"
OUT_OF_MEMORY = (
    f"the worker of candidate {{}} was killed {ATTEMPTS} times (SIGKILL), probably because memory ran out; use fewer "
    "workers (workers in config.toml), or free some memory, then use evolve resume"
)


@dataclass
class _Worker:
    """A process, this end of its pipe, and its current job."""

    process: Any
    connection: Connection
    job: Job | None = None


@dataclass
class LocalExecutor:
    """Worker processes that call `evaluate(*job.arguments, progress=...)`; a context manager that ends them.

    An exception in `evaluate` counts as a failure of the candidate, except OSError and ConfigError, which end the run.
    A worker that dies is replaced, and its candidate is evaluated again, up to `ATTEMPTS` times in total. The candidate
    then counts as failed, unless each worker was killed (SIGKILL). Systems do that when memory runs out, and it ends
    the run.

    count: number of workers; 0: one per core that this process may use
    prepare: called once in each new worker; an exception there ends the run, because no candidate could be evaluated
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
        """Evaluate all jobs and yield each as soon as it is complete, in any order.

        A deque of jobs may be extended meanwhile.

        Raises:
            ExecutorError: a worker cannot be prepared, the machine lacks resources such as disk space or memory, or the
                run's settings cannot be used.
        """
        waiting = jobs if isinstance(jobs, deque) else deque(jobs)
        deaths: dict[int, list[str]] = {}
        while waiting or any(worker.job for worker in self._workers):
            self._hand_out(waiting)
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
                    how = self._bury(worker)
                    if job is None:
                        continue
                    deaths.setdefault(job.id, []).append(how)
                    if len(deaths[job.id]) < ATTEMPTS:
                        waiting.appendleft(job)
                        continue
                    if set(deaths[job.id]) == {KILLED}:
                        raise ExecutorError(OUT_OF_MEMORY.format(job.id))
                    yield job, Evaluation.failed(f"its worker process died {ATTEMPTS} times, at last {how}")

    def _hand_out(self, waiting: deque[Job]) -> None:
        """Give jobs to idle workers, and start further workers up to `count` if needed."""
        idle = [worker for worker in self._workers if worker.job is None]
        while waiting and (idle or len(self._workers) < self.count):
            worker = idle.pop() if idle else self._hire()
            worker.job = waiting.popleft()
            try:
                worker.connection.send(worker.job.arguments)
            except (BrokenPipeError, ConnectionResetError):
                continue  # the process has died, which `_messages` will report

    def _hire(self) -> _Worker:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=work, args=(theirs, self.evaluate, self.prepare), daemon=True)
        with _environment(ONE_THREAD), _without_main(), _interrupts_held():
            process.start()
        theirs.close()
        self._workers.append(_Worker(process, ours))
        return self._workers[-1]

    def _messages(self) -> Iterator[tuple[_Worker, Message]]:
        """Yield the messages of workers; wait until one sends a message or dies."""
        by_connection = {worker.connection: worker for worker in self._workers}
        for ready in wait(list(by_connection)):
            worker = by_connection[ready]  # type: ignore[index]
            try:
                yield worker, worker.connection.recv()
            except (EOFError, OSError):  # the pipe was closed, possibly within a message
                yield worker, Message("died")

    def _bury(self, worker: _Worker) -> str:
        """Remove a worker whose pipe is closed, and return the cause of its death."""
        self._workers.remove(worker)
        _end(worker)
        code = worker.process.exitcode
        return f"by {signal.Signals(-code).name}" if code is not None and code < 0 else f"with exit code {code}"


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _end(worker: _Worker) -> None:
    """Wait for a process to end, and kill it if it does not."""
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

    Workers do not need the script, and a script that starts a run would start another run in each of them.
    """
    main = sys.modules["__main__"]
    hidden: dict[str, Any] = {name: vars(main).pop(name) for name in ("__file__", "__spec__") if name in vars(main)}
    main.__spec__ = None
    try:
        yield
    finally:
        vars(main).update(hidden)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Block Ctrl-C within the context; a child inherits the block, so that only the parent receives Ctrl-C."""
    # multiprocessing starts its own helper with the first child, and would then unblock interrupts too early.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
