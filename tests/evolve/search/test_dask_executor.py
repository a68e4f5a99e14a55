"""A real Dask cluster with a scheduler and two worker processes: the same history as the local one, even if processes
die.
"""

import time
from collections import deque

import pytest

from evolve.learning.checkpoint_file import CheckpointWarning
from evolve.search import dask_worker
from evolve.search.dask_executor import DaskExecutor
from evolve.search.local_executor import ExecutorError, LocalExecutor
from evolve.search.loop import evolve
from evolve.search.scheduler import Scheduler
from evolve.search.successive_halving import finished
from evolve.store.directory import Run
from evolve.store.versions import present
from tests.evolve.closed_form import tiny
from tests.evolve.remote_form import bowl, in_stages
from tests.evolve.search.dask_cluster import Cluster
from tests.evolve.search.test_local_executor import jobs
from tests.evolve.search.test_loop import SilentWatcher, history
from tests.evolve.search.test_scheduler import certificates

pytest.importorskip("distributed")


@pytest.fixture(autouse=True)
def _any_commit(monkeypatch):
    """Ignore the commit, because a checkout in use changes between the starts of two processes."""
    software = {**present(), "commit": ""}
    monkeypatch.setattr(dask_worker, "_software", lambda: software)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    cluster = Cluster(tmp_path_factory.mktemp("cluster"))
    cluster.start()
    yield cluster
    cluster.kill()


def carried(path, config, executor, until=None):
    run = Run.open(path) if path.exists() else Run.create(path, config)
    onlooker = SilentWatcher(until)
    with executor as it:
        evolve(run, it, onlooker)
    return Run.open(path), onlooker


@pytest.mark.slow
def test_history_is_the_local_one(tmp_path, cluster):
    config = tiny()
    far, onlooker = carried(tmp_path / "dask", config, cluster.executor("bowl"))
    local, _ = carried(tmp_path / "local", config, LocalExecutor(bowl, 2))
    assert history(far) == history(local)
    assert [c.curve for c in far.candidates] == [c.curve for c in local.candidates]
    assert onlooker.steps > 0, "progress is reported"
    assert cluster.calls() == dict.fromkeys(range(12), 1)
    for candidate in local.candidates:
        assert far.policy_path(candidate.id).read_bytes() == f"policy {candidate.seed}".encode()


@pytest.mark.slow
def test_history_of_successive_halving_is_the_local_one(tmp_path, cluster, monkeypatch):
    """Training runs move between workers, and a worker has no files of another one."""
    monkeypatch.setenv("RHABDOM_TEST", str(tmp_path))
    config = tiny("search.rungs=3", "learning.total_steps=16384")
    far, _ = carried(tmp_path / "dask", config, cluster.executor("in_stages"))
    local, _ = carried(tmp_path / "local", config, LocalExecutor(in_stages, 2))
    assert history(far) == history(local)
    assert finished(far)
    whole = [candidate for candidate in local.candidates if candidate.rung == 2]
    assert len(whole) == 3
    for candidate in whole:
        assert far.policy_path(candidate.id).read_bytes() == local.policy_path(candidate.id).read_bytes()
    assert set(cluster.calls().values()) == {1, 2, 3}, "no rung starts twice"


@pytest.mark.slow
def test_a_damaged_checkpoint_does_not_travel(tmp_path, cluster, monkeypatch):
    """Files are damaged between two rungs. Their candidates start from the beginning on some worker."""
    monkeypatch.setenv("RHABDOM_TEST", str(tmp_path))
    config = tiny("search.rungs=3", "learning.total_steps=16384")
    local, _ = carried(tmp_path / "local", config, LocalExecutor(in_stages, 2))
    with pytest.raises(KeyboardInterrupt):
        carried(tmp_path / "dask", config, cluster.executor("in_stages"), until=4)
    for path in (tmp_path / "dask" / "trainings").iterdir():
        path.write_bytes(path.read_bytes()[:-1] + b"x")
    with pytest.warns(CheckpointWarning, match="it is damaged.*; it is renamed to"):
        far, _ = carried(tmp_path / "dask", None, cluster.executor("in_stages"))
    assert finished(far)
    assert history(far) == history(local)


@pytest.mark.slow
def test_failures_and_infinities_come_through(tmp_path, cluster):
    with cluster.executor("fails_for_some") as executor:
        found = {job.id: outcome for job, outcome in executor.run(jobs(tmp_path))}
    assert found[1].failure.startswith("ValueError: no such luck (remote_form.py:")
    assert found[1].fitness == float("-inf")
    assert found[0].failure is None
    assert executor.count == 2


@pytest.mark.slow
def test_a_full_disk_is_no_animals_failure(tmp_path, cluster):
    with (
        cluster.executor("disk_full") as executor,
        pytest.raises(ExecutorError, match=r"error on a worker's machine: .*No space left on device"),
    ):
        list(executor.run(jobs(tmp_path)))


@pytest.mark.slow
def test_settings_that_cannot_be_used_are_no_animals_failure(tmp_path, cluster):
    with (
        cluster.executor("cannot_begin") as executor,
        pytest.raises(ExecutorError, match=r": mine\.py: line 1: ModuleNotFoundError: No module named 'nowhere'$"),
    ):
        list(executor.run(jobs(tmp_path)))


@pytest.mark.slow
def test_worker_killed_in_mid_candidate_is_replaced_and_its_candidate_evaluated_again(tmp_path, cluster):
    cluster.calls()
    with cluster.executor("killed_once") as executor:
        found = {job.id: outcome for job, outcome in executor.run(jobs(tmp_path))}
    assert cluster.calls()[2] == 2
    assert len(found) == 4
    assert all(outcome.failure is None for outcome in found.values())


@pytest.mark.slow
def test_candidate_that_kills_its_worker_thrice_has_failed(tmp_path, cluster):
    cluster.calls()
    with cluster.executor("killed_always") as executor:
        found = {job.id: outcome for job, outcome in executor.run(jobs(tmp_path, 2))}
    assert cluster.calls()[1] == 3
    assert found[1].failure == "its worker process died 3 times"
    assert found[0].failure is None


@pytest.mark.slow
def test_what_is_added_meanwhile_is_evaluated_too(tmp_path, cluster):
    all_jobs = jobs(tmp_path, 5)
    queue, found = deque(all_jobs[:2]), []
    with cluster.executor("bowl") as executor:
        for job, _ in executor.run(queue):
            found.append(job.id)
            if len(found) <= 3:
                queue.append(all_jobs[len(found) + 1])
    assert sorted(found) == list(range(5))


@pytest.mark.slow
def test_candidate_that_nobody_wants_any_more_is_given_up(tmp_path, cluster):
    """After Ctrl-C, for example, the candidate would continue for half a minute."""
    told, beats = [], cluster.folder / "beats.log"
    with cluster.executor("endless") as executor:
        running = executor.run(jobs(tmp_path, 1), lambda *report: told.append(report) or interrupt())

        def interrupt():
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            next(running)
    assert told
    deadline = time.monotonic() + 15
    while True:
        before = beats.stat().st_size
        time.sleep(1.0)
        if beats.stat().st_size == before:
            break
        assert time.monotonic() < deadline, "the candidate continues"


@pytest.mark.slow
def test_worker_with_other_software_is_refused(tmp_path, cluster, monkeypatch):
    monkeypatch.setattr(dask_worker, "_software", lambda: {"torch": "0.4", "numpy": ""})
    with (
        cluster.executor("bowl") as executor,
        pytest.raises(ExecutorError, match=r"other software.*torch .* \(here 0\.4\)"),
    ):
        list(executor.run(jobs(tmp_path, 1)))


def test_nobody_there_is_said_in_one_line(tmp_path):
    with pytest.raises(ExecutorError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9") as caught:
        DaskExecutor("tcp://127.0.0.1:9", patience_s=1).__enter__()
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_scheduler_that_comes_back_is_asked_again(tmp_path):
    cluster = Cluster(tmp_path)
    cluster.start(workers=1)
    try:
        config = tiny("search.generations=2")
        run, found = Run.create(tmp_path / "run", config), []

        class Killer(SilentWatcher):
            def evaluated(self, candidate):
                found.append(candidate.id)
                if len(found) == 2:
                    cluster.kill()
                    time.sleep(0.5)
                    cluster.start(workers=1)

        with cluster.executor("slow") as executor:
            evolve(run, executor, Killer())
    finally:
        cluster.kill()
    local, _ = carried(tmp_path / "local", config, LocalExecutor(bowl, 1))
    assert history(Run.open(run.path)) == history(local)


@pytest.mark.slow
def test_behind_certificates_the_history_is_the_same_and_strangers_stay_outside(tmp_path):
    """A client without encryption, or with a certificate that the scheduler does not accept, gets no answer."""
    own, another = certificates(tmp_path), certificates(tmp_path, "another")
    cluster = Cluster(tmp_path, own)
    cluster.start(workers=1)
    try:
        config = tiny("search.generations=1")
        far, _ = carried(tmp_path / "dask", config, cluster.executor("bowl"))
        strangers = (
            Scheduler(cluster.address, another[0], *another),
            Scheduler(cluster.address, own[0], *another),
            Scheduler(cluster.address.replace("tls", "tcp")),
        )
        for stranger in strangers:
            with pytest.raises(ExecutorError, match="no Dask scheduler answers at") as caught:
                DaskExecutor(stranger, patience_s=3).__enter__()
            assert "\n" not in str(caught.value)
    finally:
        cluster.kill()
    local, _ = carried(tmp_path / "local", config, LocalExecutor(bowl, 1))
    assert history(far) == history(local)
