"""Parts of the executors: connections to schedulers, waiting times and worker processes, with stand-ins."""

import asyncio
import logging
import math
import socket
import ssl
import threading
import time
from concurrent.futures import Future
from types import SimpleNamespace

import pytest

from evolve.config.checks import ConfigError
from evolve.search import scheduler as scheduler_module
from evolve.search.dask_connection import Connection
from evolve.search.job import ExecutorError
from evolve.search.scheduler import Scheduler, _silence_dask, close
from evolve.search.signs_of_life import SignsOfLife
from tests.evolve.search.test_dask_connection import Client, Times, connection

distributed = pytest.importorskip("distributed")

# --- connection


def test_a_reconnection_adds_the_time_of_an_attempt_at_most(monkeypatch):
    """An attempt takes up to 8 s, and the next one follows 0.5 s later. A longer time was a pause of this process."""
    times, new = Times(monkeypatch), Client("running")
    found = connection([Client("closed")], 1000.0)
    attempts = []

    def client(timeout):
        times.now += 100.0
        attempts.append(found.signs.silence_s)
        if len(attempts) == 1:
            raise ExecutorError("no")
        return new

    found.scheduler.client = client
    found.restore()
    assert attempts == [0.0, 8.5]


def test_a_check_adds_a_second_at_most(monkeypatch):
    times = Times(monkeypatch)
    found = connection([Client("running")], 100.0)
    found._start = lambda call: Future()
    for passed, silence in ((0.75, 0.75), (50.0, 1.75)):
        times.now += passed
        found.check()
        assert found.signs.silence_s == silence


def test_the_scheduler_is_asked_for_all_workers():
    asked = []
    client = Client("running")
    client.scheduler = SimpleNamespace(identity=lambda n_workers: asked.append(n_workers))
    found = connection([client])
    found._start = lambda call: call() or Future()
    found.check()
    assert asked == [-1]


def test_a_silence_of_workers_is_noted_once_although_the_scheduler_answers(monkeypatch):
    times, notes = Times(monkeypatch), []
    found = connection([Client("running")], 8.0)
    found.note, found._start = notes.append, lambda call: Future()
    for _ in range(8):
        times.now += 0.5
        found.check()
        if found._question is not None:
            found._question.set_result({"workers": {"a": {"last_seen": 1, "status": "running"}}})
        assert len(notes) == (found.signs.silence_s >= 2.0)
    assert notes == ["tcp://host:1: waiting for a heartbeat of worker a; without a sign of life the run ends after 8 s"]


def test_a_call_may_take_exactly_its_time_limit(monkeypatch):
    times = Times(monkeypatch)
    found, answer = connection([Client("running")]), Future()
    found._start = lambda call: answer

    def wait(futures, timeout):
        return SimpleNamespace(done=set())

    def check():
        times.now += 0.25
        if times.now == 1000.5:
            answer.set_result(7)
            monkeypatch.setattr("concurrent.futures.wait", lambda futures, timeout: SimpleNamespace(done={answer}))

    monkeypatch.setattr("concurrent.futures.wait", wait)
    found.check = check
    assert found.ask(None, timeout=0.5) == 7


def test_events_of_the_topic_reach_their_function():
    client, handlers, events = Client("running"), {}, []
    client.subscribe_topic = lambda topic, handler: handlers.update({topic: handler})
    scheduler = SimpleNamespace(address="tcp://host:1", client=lambda timeout: client)
    found = Connection(scheduler, 5.0, lambda note: None, "topic", events.append)
    handlers["topic"](("12:30", [7, 10, 40]))
    assert events == [[7, 10, 40]]
    assert found._asked == -math.inf


def test_a_closed_connection_has_no_question():
    found = connection([Client("running")])
    question = found._question = Future()
    found.close()
    assert question.cancelled()
    assert found._question is None
    assert found.client.closed
    found.close()


def test_calls_run_in_the_thread_of_the_client():
    loop, found = asyncio.new_event_loop(), connection([Client("running")])
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    found.client.loop = SimpleNamespace(asyncio_loop=loop)

    async def call():
        return threading.current_thread()

    assert found._start(call).result(20) is thread
    loop.call_soon_threadsafe(loop.stop)
    thread.join()
    loop.close()


# --- signs of life


def test_a_silence_as_long_as_the_patience_ends_it():
    found = SignsOfLife(10.0, 100.0)
    assert (found.silence_s, found.exhausted) == (0.0, False)
    found.answer({"a": {"last_seen": 1, "status": "running"}})
    found.wait(10.0)
    assert (found.exhausted, found.missing) == (True, "an answer of the scheduler")
    found.answer({"a": {"last_seen": 1, "status": "running"}, "b": {"last_seen": 1, "status": "running"}})
    assert (found.exhausted, found.lost_workers) == (False, ("a",))
    found.wait(10.0)
    found.answer({"b": {"last_seen": 1, "status": "running"}})
    assert (found.exhausted, found.lost_workers) == (True, ())
    assert found.missing == "a heartbeat of worker b"
    found.wait(10.0)
    assert found.missing == "an answer of the scheduler", "it is named first if both are equally late"


# --- scheduler


@pytest.mark.parametrize(("port", "valid"), [(0, False), (1, True), (65535, True), (65536, False)])
def test_ports(port, valid):
    if valid:
        Scheduler(f"tcp://host:{port}")
        return
    with pytest.raises(ConfigError, match="must be an address with a port"):
        Scheduler(f"tcp://host:{port}")


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (
            ssl.SSLError(1, "key values mismatch"),
            "key values mismatch",
        ),
        (OSError(13, "Permission denied"), "Permission denied"),
        (OSError("odd"), "odd"),
    ],
)
def test_the_reason_for_bad_certificates(monkeypatch, tmp_path, error, reason):
    def fail(cafile):
        raise error

    file = tmp_path / "file.pem"
    file.touch()
    monkeypatch.setattr(ssl, "create_default_context", fail)
    with pytest.raises(ConfigError) as caught:
        Scheduler("tls://host:1", file, file, file)
    assert str(caught.value).endswith(f"({reason})")
    error.reason = "short"
    with pytest.raises(ConfigError) as caught:
        Scheduler("tls://host:1", file, file, file)
    assert str(caught.value).endswith("(short)")


@pytest.mark.parametrize("answers_after", [0, 3, None])
def test_a_scheduler_is_called_for_five_seconds(monkeypatch, answers_after):
    """It is called every 0.25 s. After an answer, a client connects and is closed."""
    times, attempts, clients = Times(monkeypatch), [], []

    def connect(address, timeout):
        attempts.append((*address, timeout))
        if len(attempts) - 1 != answers_after:
            raise ConnectionRefusedError("refused")
        return SimpleNamespace(close=lambda: clients.append("socket closed"))

    monkeypatch.setattr(socket, "create_connection", connect)
    found = Scheduler("tcp://[::1]:8786")
    monkeypatch.setattr(Scheduler, "client", lambda self, timeout: clients.append(timeout) or Client("running"))
    monkeypatch.setattr(scheduler_module, "close", lambda client: clients.append(type(client)))
    if answers_after is None:
        with pytest.raises(ExecutorError, match=r"^no Dask scheduler answers at tcp://\[::1\]:8786: refused$"):
            found.require_answer()
        assert times.now == 1005.0
    else:
        found.require_answer()
        assert clients == ["socket closed", 5.0, Client]
        assert len(attempts) == answers_after + 1
    assert attempts == [("::1", 8786, max(0.25, 5 - k / 4)) for k in range(len(attempts))]


@pytest.mark.parametrize("error", [socket.gaierror(), UnicodeError()])
def test_an_unknown_host_is_called_once(monkeypatch, error):
    def fail(address, timeout):
        raise error

    Times(monkeypatch)
    monkeypatch.setattr(socket, "create_connection", fail)
    with pytest.raises(ExecutorError, match="there is no such host"):
        Scheduler("tcp://host:1").require_answer()
    assert time.monotonic() == 1000.0


def test_a_client_connects_in_a_thread_that_may_be_left_behind(monkeypatch):
    made, silenced = [], []

    def client(address, **options):
        made.append((address, options, threading.current_thread().daemon))
        time.sleep(0.1)
        return "client"

    monkeypatch.setattr(distributed, "Client", client)
    monkeypatch.setattr(scheduler_module, "_silence_dask", lambda: silenced.append(1))
    assert Scheduler("tcp://host:1").client(0.05) == "client", "Dask's time limit is a little shorter"
    assert made == [("tcp://host:1", {"timeout": 0.05, "security": None, "set_as_default": False}, True)]
    assert silenced == [1]


@pytest.mark.parametrize("error", [OSError("no\nroute"), ValueError("no\nroute"), KeyError("bug")])
def test_errors_of_a_client(monkeypatch, error):
    """An error that is no failed connection is passed on."""

    def fail(address, **options):
        raise error

    monkeypatch.setattr(distributed, "Client", fail)
    monkeypatch.setattr(scheduler_module, "_silence_dask", lambda: None)
    with pytest.raises(KeyError if isinstance(error, KeyError) else ExecutorError) as caught:
        Scheduler("tcp://host:1").client(5.0)
    if not isinstance(error, KeyError):
        assert str(caught.value) == "no Dask scheduler answers at tcp://host:1: no"


def test_reasons_of_failed_connections():
    closed = distributed.comm.core.CommClosedError("closed")
    plain, encrypted = Scheduler("tcp://host:1"), Scheduler("tls://host:1")
    assert plain._reason(closed).startswith("it closed the connection; if it uses TLS")
    assert encrypted._reason(closed).startswith("the TLS handshake failed")
    assert encrypted._reason(ValueError("no")).startswith("the TLS handshake failed")
    assert plain._reason(ValueError("no")) == "no"
    for found in (plain, encrypted):
        assert found._reason(OSError("no\nroute")) == "no"
        assert found._reason(TimeoutError()) == "TimeoutError"


def test_certificates_from_dasks_own_settings():
    import dask

    assert Scheduler("tcp://host:1").security() is None
    with dask.config.set({"distributed.comm.tls.ca-file": "ca.pem"}):
        assert Scheduler("tls://host:1").security() is None


def test_a_client_has_two_seconds_to_close():
    closed = []
    close(SimpleNamespace(close=lambda timeout: closed.append(timeout)))
    close(SimpleNamespace())
    assert closed == [2.0]


def test_logs_of_dask_are_silent_and_others_are_not():
    names = ("distributed.core", "tornado.application", "asyncio", "numpy.distributed")
    *silent, other = (logging.getLogger(name) for name in names)
    _silence_dask()
    assert {logger.getEffectiveLevel() for logger in silent} == {logging.CRITICAL + 1}
    assert other.level == logging.NOTSET
