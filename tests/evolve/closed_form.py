"""Evaluations with a known result, for tests of the code around the evaluation: executor, record, search and loop.

They run in worker processes, so they live in their own module.
"""

import errno
import os
import shutil
import signal
import sys
import time
from pathlib import Path

from evolve.config.assemble import assemble
from evolve.config.checks import ConfigError
from evolve.store.atomic_files import write_whole
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation

TINY = ("search.population=4", "search.generations=3", "genome.optical.open=false", "learning.total_steps=4096")
BEST_FOV_DEG = 70.0


def tiny(*assignments, task="detection"):
    """Return a config with few candidates and genes."""
    return assemble(task, assignments=[*TINY, *assignments])


def bowl(phenotype, config, seed, policy_path, progress):
    """Return a fitness in closed form; append a line to calls.log next to the policies for every call."""
    with (policy_path.parent / "calls.log").open("a") as log:
        log.write(f"{policy_path.stem} {os.getpid()}\n")
    progress(config.learning.total_steps // 2, config.learning.total_steps)
    fitness = -abs(phenotype.fov_deg - BEST_FOV_DEG) + 1e-9 * (seed % 1000)
    return Evaluation(fitness, (fitness,) * config.evaluation.episodes, 0.5, config.learning.total_steps, 0.01)


def prints_and_closes(phenotype, config, seed, policy_path, progress):
    """Evaluate like `bowl`, but print in several ways, and let every third candidate end the program."""
    print("noise")
    os.write(1, b"noise\n")
    os.system("echo noise")
    sys.stdout.close()
    sys.__stdout__.close()
    if int(policy_path.stem) % 3 == 2:
        sys.exit(5)
    return bowl(phenotype, config, seed, policy_path, progress)


def leaves_a_policy(phenotype, config, seed, policy_path, progress):
    """Evaluate like `bowl`, and write a file in place of a policy."""
    write_whole(policy_path, f"policy {seed}".encode())
    return bowl(phenotype, config, seed, policy_path, progress)


def slow_for_some(phenotype, config, seed, policy_path, progress):
    """Evaluate like `bowl`, but let candidates finish in another order than they start."""
    time.sleep(0.2 * (int(policy_path.stem) % 2 == 0))
    return bowl(phenotype, config, seed, policy_path, progress)


def fails_for_some(phenotype, config, seed, policy_path, progress):
    """Raise an error for every other candidate."""
    if int(policy_path.stem) % 2:
        raise ValueError("no such\nluck")
    return bowl(phenotype, config, seed, policy_path, progress)


def killed_once(phenotype, config, seed, policy_path, progress):
    """Kill the process the first time that candidate 2 is evaluated."""
    mark = policy_path.parent / "killed"
    if int(policy_path.stem) == 2 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return bowl(phenotype, config, seed, policy_path, progress)


def killed_always(phenotype, config, seed, policy_path, progress):
    """Kill the process whenever candidate 1 is evaluated."""
    outcome = bowl(phenotype, config, seed, policy_path, progress)
    if int(policy_path.stem) == 1:
        os.kill(os.getpid(), signal.SIGSEGV)
    return outcome


def starved(phenotype, config, seed, policy_path, progress):
    """Kill the process, like a system that is out of memory, whenever candidate 1 is evaluated."""
    outcome = bowl(phenotype, config, seed, policy_path, progress)
    if int(policy_path.stem) == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return outcome


def memory_full(phenotype, config, seed, policy_path, progress):
    """Raise MemoryError for the second candidate."""
    if int(policy_path.stem) == 1:
        raise MemoryError("Unable to allocate 3.00 GiB")
    return bowl(phenotype, config, seed, policy_path, progress)


def torch_memory_full(phenotype, config, seed, policy_path, progress):
    """Raise PyTorch's error for missing memory for the second candidate."""
    if int(policy_path.stem) == 1:
        raise RuntimeError("[enforce fail] DefaultCPUAllocator: can't allocate memory: you tried to allocate 4 bytes")
    return bowl(phenotype, config, seed, policy_path, progress)


def disk_full(phenotype, config, seed, policy_path, progress):
    """Raise the error of a full disk for the second candidate's policy."""
    if int(policy_path.stem) == 1:
        raise OSError(errno.ENOSPC, "No space left on device", str(policy_path))
    return bowl(phenotype, config, seed, policy_path, progress)


def cannot_begin(phenotype, config, seed, policy_path, progress):
    """Raise the error of a user task that cannot be executed on this machine."""
    raise ConfigError("mine.py: line 1: ModuleNotFoundError:\nNo module named 'nowhere'", "task")


def threads(phenotype, config, seed, policy_path, progress):
    """Return the number of threads that numerical libraries may use in a worker, as its fitness."""
    threads = float(os.environ["OMP_NUM_THREADS"])
    return Evaluation(threads, (threads,))


KEPT = []  # objects that the worker keeps, like a cache


def leaves_gaps(phenotype, config, seed, policy_path, progress):
    """Return the worker's memory [MB], then fill 200 MB and keep only a few scattered pieces."""
    with Path("/proc/self/status").open() as status:
        held = int(next(line for line in status if line.startswith("RssAnon")).split()[1]) / 1000
    pieces = [bytes(50_000) for _ in range(4000)]
    KEPT.extend(pieces[::100])
    return Evaluation(held, (held,))


def unfit():
    """Raise the error of a preparation that fails."""
    raise RuntimeError("no LLVM\nhere")


def calls(run_path):
    """Return the number of evaluations of each candidate."""
    lines = (Path(run_path) / "policies" / "calls.log").read_text().splitlines()
    names = [int(line.split()[0]) for line in lines]
    return {name: names.count(name) for name in names}


def deletes_the_run(phenotype, config, seed, policy_path, progress):
    """Delete the run's directory while the first candidate trains, so that its policy cannot be written."""
    shutil.rmtree(policy_path.parents[1])
    write_whole(policy_path, b"policy")
    return Evaluation(1.0, (1.0,))


def deletes_the_run_at_last(phenotype, config, seed, policy_path, progress):
    """Delete the run's directory after the policy has been written."""
    write_whole(policy_path, b"policy")
    shutil.rmtree(policy_path.parents[1])
    return Evaluation(1.0, (1.0,))


def begins_another_run(phenotype, config, seed, policy_path, progress):
    """Delete the run and create another one in its place."""
    shutil.rmtree(policy_path.parents[1])
    Run.create(policy_path.parents[1], tiny("seed=77"))
    return Evaluation(1.0, (1.0,))
