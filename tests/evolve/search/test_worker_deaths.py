"""Deaths of the workers of a local executor, with stand-ins for processes."""

import os
import signal
import sys
from collections import deque
from types import SimpleNamespace

import pytest

from evolve.search import local_executor
from evolve.search.job import ATTEMPTS
from evolve.search.local_executor import ExecutorError, LocalExecutor, _environment, _Worker, cores
from evolve.search.worker import Message
from evolve.store.evaluation import Evaluation


class Process:
    """A process that has ended with a code, or ends only if it is killed."""

    def __init__(self, exitcode=0, stubborn=False):
        self.exitcode, self.stubborn, self.calls = exitcode, stubborn, []

    def join(self, seconds=None):
        self.calls.append(("join", seconds))

    def is_alive(self):
        return self.stubborn and ("kill",) not in self.calls

    def kill(self):
        self.calls.append(("kill",))

    def terminate(self):
        self.calls.append(("terminate",))


class Pipe:
    """The executor's end of a pipe to a worker that answers each candidate with the next message."""

    def __init__(self, answers, broken=False):
        self.answers, self.broken, self.sent, self.closed = deque(answers), broken, [], False

    def send(self, arguments):
        if self.broken:
            raise BrokenPipeError
        self.sent.append(arguments)

    def close(self):
        self.closed = True


def executor_of(answers, codes=(0,) * 9, broken=()):
    """Return an executor whose workers die with these exit codes, and the list of hired workers.

    answers: messages in order
    """
    executor, hired = LocalExecutor(print, 1), []

    def hire():
        hired.append(_Worker(Process(codes[len(hired)]), Pipe((), len(hired) in broken)))
        executor._workers.append(hired[-1])
        return hired[-1]

    def messages():
        yield executor._workers[0], answers.pop(0)

    executor._hire, executor._messages = hire, messages
    return executor, hired


def job(number):
    return SimpleNamespace(id=number, arguments=(number,))


DONE, DIED = Message("done", Evaluation(1.0)), Message("died")


def test_a_candidate_whose_worker_dies_is_the_next_one(monkeypatch):
    executor, hired = executor_of([DIED, DONE, Message("progress", (1, 2)), DONE], (-11, 0))
    seen = []
    found = list(executor.run([job(0), job(1)], lambda *report: seen.append(report)))
    assert [one.id for one, _ in found] == [0, 1]
    assert seen == [(1, 1, 2)]
    assert [[*one.connection.sent] for one in hired] == [[(0,)], [(0,), (1,)]]
    assert hired[0].connection.closed
    assert executor._workers == hired[1:]


@pytest.mark.parametrize(
    ("codes", "how"),
    [((-9, -9, -11), "by SIGSEGV"), ((-9, -9, 5), "with exit code 5"), ((-9, -9, 0), "with exit code 0")],
)
def test_a_candidate_fails_after_the_last_attempt(codes, how):
    executor, hired = executor_of([DIED] * ATTEMPTS, codes)
    [(_, found)] = executor.run([job(0)])
    assert found.failure == f"its worker process died 3 times, at last {how}"
    assert len(hired) == ATTEMPTS


def test_attempts_count_by_candidate():
    executor, _ = executor_of([DIED, DIED, DONE, DIED, DIED, DONE], (-6,) * 9)
    assert [outcome for _, outcome in executor.run([job(0), job(1)])] == [DONE.content] * 2


def test_memory_is_the_reason_if_every_worker_was_killed():
    executor, _ = executor_of([DIED] * ATTEMPTS, (-9,) * 3)
    with pytest.raises(ExecutorError, match=r"^the worker of candidate 4 was killed 3 times \(SIGKILL\), probably"):
        list(executor.run([job(4)]))


def test_a_worker_that_dies_before_it_receives_a_candidate():
    executor, hired = executor_of([DIED, DONE], (1, 0), broken=(0,))
    assert [outcome for _, outcome in executor.run([job(0)])] == [DONE.content]
    assert (hired[0].connection.sent, hired[1].connection.sent) == ([], [(0,)])


def test_the_death_of_an_idle_worker_is_no_failure():
    """The idle worker is the first one, and the second one evaluates the candidate."""
    executor, _ = executor_of([DIED, DONE])
    idle, busy = executor._hire(), executor._hire()
    busy.job = job(0)
    assert [(one.id, outcome) for one, outcome in executor.run([])] == [(0, DONE.content)]
    assert idle.connection.closed
    assert executor._workers == [busy]
    assert busy.job is None


def test_unfit_workers_end_the_run():
    executor, _ = executor_of([Message("unfit", "its disk is full")])
    with pytest.raises(ExecutorError, match=r"^its disk is full$"):
        list(executor.run([job(0)]))


@pytest.mark.parametrize("stubborn", [False, True])
def test_workers_that_do_not_end_are_killed(stubborn):
    executor, workers = LocalExecutor(print, 1), [_Worker(Process(stubborn=stubborn), Pipe(())) for _ in range(2)]
    with executor:
        executor._workers += workers
    for one in workers:
        last = [("kill",), ("join", None)] if stubborn else []
        assert one.process.calls == [("terminate",), ("join", local_executor.STOPPING_S), *last]
        assert one.connection.closed
    assert executor._workers == []


def test_variables_are_restored(monkeypatch):
    monkeypatch.setenv("HERE", "before")
    with _environment({"HERE": "1", "THERE": "2"}):
        assert (os.environ["HERE"], os.environ["THERE"]) == ("1", "2")
    assert os.environ["HERE"] == "before"
    assert "THERE" not in os.environ


def test_cores(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0: {0, 4, 6}}[process], raising=False)
    assert cores() == 3
    assert LocalExecutor(print, 0).count == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert cores() == 1


def test_a_child_does_not_see_the_script_of_its_parent(monkeypatch):
    """Without a file and a specification of the main module, multiprocessing does not execute it again."""
    main = SimpleNamespace(__file__="script.py", __spec__="specification", other=1)
    monkeypatch.setitem(sys.modules, "__main__", main)
    with local_executor._without_main():
        assert vars(main) == {"__spec__": None, "other": 1}
    assert vars(main) == {"__file__": "script.py", "__spec__": "specification", "other": 1}
    del main.__file__
    with local_executor._without_main():
        assert vars(main) == {"__spec__": None, "other": 1}
    assert vars(main) == {"__spec__": "specification", "other": 1}


def test_interrupts_are_held_only_meanwhile():
    def blocked():
        return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])

    assert not blocked()
    with local_executor.interrupts_held():
        assert blocked()
    assert not blocked()


def test_a_new_worker_is_a_daemon_with_one_thread(monkeypatch):
    """The executor closes its copy of the worker's end of the pipe, so that it notices the worker's death."""
    events = []

    def process(**options):
        events.append(options)
        return SimpleNamespace(start=lambda: events.append(os.environ["OMP_NUM_THREADS"]))

    ends = [SimpleNamespace(close=lambda k=k: events.append(f"closed {k}")) for k in (0, 1)]
    context = SimpleNamespace(Pipe=lambda: ends, Process=process)
    monkeypatch.setattr(local_executor.multiprocessing, "get_context", lambda name: {"spawn": context}[name])
    executor = LocalExecutor(print, 2, "prepare")
    executor._workers.append("another")
    found = executor._hire()
    assert executor._workers == ["another", found]
    assert found.connection is ends[0]
    assert events == [
        {"target": local_executor.work, "args": (ends[1], print, "prepare"), "daemon": True},
        "1",
        "closed 1",
    ]


def test_one_worker_for_each_core_by_default(monkeypatch):
    monkeypatch.setattr(local_executor, "cores", lambda: 5)
    assert LocalExecutor(print).count == 5
    assert LocalExecutor(print, 3).count == 3
