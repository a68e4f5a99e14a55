"""Executors: who evaluates candidates. Here: processes on this machine, one candidate each at a time."""

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

# Several processes share the cores, so each keeps to one thread; read when the numerical libraries are loaded.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
STOPPING_S = 5.0
KILLED = "by SIGKILL"
OUT_OF_MEMORY = (
    f"the worker of candidate {{}} was killed {ATTEMPTS} times (SIGKILL), as systems do that run out of memory; take "
    "fewer workers (workers in config.toml), or free some, and go on with evolve resume"
)


@dataclass
class _Worker:
    """A process, our end of its pipe, and what it is doing."""

    process: Any
    connection: Connection
    job: Job | None = None


@dataclass
class LocalExecutor:
    """Worker processes that call `evaluate(*job.arguments, progress=...)`; a context manager that ends them.

    count: workers; 0: one per core that this process may use
    prepare: called once in each new worker; an exception there ends the run, because no candidate could be evaluated

    An exception in `evaluate` is that candidate's failure, but an OSError or a ConfigError, which end the run. A worker
    that dies takes nobody with it: it is replaced and its candidate evaluated again, `ATTEMPTS` times in all. Only what
    the animal may have caused is then its failure: a worker that is killed each time, as the system does for want of
    memory, ends the run.
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
        """Evaluate all jobs; each comes out as soon as it is done, in any order. A deque may be added to meanwhile.

        Raises:
            ExecutorError: a worker could not be made ready, the machine refuses something, such as a file or
                memory, or the run's settings cannot be used.
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
        """Give jobs to idle workers, hiring as many as there is work and room for."""
        idle = [worker for worker in self._workers if worker.job is None]
        while waiting and (idle or len(self._workers) < self.count):
            worker = idle.pop() if idle else self._hire()
            worker.job = waiting.popleft()
            try:
                worker.connection.send(worker.job.arguments)
            except (BrokenPipeError, ConnectionResetError):
                continue  # it has died; its pipe says so next time we listen

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
        """What workers have to say; blocks until one says something or dies."""
        by_connection = {worker.connection: worker for worker in self._workers}
        for ready in wait(list(by_connection)):
            worker = by_connection[ready]  # type: ignore[index]
            try:
                yield worker, worker.connection.recv()
            except (EOFError, OSError):  # a pipe that closed, be it within a message
                yield worker, Message("died")

    def _bury(self, worker: _Worker) -> str:
        """Forget a worker whose pipe is closed; says how it died."""
        self._workers.remove(worker)
        _end(worker)
        code = worker.process.exitcode
        return f"by {signal.Signals(-code).name}" if code is not None and code < 0 else f"with exit code {code}"


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _end(worker: _Worker) -> None:
    """Wait for a process that should be ending, and make sure of it."""
    worker.process.join(STOPPING_S)
    if worker.process.is_alive():
        worker.process.kill()
        worker.process.join()
    worker.connection.close()


@contextmanager
def _environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Environment in which a child starts; ours is put back after."""
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
    """Let a child not run the caller's script again, as multiprocessing has it: workers need nothing from there, and a
    script that begins a run would begin another one in each of them."""
    main = sys.modules["__main__"]
    hidden: dict[str, Any] = {name: vars(main).pop(name) for name in ("__file__", "__spec__") if name in vars(main)}
    main.__spec__ = None
    try:
        yield
    finally:
        vars(main).update(hidden)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Hold back Ctrl-C meanwhile; a child inherits that for life, so Ctrl-C on a terminal is for the parent alone."""
    # multiprocessing's own helper, which comes with the first child, would let interrupts through again before it.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
