"""Evaluations in a Dask worker, with a stand-in for the worker."""

import errno
from types import SimpleNamespace

import pytest

from evolve.config.run_config import ConfigError
from evolve.search import dask_worker
from evolve.search.dask_worker import ATTEMPTS, Order, UnfitWorker
from evolve.store.evaluation import Evaluation

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


class DaskWorker:
    """A Dask worker that evaluates a job whose state in the scheduler can change."""

    def __init__(self):
        self.task, self.events = SimpleNamespace(state="executing"), []
        self.state = SimpleNamespace(tasks={"key": self.task})

    def get_current_task(self):
        return "key"

    def _get_client(self):
        return "client"

    def log_event(self, topic, event):
        self.events.append((topic, event))


ORDER = Order("evolve.search.worker:evaluated", 7, "{}", "", 1, "counter", "topic", {})


@pytest.fixture
def dask(monkeypatch):
    found = DaskWorker()
    monkeypatch.setattr(distributed, "get_worker", lambda: found)
    monkeypatch.setattr(dask_worker, "_prepare", lambda order: found.events.append("prepared"))
    return found


def test_an_evaluation_counts_as_an_attempt_and_reports_its_progress(dask, variables, monkeypatch):
    def evaluate(function, order, progress):
        from evolve.search.worker import evaluated

        assert function is evaluated
        assert dask_worker._one_at_a_time.locked()
        progress(10, 40)
        return order.id

    monkeypatch.setattr(dask_worker, "_evaluate", evaluate)
    for attempts in range(ATTEMPTS):
        variables["counter"] = attempts
        assert dask_worker.evaluate(ORDER) == 7
        assert variables["counter"] == attempts + 1
    assert dask.events == ["prepared", ("topic", [7, 10, 40])] * ATTEMPTS
    assert not dask_worker._one_at_a_time.locked()


def test_after_the_last_attempt_nothing_is_evaluated(dask, variables):
    variables["counter"] = ATTEMPTS
    outcome, policy, checkpoint = dask_worker.decode(dask_worker.evaluate(ORDER))
    assert outcome == Evaluation.failed(f"its worker process died {ATTEMPTS} times")
    assert (policy, checkpoint) == (b"", b"")
    assert (dask.events, variables["counter"]) == ([], ATTEMPTS)


@pytest.mark.parametrize("state", [None, "cancelled", "released", "forgotten", "long-running"])
def test_an_evaluation_that_nobody_wants_ends_at_its_next_report(dask, variables, monkeypatch, state):
    def evaluate(function, order, progress):
        if state is None:
            dask.state.tasks.clear()
        dask.task.state = state
        progress(10, 40)

    variables["counter"] = 0
    monkeypatch.setattr(dask_worker, "_evaluate", evaluate)
    if state == "long-running":
        dask_worker.evaluate(ORDER)
        return
    with pytest.raises(dask_worker._Unwanted):
        dask_worker.evaluate(ORDER)
    assert dask.events == ["prepared"]


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (OSError(errno.ENOSPC, "full"), r"error on a worker's machine: \[Errno 28\] full; correct this, then use"),
        (MemoryError("x"), r"error on a worker's machine: out of memory \(x\); use fewer workers"),
        (ConfigError("mine.py:\n  line 3", "task"), "mine.py: line 3$"),
    ],
)
def test_errors_of_the_machine_or_the_settings_make_a_worker_unfit(dask, variables, monkeypatch, error, reason):
    def fail(*_):
        raise error

    variables["counter"] = 0
    monkeypatch.setattr(dask_worker, "_evaluate", fail)
    with pytest.raises(UnfitWorker, match=f"^{reason}"):
        dask_worker.evaluate(ORDER)
    assert not dask_worker._one_at_a_time.locked()


def test_a_device_that_cannot_be_prepared_makes_a_worker_unfit(monkeypatch):
    def fail():
        raise RuntimeError("no LLVM\n here")

    monkeypatch.setattr(dask_worker, "prepare_device", fail)
    monkeypatch.setattr(dask_worker, "_prepared", False)
    for _ in range(2):
        with pytest.raises(UnfitWorker, match=r"^no LLVM here$"):
            dask_worker._prepare(ORDER)
