"""Rounds of the Dask executor, with a stand-in for the cluster: every state of a future leads to its outcome."""

from collections import deque
from types import SimpleNamespace

import pytest

from evolve.learning.training_rung import TrainingRung
from evolve.search import dask_worker
from evolve.search.dask_executor import DaskExecutor, _Trial
from evolve.search.dask_worker import ATTEMPTS, UnfitWorker
from evolve.search.job import ExecutorError, Job
from evolve.store.evaluation import Evaluation
from tests.evolve.closed_form import tiny
from tests.evolve.small_run import PHENOTYPE

distributed = pytest.importorskip("distributed")
OUTCOME = Evaluation(2.5, (2.0, 3.0), 0.5, 40, 0.1, ((20, 0.25), (40, 2.5)))


class Future:
    """A future in a given state, whose result is an evaluation with a policy and a checkpoint."""

    def __init__(self, status, error=None, checkpoint=b"checkpoint"):
        self.status, self.error, self.checkpoint, self.released = status, error, checkpoint, False

    def exception(self):
        return self.error

    def result(self):
        if self.error is not None:
            raise self.error
        return dask_worker._text(OUTCOME), b"policy", self.checkpoint

    def release(self):
        self.released = True


class Counter:
    """The number of attempts at a job, stored on the scheduler; None if the scheduler was restarted."""

    def __init__(self, attempts=1):
        self.attempts, self.deleted = attempts, False

    def get(self, timeout):
        if self.attempts is None:
            raise TimeoutError
        return self.attempts

    def set(self, attempts):
        self.attempts = attempts

    def delete(self):
        self.deleted = True


class Cluster:
    """An executor whose jobs have these futures, in the order in which they are submitted."""

    def __init__(self, folder, futures, attempts=1, rung=True):
        paths = tuple(folder / f"rung-{number}" for number in range(3))
        self.job = Job(7, PHENOTYPE, tiny(), 5, folder / "policy", TrainingRung((1, 2, 3), paths) if rung else None)
        self.futures, self.counter, self.calls = deque(futures), Counter(attempts), []
        self.executor = DaskExecutor("tcp://host:1")
        self.executor._connection = SimpleNamespace(
            ask=lambda call, timeout=None: call(),
            check=lambda: self.calls.append("check"),
            remove_lost_workers=lambda: self.calls.append("remove"),
        )
        self.executor._trial = lambda job: _Trial(job, self.counter, None)
        self.executor._submit = lambda trial: self.futures.popleft()
        self.waiting, self.under_way = deque([self.job]), {}

    def round(self):
        """Return the outcomes of one round."""
        found = list(self.executor._round(self.waiting, self.under_way))
        assert self.calls == ["check", "remove"], "each round looks for signs of life"
        self.calls.clear()
        assert all(job is self.job for job, _ in found)
        return [outcome for _, outcome in found]


@pytest.mark.parametrize("status", ["cancelled", "lost"])
def test_a_lost_job_waits_for_the_next_round(tmp_path, status):
    cluster = Cluster(tmp_path, [Future(status), Future("finished")])
    assert cluster.round() == []
    assert (list(cluster.waiting), cluster.under_way) == ([cluster.job], {})
    assert cluster.round() == [OUTCOME]


def test_a_result_is_written_and_released(tmp_path):
    future = Future("finished")
    cluster = Cluster(tmp_path, [future])
    assert cluster.round() == [OUTCOME]
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {
        "policy": b"policy",
        "rung-2": b"checkpoint",
    }
    assert future.released
    assert cluster.counter.deleted
    assert not cluster.waiting
    assert not cluster.under_way


@pytest.mark.parametrize(("checkpoint", "rung"), [(b"", True), (b"checkpoint", False)])
def test_without_a_checkpoint_only_the_policy_is_written(tmp_path, checkpoint, rung):
    assert Cluster(tmp_path, [Future("finished", checkpoint=checkpoint)], rung=rung).round() == [OUTCOME]
    assert [path.name for path in tmp_path.iterdir()] == ["policy"]


@pytest.mark.parametrize("future", [Future("pending"), Future("finished", TimeoutError())])
def test_a_job_without_a_result_yet_stays_under_way(tmp_path, future):
    cluster = Cluster(tmp_path, [future])
    for _ in range(2):
        assert cluster.round() == []
        assert list(cluster.under_way) == [future]
    assert not cluster.waiting


KILLED = distributed.KilledWorker("job", None, 3)


@pytest.mark.parametrize("attempts", [ATTEMPTS - 1, None])
def test_a_job_whose_worker_was_killed_is_submitted_again(tmp_path, attempts):
    again = Future("finished")
    cluster = Cluster(tmp_path, [Future("error", KILLED), again], attempts)
    assert cluster.round() == []
    assert (list(cluster.under_way), list(cluster.waiting)) == ([again], [])
    assert cluster.counter.attempts == (attempts or 0)
    assert cluster.round() == [OUTCOME]


@pytest.mark.parametrize(
    ("error", "reason"), [(KILLED, f"its worker process died {ATTEMPTS} times"), (ValueError("no"), "ValueError: no")]
)
def test_an_error_fails_the_candidate(tmp_path, error, reason):
    assert Cluster(tmp_path, [Future("error", error)], ATTEMPTS).round() == [Evaluation.failed(reason)]


def test_an_unfit_worker_ends_the_run(tmp_path):
    with pytest.raises(ExecutorError, match=r"^tcp://host:1: its disk is full$"):
        Cluster(tmp_path, [Future("error", UnfitWorker("its disk is full"))]).round()


def test_progress_is_reported_and_forgotten():
    executor, said = DaskExecutor("tcp://host:1"), []
    for report in ([3, 10, 40], [4, 20, 40]):
        executor._reports.put(report)
    executor._report(lambda *report: said.append(report))
    executor._report(lambda *report: said.append(report))
    executor._reports.put([5, 1, 2])
    executor._report(None)
    executor._report(lambda *report: said.append(report))
    assert said == [(3, 10, 40), (4, 20, 40)]


def test_a_worker_has_ten_seconds_to_send_its_result(tmp_path):
    """The scheduler has as long for the number of attempts."""
    asked = []
    cluster = Cluster(tmp_path, [Future("finished"), Future("error", KILLED), Future("pending")])
    cluster.executor._connection.ask = lambda call, timeout=None: asked.append(timeout) or call()
    cluster.counter.get = lambda timeout: asked.append(timeout) or 1
    cluster.round()
    cluster.waiting.append(cluster.job)
    cluster.round()
    assert asked == [10.0, None, 10.0]
