"""Runs of the Dask executor, with a stand-in for the cluster."""

from collections import deque
from types import SimpleNamespace

import pytest

from evolve.search import dask_executor, dask_worker
from evolve.search.dask_connection import ConnectionLost
from evolve.search.dask_executor import DaskExecutor, _Trial
from evolve.search.job import ExecutorError, Job
from evolve.search.scheduler import Scheduler
from tests.evolve.closed_form import tiny
from tests.evolve.small_run import PHENOTYPE

distributed = pytest.importorskip("distributed")


class Variable:
    """A variable of the scheduler."""

    def __init__(self, name, client):
        self.name, self.client = name, client

    def get(self, timeout):
        return self.values[self.name]

    def set(self, value):
        self.values[self.name] = value


@pytest.fixture(autouse=True)
def variables(monkeypatch):
    monkeypatch.setattr(Variable, "values", {}, raising=False)
    monkeypatch.setattr(distributed, "Variable", Variable)
    monkeypatch.setattr(dask_worker, "_software", dict)
    return Variable.values


class Connection:
    """A connection in a given state, which records what happens to it."""

    def __init__(self, lost=False, client=None):
        self.lost, self.client, self.calls = lost, client, []
        self.signs = SimpleNamespace(usable=3)

    def restore(self):
        self.lost = False
        self.calls.append("restore")

    def close(self):
        self.calls.append("close")

    def check(self):
        self.calls.append("check")

    def remove_lost_workers(self):
        self.calls.append("remove")

    def require_worker(self):
        self.calls.append("require")

    def ask(self, call, timeout=None):
        return call()


def job(number, folder):
    return Job(number, PHENOTYPE, tiny(), 5 + number, folder / str(number))


def executor_of(connection):
    executor = DaskExecutor("tcp://host:1")
    executor._connection = connection
    return executor


def test_defaults_and_addresses():
    for given in ("tcp://host:1", Scheduler("tcp://host:1")):
        executor = DaskExecutor(given)
        assert executor.scheduler == Scheduler("tcp://host:1")
        assert (executor._address, executor.patience_s, executor.count) == ("tcp://host:1", 600.0, 0)
    assert executor.function == "evolve.search.worker:evaluate_candidate"
    assert executor.note("note") is None


@pytest.mark.parametrize("fails", [False, True])
def test_the_connection_is_closed_at_the_end(monkeypatch, fails):
    made = Connection()

    def connect(*given):
        made.given = given
        return made

    def fail():
        raise ExecutorError("no worker")

    monkeypatch.setattr(dask_executor, "Connection", connect)
    executor = DaskExecutor("tcp://host:1", patience_s=7.0)
    if fails:
        made.require_worker = fail
        with pytest.raises(ExecutorError, match="no worker"):
            executor.__enter__()
        assert made.calls == ["close"]
        return
    with executor as entered:
        assert entered is executor
        assert executor.count == 3
        assert made.given[:2] == (executor.scheduler, 7.0)
        made.given[4]([1, 2, 3])
        assert executor._reports.get_nowait() == [1, 2, 3], "events are reports"
    assert made.calls == ["require", "close"]


def test_a_job_is_submitted_with_its_counter(tmp_path, variables):
    submitted = []
    client = SimpleNamespace(submit=lambda *given, **options: submitted.append((given, options)) or "future")
    executor = executor_of(Connection(client=client))
    first, second = (executor._trial(job(4, tmp_path)) for _ in range(2))
    assert first.order.counter != second.order.counter, "attempts of different trials are counted apart"
    assert first.order.counter.startswith(f"{executor._name}-4-")
    assert (first.order.id, first.order.seed, first.order.topic) == (4, 9, executor._name)
    assert first.order.function == executor.function
    assert variables == {first.order.counter: 0, second.order.counter: 0}
    assert first.counter.client is client
    assert [executor._submit(first), executor._submit(first)] == ["future"] * 2
    (given, options), (_, again) = submitted
    assert given == (dask_worker.evaluate, first.order)
    assert (options["pure"], options["retries"]) == (False, 0)
    assert options["key"].startswith(first.order.counter)
    assert options["key"] != again["key"]


@pytest.mark.parametrize(("lost", "error"), [(True, ConnectionLost), (False, ValueError)])
def test_an_error_of_a_submission_counts_only_on_a_connection(tmp_path, lost, error):
    def fail(*_, **__):
        raise ValueError("no")

    executor = executor_of(Connection(client=SimpleNamespace(submit=fail)))
    trial = executor._trial(job(0, tmp_path))
    executor._connection.lost = lost
    with pytest.raises(error):
        executor._submit(trial)


class Future:
    """A future in a given state."""

    def __init__(self, status):
        self.status = status


def test_only_futures_that_are_not_pending_are_done(monkeypatch):
    waits = []

    def wait(given, timeout, return_when):
        waits.append((given, timeout, return_when))
        raise TimeoutError

    monkeypatch.setattr(distributed, "wait", wait)
    under_way = {Future(status): None for status in ("pending", "finished", "error", "lost")}
    assert [one.status for one in executor_of(Connection())._done(under_way)] == ["finished", "error", "lost"]
    assert waits == [(list(under_way), dask_executor.LISTEN_S, "FIRST_COMPLETED")]


def test_jobs_are_submitted_again_in_their_order_after_a_lost_connection(tmp_path):
    """A connection may be lost before, within and after a round; progress is reported after every round."""
    jobs, cancelled, rounds = [job(number, tmp_path) for number in range(4)], [], []
    connection = Connection(client=SimpleNamespace(cancel=lambda futures, force: cancelled.append((futures, force))))
    executor = executor_of(connection)
    reports = []
    executor._report = lambda progress: reports.append(progress)

    def one_round(waiting, under_way):
        assert not under_way, "after a lost connection, no former submission is left"
        rounds.append([one.id for one in waiting])
        while waiting:
            one = waiting.popleft()
            under_way[f"future {one.id}"] = _Trial(one, None, None)
        if len(rounds) == 1:
            connection.lost = True
            raise ConnectionLost
        if len(rounds) == 2:
            del under_way["future 0"]
            yield jobs[0], "outcome"
            connection.lost = True
            return
        for number in (1, 2, 3):
            if under_way.pop(f"future {number}", None):
                yield jobs[number], "outcome"

    executor._round = one_round
    asked = deque(jobs[:3])
    found = []
    for one, outcome in executor.run(asked, "progress"):
        found.append((one.id, outcome))
        if one.id == 0:
            asked.append(jobs[3])
    assert found == [(number, "outcome") for number in range(4)]
    assert rounds == [[0, 1, 2], [0, 1, 2], [1, 2, 3]]
    assert connection.calls == ["restore", "restore"]
    assert reports == ["progress"] * 3
    assert cancelled == [([], True)]


def test_unfinished_jobs_are_cancelled(tmp_path):
    cancelled = []
    client = SimpleNamespace(cancel=lambda futures, force: cancelled.append((futures, force)))
    executor = executor_of(Connection(client=client))

    def one_round(waiting, under_way):
        under_way.update({"a": None, "b": None})
        waiting.clear()
        yield "job", "outcome"

    executor._round = one_round
    running = executor.run([job(0, tmp_path)])
    assert next(running) == ("job", "outcome")
    running.close()
    assert cancelled == [(["a", "b"], True)]
