"""Schedulers, workers and nannies are stopped or killed for good: the run ends with one line and can be resumed."""

import random
import signal
import threading
import time
from functools import partial

import pytest

from evolve.cli.main import main
from evolve.search import dask_worker
from evolve.search.dask_executor import DaskExecutor
from evolve.search.job import ExecutorError
from evolve.search.local_executor import LocalExecutor
from evolve.search.loop import evolve
from evolve.store.directory import Run
from evolve.store.versions import present
from tests.evolve.closed_form import tiny
from tests.evolve.remote_form import bowl
from tests.evolve.search.dask_cluster import Cluster
from tests.evolve.search.test_local_executor import jobs
from tests.evolve.search.test_loop import SilentWatcher, history

pytest.importorskip("distributed")
pytestmark = pytest.mark.slow
PATIENCE_S = 6.0


@pytest.fixture(autouse=True)
def _any_commit(monkeypatch):
    """Ignore the commit, because a checkout in use changes between the starts of two processes."""
    software = {**present(), "commit": ""}
    monkeypatch.setattr(dask_worker, "_software", lambda: software)


@pytest.fixture(scope="module")
def processes(tmp_path_factory):
    cluster = Cluster(tmp_path_factory.mktemp("cluster"))
    yield cluster
    cluster.kill()


@pytest.fixture
def cluster(tmp_path, processes):
    """Return a cluster whose two workers have imported all modules, which delays their heartbeats."""
    processes.heal()
    with processes.executor("slow", 120) as executor:
        list(executor.run(jobs(tmp_path, 6)))
    return processes


class Attacker(SilentWatcher):
    """Watcher that attacks the cluster after a number of candidates."""

    def __init__(self, attack, after):
        super().__init__()
        self.attack, self.after = attack, after

    def evaluated(self, candidate):
        self.after -= 1
        if self.after == 0:
            self.attack()


@pytest.mark.parametrize(
    ("kind", "number", "missing"),
    [
        ("scheduler", signal.SIGSTOP, "an answer of the scheduler"),
        ("worker", signal.SIGSTOP, "a heartbeat of worker"),
        ("worker", signal.SIGKILL, "a worker (none is connected)"),
        ("scheduler", signal.SIGKILL, "an answer of the scheduler"),
    ],
)
def test_a_silent_cluster_ends_the_run_which_can_be_resumed(tmp_path, cluster, capfd, kind, number, missing):
    config, notes = tiny(), []
    run, after = Run.create(tmp_path / "run", config), random.Random().randrange(1, 8)
    attacker = Attacker(lambda: cluster.signal(kind, number), after)
    began = time.monotonic()
    executor = cluster.executor("slow", PATIENCE_S, note=notes.append)
    with executor, pytest.raises(ExecutorError) as caught:
        evolve(run, executor, attacker)
    assert time.monotonic() - began < 12 * PATIENCE_S
    assert f"waited 6 s for {missing}" in str(caught.value)
    assert str(caught.value).count("\n") == 0
    # The last signs of two workers may be seconds apart: then the run gives up one before it ends for the other.
    waits = [note for note in notes if "has given no sign of life" not in note]
    assert [f"waiting for {missing}" in note for note in waits] == [True]
    assert len(notes) - len(waits) <= (missing == "a heartbeat of worker")
    said = capfd.readouterr()
    assert said.out + said.err == ""
    assert after <= len(Run.open(run.path).candidates) < config.candidates

    cluster.heal()
    with cluster.executor("slow", 120) as executor:
        evolve(Run.open(run.path), executor, SilentWatcher())
    local = Run.create(tmp_path / "local", config)
    with LocalExecutor(bowl, 1) as executor:
        evolve(local, executor, SilentWatcher())
    assert history(Run.open(run.path)) == history(Run.open(local.path))


def test_candidates_of_a_silent_worker_are_evaluated_by_another_one(tmp_path, cluster):
    notes, found = [], []
    with cluster.executor("slow", PATIENCE_S, note=notes.append) as executor:
        for job, outcome in executor.run(jobs(tmp_path, 8)):
            found.append((job.id, outcome.failure))
            if len(found) == 1:
                cluster.signal("worker", signal.SIGSTOP, count=1)
    cluster.kill("worker")
    assert sorted(found) == [(number, None) for number in range(8)]
    assert ["has given no sign of life for 6 s; its candidates are evaluated by other" in note for note in notes] == [
        True
    ]


def test_a_pause_within_the_patience_is_no_end(tmp_path, cluster):
    notes, found = [], []
    with cluster.executor("slow", 3 * PATIENCE_S, note=notes.append) as executor:
        for job, outcome in executor.run(jobs(tmp_path, 4)):
            found.append((job.id, outcome.failure))
            if len(found) == 1:
                cluster.signal("scheduler", signal.SIGSTOP)
                threading.Timer(PATIENCE_S, cluster.signal, ("scheduler", signal.SIGCONT)).start()
    assert sorted(found) == [(number, None) for number in range(4)]
    assert ["waiting for an answer of the scheduler" in note for note in notes] == [True]


def test_an_evaluation_may_take_longer_than_the_patience(tmp_path, cluster):
    notes = []
    with cluster.executor("long", PATIENCE_S, note=notes.append) as executor:
        found = [outcome.failure for _, outcome in executor.run(jobs(tmp_path, 1))]
    assert found == [None]
    assert notes == []


def test_the_command_ends_with_one_line_and_code_2(tmp_path, cluster, capfd, monkeypatch):
    run = Run.create(tmp_path / "run", tiny())
    executor = partial(DaskExecutor, function="tests.evolve.remote_form:endless", patience_s=PATIENCE_S)
    monkeypatch.setattr("evolve.cli.commands.run.DaskExecutor", executor)

    def attack():
        while not (cluster.folder / "beats.log").exists():
            time.sleep(0.1)
        cluster.kill("scheduler")

    threading.Thread(target=attack, daemon=True).start()
    assert main(["resume", str(run.path), "--executor", "dask", "--scheduler", cluster.address]) == 2
    lines = capfd.readouterr().err.splitlines()
    assert [line.partition(": ")[0] for line in lines] == ["note", "evolve"]
    assert "waited 6 s for an answer of the scheduler" in lines[1]
