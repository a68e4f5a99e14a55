"""A scheduler without workers, one that ends, and one that never answers: each ends the wait after the patience."""

import asyncio
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
