"""Variants of `closed_form` for workers that share only a folder with the test, named by RHABDOM_TEST."""

import errno
import hashlib
import os
import signal
import time
from dataclasses import replace
from pathlib import Path

import safetensors

from evolve.config.checks import ConfigError
from evolve.learning.checkpoint_file import owned, read_owned, sealed
from evolve.store.atomic_files import write_whole
from evolve.store.evaluation import Evaluation

MISHAPS = (("slipped", 9), ("fell", 5), ("lost", 4), ("stuck", 3), ("others", 2))


def bowl(phenotype, config, seed, policy_path, progress):
    """Return a fitness in closed form, and write a policy that contains the seed."""
    if "RHABDOM_TEST" in os.environ:
        with (Path(os.environ["RHABDOM_TEST"]) / "calls.log").open("a") as log:
            log.write(f"{int(policy_path.stem)}\n")
    progress(config.learning.total_steps // 2, config.learning.total_steps)
    policy_path.write_text(f"policy {seed}")
    fitness = -abs(phenotype.fov_deg - 70.0) + 1e-9 * (seed % 1000)
    curve = ((2048, fitness / 3), (4096, fitness))
    return Evaluation(fitness, (fitness,) * config.evaluation.episodes, 0.5, config.learning.total_steps, 0.01, curve)


def slow(phenotype, config, seed, policy_path, progress):
    """Evaluate like `bowl`, slowly enough to be interrupted."""
    time.sleep(0.3)
    return bowl(phenotype, config, seed, policy_path, progress)


def long(phenotype, config, seed, policy_path, progress):
    """Evaluate like `bowl`, but for 10 s without a progress report."""
    time.sleep(10.0)
    return bowl(phenotype, config, seed, policy_path, progress)


def endless(phenotype, config, seed, policy_path, progress):
    """Run for half a minute and report progress."""
    for step in range(300):
        with (Path(os.environ["RHABDOM_TEST"]) / "beats.log").open("a") as log:
            log.write(".")
        progress(step, 300)
        time.sleep(0.1)


def disk_full(phenotype, config, seed, policy_path, progress):
    """Raise the error of a full disk for every policy."""
    raise OSError(errno.ENOSPC, "No space left on device", str(policy_path))


def cannot_begin(phenotype, config, seed, policy_path, progress):
    """Raise the error of a user task that cannot be executed on this machine."""
    raise ConfigError("mine.py: line 1: ModuleNotFoundError:\nNo module named 'nowhere'", "task")


def fails_for_some(phenotype, config, seed, policy_path, progress):
    """Raise an error for every other candidate."""
    if int(policy_path.stem) % 2:
        raise ValueError("no such\nluck")
    return bowl(phenotype, config, seed, policy_path, progress)


def killed_once(phenotype, config, seed, policy_path, progress):
    """Kill the process during the first evaluation of candidate 2."""
    outcome = bowl(phenotype, config, seed, policy_path, progress)
    mark = Path(os.environ["RHABDOM_TEST"]) / "killed"
    if int(policy_path.stem) == 2 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return outcome


def killed_always(phenotype, config, seed, policy_path, progress):
    """Kill the process whenever candidate 1 is evaluated."""
    outcome = bowl(phenotype, config, seed, policy_path, progress)
    if int(policy_path.stem) == 1:
        os.kill(os.getpid(), signal.SIGSEGV)
    return outcome


def in_stages(phenotype, config, seed, policy_path, rung, progress):
    """Train in rungs: the policy is the text of all steps so far, and the fitness depends on every letter."""
    with (Path(os.environ["RHABDOM_TEST"]) / "calls.log").open("a") as log:
        log.write(f"{int(policy_path.stem)} in rung {rung.number}\n")
    text, first, owners = "", 0, rung.owners(phenotype, config, seed)
    for number in reversed(range(rung.number)):
        if not text and (kept := read_owned(rung.checkpoints[number], owners[number])) is not None:
            text, first = kept[1]["text"], number + 1
    for number in range(first, rung.number + 1):
        progress(rung.ends[number], rung.ends[number])
        text += f"{seed} to {rung.ends[number]} on {number}, "
        content = safetensors.serialize({}, owned(owners[number], {"text": text}))
        write_whole(rung.checkpoints[number], sealed(content))
    write_whole(policy_path, text.encode())
    luck = int.from_bytes(hashlib.sha256(text.encode()).digest()[:4]) / 2**32
    fitness = -abs(phenotype.fov_deg - 70.0) + 20 * luck
    curve = tuple((steps, fitness) for steps in rung.ends)
    return Evaluation(fitness, (fitness,) * config.evaluation.episodes, 0.5, rung.ends[-1], 0.01, curve)


def fails_late(phenotype, config, seed, policy_path, rung, progress):
    """Evaluate like `in_stages`, with failures of episodes in every rung; candidates of odd ids fail in the second
    rung.
    """
    if rung.number and int(policy_path.stem) % 2:
        raise ValueError("no luck")
    outcome = in_stages(phenotype, config, seed, policy_path, rung, progress)
    curve = tuple((steps, outcome.fitness) for steps in rung.ends[: rung.number + 1])
    return replace(outcome, steps=rung.ends[rung.number], curve=curve, episode_failures=MISHAPS)
