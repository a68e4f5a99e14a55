"""Kill a run at random moments with `kill -9` until it is finished, and compare it with the same run without kills.

    RHABDOM_KILLS=500 python -m pytest --all tests/evolve/search/test_kill.py

Each child is forked from a process that has loaded everything, so that a kill costs milliseconds and can hit any line
of search, record and lock. The fitness is known in closed form and takes a millisecond.
"""

import os
import random
import signal
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from evolve.search.loop import evolve
from evolve.search.search import Search
from evolve.search.successive_halving import finished
from evolve.store.atomic_files import write_whole
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation
from tests.evolve.closed_form import tiny
from tests.evolve.remote_form import in_stages

HALVING = ("search.rungs=3", "learning.total_steps=16384")
KINDS = ((), ("search.steady_state=true",), HALVING)  # kinds of runs


class Here:
    """An executor in this process that writes a line for each evaluation that it starts."""

    def __init__(self, log):
        self.log = log

    def run(self, jobs, progress):
        while jobs:
            job = jobs.popleft()
            with self.log.open("a") as log:
                log.write(f"{job.id} {job.rung.number if job.rung else 0}\n")
            time.sleep(0.001)
            if job.rung is not None:
                yield job, in_stages(*job.arguments, lambda *steps: None)
                continue
            write_whole(job.policy_path, f"policy {job.seed}".encode())
            fitness = -abs(job.phenotype.fov_deg - 70.0)
            yield job, Evaluation(fitness, (fitness, fitness / 3), 0.5, 4096, 0.01, ((4096, fitness),))


class Nobody:
    """A watcher that prints nothing."""

    def training(self, *report):
        """Do nothing."""

    def evaluated(self, candidate):
        """Do nothing."""


def carry(path, config):
    """Start a run or continue it, and finish it."""
    run = Run.open(path) if (path / "config.toml").exists() else Run.create(path, config)
    with run.lock():
        run.repair()
        evolve(run, Here(path.parent / f"{path.name}.log"), Nobody())


def child_killed_after(seconds, path, config, carry=carry):
    """Return whether the run was killed before its end."""
    pid = os.fork()
    if pid == 0:
        try:
            carry(path, config)
        except BaseException as error:
            print(f"{type(error).__name__}: {error}", file=sys.stderr)
            os._exit(1)
        os._exit(0)
    deadline = time.monotonic() + seconds
    while (ended := os.waitpid(pid, os.WNOHANG))[0] == 0:
        if time.monotonic() > deadline:
            os.kill(pid, signal.SIGKILL)
            ended = os.waitpid(pid, 0)
            break
        time.sleep(0.0005)
    status = ended[1]
    assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) == 0, "a child failed"
    return os.WIFSIGNALED(status)


def history(run):
    return [
        (c.id, c.rung, c.genome, c.seed, c.fitness, c.returns, c.curve, c.phenotype, c.parents) for c in run.candidates
    ]


def begun(log):
    """Return the number of starts of each candidate's evaluation in each rung."""
    names = log.read_text().splitlines()
    return {name: names.count(name) for name in names}


def endure(kills, seed, folder):
    """Make runs that are killed `kills` times in total, and assert all that a week-long run depends on. Return the
    number of finished runs.
    """
    chance, done, endured = random.Random(seed), 0, 0
    while done < kills:
        config = tiny(f"seed={endured}", *KINDS[endured % len(KINDS)])
        whole, path = folder / f"whole-{endured}", folder / f"run-{endured}"
        began = time.monotonic()
        assert not child_killed_after(60.0, whole, config)
        longest = 0.7 * (time.monotonic() - began)
        kept, deaths = b"", 0
        while child_killed_after(chance.uniform(0, longest), path, config):
            deaths += 1
            record = path / "candidates.jsonl"
            now = record.read_bytes() if record.exists() else b""
            complete = now[: now.rfind(b"\n") + 1]
            assert complete.startswith(kept), "a written line was lost"
            kept = complete
        run = Run.open(path)
        assert finished(run)
        assert history(run) == history(Run.open(whole)), "the history differs from that of a run without kills"
        again = {name: count - 1 for name, count in begun(folder / f"{path.name}.log").items() if count > 1}
        assert sum(again.values()) <= deaths, "a completed candidate was evaluated again"
        places = (path, path / "policies", path / "trainings")
        left = [entry.name for place in places if place.exists() for entry in place.glob(".*")]
        assert not left, f"partial files are left: {left}"
        done, endured = done + deaths, endured + 1
    return endured


def main(kills, seed=None):
    Search(tiny())  # loads modules that each child would otherwise load again
    seed = random.randrange(2**32) if seed is None else seed
    print(f"seed {seed}", flush=True)
    with TemporaryDirectory() as folder:
        os.environ["RHABDOM_TEST"] = folder
        endured = endure(kills, seed, Path(folder))
    print(f"{kills} kills at least, {endured} runs finished as if nothing had happened")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
