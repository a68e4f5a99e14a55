"""Kill real PPO training at random moments with `kill -9`, in rungs and whole, and compare it with the same runs
without kills.

    RHABDOM_TRAINING_KILLS=100 python -m pytest --all tests/evolve/search/test_kill.py -k training

The method is that of `kills`, but each candidate learns. Children are forked from a process that has loaded the
libraries, but not yet started any of their threads.
"""

import os
import random
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import drjit  # noqa: F401 (loaded before any fork)
import mitsuba  # noqa: F401
import torch

from evolve.config.assemble import assemble
from evolve.learning import fitness
from evolve.search.loop import evolve
from evolve.search.search import Search
from evolve.search.successive_halving import finished
from evolve.search.worker import prepare_device
from evolve.store.directory import Run
from tests.evolve.search.kills import Nobody, child_killed_after, history
from tests.evolve.search.test_kill import tensors

SMALL = (
    "workers=1",
    "search.population=2",
    "search.generations=1",
    "learning.total_steps=256",
    "learning.n_envs=8",
    "learning.n_steps=16",
    "learning.batch_size=64",
    "learning.n_epochs=2",
    "learning.eval_interval=128",
    "evaluation.episodes=2",
    "eye.optics=false",
    "eye.rays_per_receptor=1",
    "genome.morphological.open=false",
    "genome.optical.open=false",
    *("genome.memory_frames.open=true", "genome.memory_frames.high=5"),
    *("genome.neurons.open=true", "genome.neurons.low=16", "genome.neurons.high=128"),
)
KINDS = ((), ("search.rungs=2",))


class Learning:
    """An executor in this process that evaluates like a worker."""

    def run(self, jobs, progress):
        while jobs:
            job = jobs.popleft()
            yield job, fitness.evaluate(*job.arguments[:4], None, *job.arguments[4:])


def carry(path, config):
    """Start a run or continue it, and finish it."""
    torch.set_num_threads(1)
    prepare_device()
    run = Run.open(path) if (path / "config.toml").exists() else Run.create(path, config)
    with run.lock():
        run.repair()
        evolve(run, Learning(), Nobody())


def policies(run):
    """Return the numbers of all remaining policies, by name."""
    return {path.name: tensors(path) for path in (run.path / "policies").iterdir()}


def endure(kills, seed, folder):
    """Make runs that are killed `kills` times in total, and compare them with undisturbed runs. Return the moments of
    the kills.
    """
    chance, moments, number = random.Random(seed), [], 0
    while len(moments) < kills:
        config = assemble("detection", "quick", assignments=[*SMALL, f"seed={number}", *KINDS[number % len(KINDS)]])
        whole, path = folder / f"whole-{number}", folder / f"run-{number}"
        began = time.monotonic()
        assert not child_killed_after(300.0, whole, config, carry)
        longest = 1.2 * (time.monotonic() - began)
        kept = b""
        while child_killed_after(moment := chance.uniform(0, longest), path, config, carry):
            moments.append(moment)
            record = path / "candidates.jsonl"
            now = record.read_bytes() if record.exists() else b""
            assert now.startswith(kept), "a written line was lost"
            kept = now[: now.rfind(b"\n") + 1]
        undisturbed, run = Run.open(whole), Run.open(path)
        assert finished(run)
        assert all(candidate.failure is None for candidate in run.candidates)
        assert history(run) == history(undisturbed), "the history differs from that of a run without kills"
        assert policies(run) == policies(undisturbed)
        number += 1
    return moments


def main(kills, seed=None):
    # loads modules that each child would otherwise load again
    Search(assemble("detection", "quick", assignments=SMALL))
    seed = random.randrange(2**32) if seed is None else seed
    print(f"seed {seed}", flush=True)
    with TemporaryDirectory() as folder:
        moments = endure(kills, seed, Path(folder))
    print(f"{len(moments)} trainings killed, and finished as if nothing had happened")


if __name__ == "__main__":
    os.environ["OMP_NUM_THREADS"] = "1"
    main(*map(int, sys.argv[1:]))
