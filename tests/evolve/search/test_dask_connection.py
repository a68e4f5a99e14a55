"""A scheduler without workers, one that ends, and one that never answers: each ends the wait after the patience."""

import asyncio
import itertools
import socket
import time
from concurrent.futures import Future
from types import SimpleNamespace

import pytest

from evolve.search.dask_connection import Connection, ConnectionLost
from evolve.search.dask_executor import DaskExecutor
from evolve.search.job import ExecutorError
from tests.evolve.search.test_local_executor import jobs
from tests.evolve.search.test_scheduler import without_workers

pytest.importorskip("distributed")


@pytest.fixture
def cluster():
    """Return a scheduler in this process, without workers."""
    with without_workers("tcp") as cluster:
        yield cluster


class Client:
    """Stand-in for a Dask client in a given state."""

    def __init__(self, status):
        self.status, self.closed = status, False
        self.subscribe_topic = lambda topic, handler: None

    def close(self, timeout):
        self.closed = True


def connection(clients, patience_s=5.0):
    """Return a connection whose clients come from a list; after its end, the scheduler does not answer."""

    def client(timeout):
        if not clients:
            raise ExecutorError("no answer")
        return clients.pop(0)

    scheduler = SimpleNamespace(address="tcp://host:1", client=client)
    return Connection(scheduler, patience_s, lambda note: None, "topic", lambda event: None)


def test_a_cluster_without_workers_ends_the_wait_with_one_line(cluster, capfd):
    notes = []
    executor = DaskExecutor(cluster.scheduler_address, patience_s=1.0, note=notes.append)
    with pytest.raises(ExecutorError, match=r"waited 1 s for a worker \(none is connected\).*evolve resume") as caught:
        executor.__enter__()
    assert "\n" not in str(caught.value)
    assert len(notes) == 1
    assert "waiting for a worker (none is connected); without a sign of life the run ends after 1 s" in notes[0]
    assert capfd.readouterr().err == ""


def test_a_scheduler_that_ends_for_good_ends_the_wait_with_one_line(cluster, capfd, monkeypatch, tmp_path):
    monkeypatch.setattr("evolve.search.dask_connection.CONNECT_S", 0.5)
    executor, notes = DaskExecutor(cluster.scheduler_address, patience_s=1.5), []
    executor._connection = Connection(executor._scheduler, 1.5, notes.append, "topic", lambda event: None)
    running = executor.run(jobs(tmp_path, 2))
    cluster.close()
    with pytest.raises(ExecutorError, match=r"waited 1\.5 s for an answer of the scheduler"):
        next(running)
    executor._connection.close()
    assert ["waiting for an answer of the scheduler" in note for note in notes] == [True]
    assert capfd.readouterr().err == ""


def test_a_scheduler_that_never_answers_is_given_up():
    """The system accepts connections to a stopped process, and Dask has no time limit for the first message."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(ExecutorError, match=r"no Dask scheduler answers at .*: no answer within 0\.5 s"):
            DaskExecutor(address, patience_s=0.5).__enter__()


@pytest.mark.parametrize("status", ["connecting", "closing", "closed", "newly-created"])
def test_a_client_that_is_not_running_is_replaced(status):
    """A client that reconnects gives up after seconds, and its futures are cancelled, so it is not waited for."""
    former, new = Client(status), Client("running")
    found = connection([former, new])
    assert found.lost
    found.restore()
    assert found.client is new
    assert former.closed
    assert not found.lost
    assert not new.closed


def test_the_time_in_which_this_process_is_stopped_does_not_count(monkeypatch):
    """After Ctrl-Z and `fg`, the answers of the scheduler have not been read yet."""
    now = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now)
    found = connection([Client("running")], patience_s=100.0)
    found._question = Future()
    now += 1e6
    found.check()
    assert 0 < found.signs.silence_s < 10


def test_a_call_on_a_lost_connection_does_not_wait(cluster):
    executor = DaskExecutor(cluster.scheduler_address, patience_s=30.0)
    found = Connection(executor._scheduler, 30.0, lambda note: None, "topic", lambda event: None)
    counter = found.client.scheduler
    cluster.close()
    with pytest.raises(ConnectionLost):
        found.ask(lambda: counter.identity())
    found.close()


def test_silent_workers_are_removed_from_the_scheduler_once():
    client, removed, notes = Client("running"), [], []

    async def unregister(address, stimulus_id):
        removed.append((address, stimulus_id))

    client.scheduler = SimpleNamespace(unregister=unregister)
    found = connection([client])
    found.note, found.ask = notes.append, lambda call: asyncio.run(call())
    silent = ["tcp://a:1", "tcp://b:2"]
    found.signs = SimpleNamespace(lost_workers=tuple(silent), forget=silent.remove)
    found.remove_lost_workers()
    assert removed == [("tcp://a:1", "topic"), ("tcp://b:2", "topic")]
    assert silent == []
    assert notes[0].startswith("tcp://host:1: worker tcp://a:1 has given no sign of life for 5 s; its candidates are")
    assert len(notes) == 2


class Times:
    """A clock that advances only while somebody sleeps or waits."""

    def __init__(self, monkeypatch):
        self.now, self.slept = 1000.0, []
        monkeypatch.setattr(time, "monotonic", lambda: self.now)
        monkeypatch.setattr(time, "sleep", self.sleep)

    def sleep(self, seconds):
        self.slept.append(seconds)
        self.now += seconds


@pytest.mark.parametrize(("patience_s", "interval_s"), [(600.0, 5.0), (50.0, 5.0), (20.0, 2.0), (2.5, 0.25)])
def test_workers_are_listed_at_regular_intervals(monkeypatch, patience_s, interval_s):
    times, asked = Times(monkeypatch), []
    found = connection([Client("running")], patience_s)
    found._start = lambda call: asked.append(times.now) or Future()
    assert found.signs.regular_s == 2 * interval_s + 0.5
    for _ in range(40):
        found.check()
        found._question = None
        times.now += interval_s / 4
    steps = {round(after - before, 6) for before, after in itertools.pairwise(asked)}
    assert asked[0] == 1000.0, "the first question is not delayed"
    assert steps == {interval_s}


@pytest.mark.parametrize("state", ["answered", "failed", "cancelled", "open"])
def test_only_answers_are_signs_of_life(monkeypatch, state):
    times, answers = Times(monkeypatch), []
    found = connection([Client("running")])
    found.signs.answer = answers.append
    found._asked = times.now
    question = found._question = Future()
    if state == "answered":
        question.set_result({"workers": {"a": "worker"}})
    elif state == "failed":
        question.set_exception(OSError())
    elif state == "cancelled":
        question.cancel()
    found.check()
    assert answers == ([{"a": "worker"}] if state == "answered" else [])
    assert (found._question is question) == (state == "open")


def test_nothing_is_asked_on_a_lost_connection(monkeypatch):
    times = Times(monkeypatch)
    client = Client("running")
    found = connection([client])
    found._start = lambda call: pytest.fail("a question on a lost connection")
    client.status = "closed"
    times.now += 100
    found.check()


@pytest.mark.parametrize(("patience_s", "noted_s"), [(8.0, 2.0), (40.0, 10.0), (600.0, 10.0)])
def test_a_silence_is_noted_once_and_ends_with_the_patience(monkeypatch, patience_s, noted_s):
    times, notes, began = Times(monkeypatch), [], 1000.0
    found = connection([Client("running")], patience_s)
    found.note = lambda note: notes.append((times.now - began, note))
    found._start = lambda call: Future()

    def wait():
        while True:
            times.now += 0.25
            found.check()

    with pytest.raises(ExecutorError, match=rf"^tcp://host:1: waited {patience_s:g} s for an answer of the scheduler"):
        wait()
    assert times.now - began == patience_s
    [(after, note)] = notes
    assert after == noted_s
    assert note == (
        "tcp://host:1: waiting for an answer of the scheduler; without a sign of life the run ends after "
        f"{patience_s:g} s"
    )


def test_a_later_silence_is_noted_again(monkeypatch):
    times, notes = Times(monkeypatch), []
    found = connection([Client("running")], 40.0)
    found.note, found._start = notes.append, lambda call: Future()
    for seconds, expected in ((9.0, 0), (2.0, 1), (5.0, 1)):
        for _ in range(int(2 * seconds)):
            times.now += 0.5
            found.check()
        assert len(notes) == expected
    found._question.set_result({"workers": {"a": {"last_seen": 1, "status": "running"}}})
    found.check()
    assert found.signs.silence_s == 0
    for _ in range(21):
        times.now += 0.5
        found.check()
    assert len(notes) == 2


def test_a_reconnection_is_tried_until_the_scheduler_answers(monkeypatch):
    times, new = Times(monkeypatch), Client("running")
    found = connection([Client("closed")], 100.0)
    answers = [ExecutorError("no"), ExecutorError("no"), new]

    def client(timeout):
        assert timeout == 8.0
        if isinstance(answer := answers.pop(0), ExecutorError):
            raise answer
        return answer

    found.scheduler.client = client
    found._asked = times.now
    found.restore()
    assert found.client is new
    assert times.slept == [0.5, 0.5]
    assert found._asked < 0, "workers are listed at once after a reconnection"


def test_workers_are_awaited(monkeypatch):
    times, calls = Times(monkeypatch), []
    found = connection([Client("running")], 100.0)
    found.check = lambda: calls.append("check")
    found.restore = lambda: calls.append("restore")
    numbers = iter([0, 0, 2])

    class Signs:
        usable = property(lambda self: next(numbers))

    found.signs = Signs()
    found.client.status = "closed"
    found.require_worker()
    assert calls == ["check", "restore"] * 2
    assert times.slept == [0.05, 0.05]


@pytest.mark.parametrize("state", ["answers", "lost", "slow", "raises"])
def test_a_call_ends_with_its_answer_the_connection_or_its_time_limit(monkeypatch, state):
    found, answer, checks = connection([Client("running")]), Future(), []
    found._start = lambda call: answer

    def wait(futures, timeout):
        assert (futures, timeout) == ([answer], 0.5)
        if len(checks) == 2 and state in ("answers", "raises"):
            answer.set_result(7) if state == "answers" else answer.set_exception(OSError())
        return SimpleNamespace(done={answer} if answer.done() else set())

    def check():
        checks.append(1)
        if state == "lost" and len(checks) == 2:
            found.client.status = "closed"

    monkeypatch.setattr("concurrent.futures.wait", wait)
    found.check = check
    if state == "answers":
        assert found.ask(None) == 7
    else:
        with pytest.raises(TimeoutError if state == "slow" else ConnectionLost):
            found.ask(None, timeout=-1.0 if state == "slow" else 60.0)
    assert len(checks) == (1 if state == "slow" else 2)
    assert answer.done(), "a call without an answer is cancelled"
