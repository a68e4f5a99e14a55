"""Worker processes: every job is returned once, whatever happens to the worker."""

import os
import platform
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.search.local_executor import ExecutorError, Job, LocalExecutor
from tests.evolve.closed_form import (
    bowl,
    calls,
    cannot_begin,
    disk_full,
    fails_for_some,
    killed_always,
    killed_once,
    leaves_gaps,
    memory_full,
    slow_for_some,
    starved,
    threads,
    tiny,
    torch_memory_full,
    unfit,
)

CONFIG = tiny()
GENOTYPE = Genotype(CONFIG.genome)

ROOT = Path(__file__).parents[3]


def jobs(folder, count=4):
    (folder / "policies").mkdir(exist_ok=True)
    rng = np.random.default_rng(0)
    animals = [develop(rng.random(GENOTYPE.dimension), CONFIG) for _ in range(count)]
    return [Job(i, a, CONFIG, 100 + i, folder / "policies" / f"{i:06d}") for i, a in enumerate(animals)]


def outcomes(evaluate, folder, count=4, workers=2):
    with LocalExecutor(evaluate, workers) as executor:
        return {job.id: outcome for job, outcome in executor.run(jobs(folder, count))}


def expected(job):
    return -abs(job.phenotype.fov_deg - 70) + 1e-9 * (job.seed % 1000)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("evaluate", [bowl, slow_for_some])
def test_every_job_comes_out_once_with_its_own_outcome(tmp_path, evaluate):
    found = outcomes(evaluate, tmp_path, count=5)
    assert calls(tmp_path) == dict.fromkeys(range(5), 1)
    assert {i: outcome.fitness for i, outcome in found.items()} == {j.id: expected(j) for j in jobs(tmp_path, 5)}


def test_a_full_disk_is_no_animals_failure(tmp_path):
    with pytest.raises(ExecutorError, match=r"No space left on device.*000001.*use evolve resume"):
        outcomes(disk_full, tmp_path, workers=1)


def test_settings_that_cannot_be_used_are_no_animals_failure(tmp_path):
    with pytest.raises(ExecutorError, match=r"^mine\.py: line 1: ModuleNotFoundError: No module named 'nowhere'$"):
        outcomes(cannot_begin, tmp_path, workers=1)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize(
    ("evaluate", "reason"),
    [
        (memory_full, r"^out of memory \(Unable to allocate 3\.00 GiB\); use fewer workers .* evolve resume$"),
        (torch_memory_full, r"^out of memory \(RuntimeError: \[enforce fail\] DefaultCPUAllocator: .* evolve resume$"),
        (starved, r"^the worker of candidate 1 was killed 3 times \(SIGKILL\), .* evolve resume$"),
    ],
)
def test_memory_that_is_wanting_is_no_animals_failure(tmp_path, evaluate, reason):
    with pytest.raises(ExecutorError, match=reason):
        outcomes(evaluate, tmp_path, workers=1)


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="a process's memory is read from Linux's /proc")
def test_a_worker_gives_back_what_candidates_leave_free(tmp_path):
    """Each candidate allocates 200 MB and keeps 2 MB."""
    found = outcomes(leaves_gaps, tmp_path, count=3, workers=1)
    assert found[2].fitness - found[0].fitness < 40


def test_progress_names_the_candidate_and_its_steps(tmp_path):
    seen = []
    with LocalExecutor(bowl, 2) as executor:
        list(executor.run(jobs(tmp_path, 3), lambda *report: seen.append(report)))
    assert sorted(seen) == [(i, 2048, 4096) for i in range(3)]


def test_exception_is_its_candidates_failure_and_nobody_elses(tmp_path):
    found = outcomes(fails_for_some, tmp_path)
    assert [found[i].failure is None for i in range(4)] == [True, False, True, False]
    assert found[1].failure.startswith("ValueError: no such luck (closed_form.py:")
    assert found[1].seconds > 0, "a failure also takes time"


def test_killed_worker_is_replaced_and_its_candidate_evaluated_again(tmp_path):
    found = outcomes(killed_once, tmp_path)
    assert (tmp_path / "policies" / "killed").exists()
    assert all(outcome.failure is None for outcome in found.values())
    assert len(found) == 4


def test_candidate_that_kills_its_worker_thrice_has_failed(tmp_path):
    found = outcomes(killed_always, tmp_path)
    assert calls(tmp_path) == {0: 1, 1: 3, 2: 1, 3: 1}
    assert found[1].failure == "its worker process died 3 times, at last by SIGSEGV"
    assert all(found[i].failure is None for i in (0, 2, 3))


def test_worker_that_cannot_be_made_ready_ends_it_all_in_one_line(tmp_path):
    with LocalExecutor(bowl, 2, unfit) as executor, pytest.raises(ExecutorError, match=r"^no LLVM here$"):
        list(executor.run(jobs(tmp_path)))


def test_workers_have_one_thread_and_leave_our_environment_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    assert {outcome.fitness for outcome in outcomes(threads, tmp_path).values()} == {1.0}
    assert os.environ["OMP_NUM_THREADS"] == "7"
    monkeypatch.delenv("OMP_NUM_THREADS")
    outcomes(threads, tmp_path, 1)
    assert "OMP_NUM_THREADS" not in os.environ


@pytest.mark.slow
def test_workers_are_as_many_as_asked_and_work_for_long(tmp_path):
    for workers in (1, 3):
        folder = tmp_path / str(workers)
        folder.mkdir()
        with LocalExecutor(slow_for_some, workers) as executor:
            list(executor.run(jobs(folder, 6)))
            list(executor.run([Job(9, *jobs(folder)[0].arguments)]))
        lines = (folder / "policies" / "calls.log").read_text().splitlines()
        assert len({line.split()[1] for line in lines}) == workers
    assert LocalExecutor(bowl).count == len(os.sched_getaffinity(0))


def test_workers_are_gone_after(tmp_path):
    with LocalExecutor(bowl, 2) as executor:
        list(executor.run(jobs(tmp_path, 2)))
        processes = [worker.process for worker in executor._workers]
        assert len(processes) == 2
    assert not any(process.is_alive() for process in processes)


ORPHANS = """
import sys
from pathlib import Path
import numpy as np
from tests.evolve.closed_form import slow_for_some
from evolve.search.local_executor import LocalExecutor
from tests.evolve.search.test_local_executor import jobs
if __name__ == "__main__":
    with LocalExecutor(slow_for_some, 2) as executor:
        for job, outcome in executor.run(jobs(Path(sys.argv[1]), 100)):
            print(*(worker.process.pid for worker in executor._workers), flush=True)
"""


def test_killed_parent_takes_its_workers_along(tmp_path):
    script = tmp_path / "parent.py"
    script.write_text(ORPHANS)
    command = [sys.executable, script, tmp_path]
    root = str(Path(__file__).parents[3])
    environment = {**os.environ, "PYTHONPATH": root}
    with subprocess.Popen(command, stdout=subprocess.PIPE, cwd=root, env=environment) as parent:
        workers = [int(pid) for pid in parent.stdout.readline().split()]
        parent.kill()
    assert len(workers) == 2
    deadline = time.monotonic() + 10
    while any(_alive(pid) for pid in workers):
        assert time.monotonic() < deadline, "workers outlive their parent"
        time.sleep(0.05)


def _alive(pid):
    """Return whether a process is running, and not a zombie that its parent has not reaped."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


CHILDREN = """
import multiprocessing, time
from evolve.search.local_executor import interrupts_held
children = []
for _ in range(2):
    with interrupts_held():
        children.append(multiprocessing.get_context("spawn").Process(target=time.sleep, args=(60,)))
        children[-1].start()
for child in children:
    print(next(line for line in open(f"/proc/{child.pid}/status") if line.startswith("SigBlk")).split()[1])
    child.kill()
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="blocked signals are read from Linux's /proc")
def test_interrupts_are_held_from_every_child_the_first_included():
    """The test needs a fresh process, in which the first child is really the first."""
    found = subprocess.run([sys.executable, "-c", CHILDREN], capture_output=True, text=True, check=True, cwd=ROOT)
    blocked = [int(line, 16) >> (signal.SIGINT - 1) & 1 for line in found.stdout.split()]
    assert blocked == [1, 1]


FAULTS = """
import resource
import numpy as np
from evolve.search.worker import _keep_freed_memory

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(20):
        arrays = [np.ones(n) for n in (300_000, 900_000) * 6]
        del arrays
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

faults()
mapped = faults()
_keep_freed_memory()
faults()
print(mapped, faults())
"""


@pytest.mark.slow
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc is configured")
def test_freed_memory_is_kept_for_the_next_arrays():
    """The test needs a separate process, whose allocator stays configured: pages are mapped once, and not each time."""
    done = subprocess.run([sys.executable, "-c", FAULTS], capture_output=True, text=True, check=True)
    mapped, kept = map(int, done.stdout.split())
    assert mapped > 10_000, "the test is not valid"
    assert kept < mapped / 100


@pytest.mark.parametrize("count", [-1, -8])
def test_a_negative_number_of_workers_is_refused(count):
    with pytest.raises(ValueError, match=f"count = {count}: must be 0, one per core, or more"):
        LocalExecutor(print, count)
