"""As `closed_form`, for workers that share nothing with the test but a folder: RHABDOM_TEST names it."""

import errno
import hashlib
import os
import signal
import time
from dataclasses import replace
from pathlib import Path

from evolve.config.checks import ConfigError
from evolve.store.atomic_files import write_whole
from evolve.store.evaluation import Evaluation

MISHAPS = (("slipped", 9), ("fell", 5), ("lost", 4), ("stuck", 3), ("others", 2))


def bowl(phenotype, config, seed, policy_path, progress):
    """Fitness known in closed form, and a policy that names the seed."""
    if "RHABDOM_TEST" in os.environ:
        with (Path(os.environ["RHABDOM_TEST"]) / "calls.log").open("a") as log:
            log.write(f"{int(policy_path.stem)}\n")
    progress(config.learning.total_steps // 2, config.learning.total_steps)
    policy_path.write_text(f"policy {seed}")
    fitness = -abs(phenotype.fov_deg - 70.0) + 1e-9 * (seed % 1000)
    curve = ((2048, fitness / 3), (4096, fitness))
    return Evaluation(fitness, (fitness,) * config.evaluation.episodes, 0.5, config.learning.total_steps, 0.01, curve)


def slow(phenotype, config, seed, policy_path, progress):
    """As `bowl`, with time to be interrupted."""
    time.sleep(0.3)
    return bowl(phenotype, config, seed, policy_path, progress)


def endless(phenotype, config, seed, policy_path, progress):
    """Goes on for half a minute, and says so."""
    for step in range(300):
        with (Path(os.environ["RHABDOM_TEST"]) / "beats.log").open("a") as log:
            log.write(".")
        progress(step, 300)
        time.sleep(0.1)


def disk_full(phenotype, config, seed, policy_path, progress):
    """There is no room for anybody's policy."""
    raise OSError(errno.ENOSPC, "No space left on device", str(policy_path))


def cannot_begin(phenotype, config, seed, policy_path, progress):
    """The run's own task cannot be executed here."""
    raise ConfigError("mine.py: line 1: ModuleNotFoundError:\nNo module named 'nowhere'", "task")


def fails_for_some(phenotype, config, seed, policy_path, progress):
    """Every other candidate raises."""
    if int(policy_path.stem) % 2:
        raise ValueError("no such\nluck")
    return bowl(phenotype, config, seed, policy_path, progress)


def killed_once(phenotype, config, seed, policy_path, progress):
    """The process is killed in the middle of candidate 2, the first time."""
    outcome = bowl(phenotype, config, seed, policy_path, progress)
    mark = Path(os.environ["RHABDOM_TEST"]) / "killed"
    if int(policy_path.stem) == 2 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return outcome


def killed_always(phenotype, config, seed, policy_path, progress):
    """The process is killed whenever candidate 1 is evaluated."""
    outcome = bowl(phenotype, config, seed, policy_path, progress)
    if int(policy_path.stem) == 1:
        os.kill(os.getpid(), signal.SIGSEGV)
    return outcome


def in_stages(phenotype, config, seed, policy_path, stage, progress):
    """A training that is the text of all it went through; its fitness depends on every letter."""
    with (Path(os.environ["RHABDOM_TEST"]) / "calls.log").open("a") as log:
        log.write(f"{int(policy_path.stem)} in stage {stage.number}\n")
    text, first = "", 0
    for number in reversed(range(stage.number)):
        if not text and stage.checkpoints[number].exists():
            text, first = stage.checkpoints[number].read_text(), number + 1
    for number in range(first, stage.number + 1):
        progress(stage.ends[number], stage.ends[number])
        text += f"{seed} to {stage.ends[number]} on {number}, "
        write_whole(stage.checkpoints[number], text.encode())
    write_whole(policy_path, text.encode())
    luck = int.from_bytes(hashlib.sha256(text.encode()).digest()[:4]) / 2**32
    fitness = -abs(phenotype.fov_deg - 70.0) + 20 * luck
    curve = tuple((steps, fitness) for steps in stage.ends)
    return Evaluation(fitness, (fitness,) * config.evaluation.episodes, 0.5, stage.ends[-1], 0.01, curve)


def fails_late(phenotype, config, seed, policy_path, stage, progress):
    """As `in_stages`, with mishaps in every stage; of the second, candidates of odd ids do not come through."""
    if stage.number and int(policy_path.stem) % 2:
        raise ValueError("no luck")
    outcome = in_stages(phenotype, config, seed, policy_path, stage, progress)
    curve = tuple((steps, outcome.fitness) for steps in stage.ends[: stage.number + 1])
    return replace(outcome, steps=stage.ends[stage.number], curve=curve, mishaps=MISHAPS)
