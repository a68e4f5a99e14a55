"""What a worker process does: evaluate one candidate after another, until its pipe closes or its parent is gone."""

from __future__ import annotations

import ctypes
import gc
import multiprocessing
import os
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, Literal

from evolve.config.run_config import ConfigError, RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.learning.training_stage import TrainingStage
from evolve.store.evaluation import Evaluation

__all__ = ["Message", "evaluate_candidate", "evaluated", "prepare_device", "refusal", "work"]

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # names of settings in glibc's malloc.h
LARGEST_THRESHOLD = 2**25  # bytes of an array; glibc refuses more
KEPT = 2**30  # bytes: more than a training's arrays take at once
NO_MEMORY = ("allocate memory", "out of memory", "bad_alloc", "bad allocation")  # as PyTorch's and Dr.Jit's errors say


@dataclass(frozen=True)
class Message:
    """From a worker to its executor: steps trained, an evaluation, why it cannot work here; "died" says the pipe."""

    kind: Literal["progress", "done", "unfit", "died"]
    content: Any = None


def work(connection: Connection, evaluate: Callable[..., Evaluation], prepare: Callable[[], None] | None) -> None:
    """Body of a worker process."""
    threading.Thread(target=_die_with_parent, daemon=True).start()
    try:
        if prepare is not None:
            prepare()
    except Exception as error:
        connection.send(Message("unfit", " ".join(str(error).split())))
        return
    while True:
        try:
            arguments = connection.recv()
        except EOFError:
            return
        try:
            outcome = evaluated(evaluate, arguments, lambda *steps: connection.send(Message("progress", steps)))
        except (OSError, MemoryError) as error:
            connection.send(Message("unfit", f"{refusal(error)}, and go on with evolve resume"))
            return
        except ConfigError as error:
            connection.send(Message("unfit", " ".join(str(error).split())))
            return
        connection.send(Message("done", outcome))


def prepare_device() -> None:
    """Make Dr.Jit ready for work beside other workers: a proven LLVM library, or a GPU; one thread. Arrays that are
    given back are kept for the next ones.

    Raises:
        BackendError: Dr.Jit cannot work here.
    """
    from optics.numerics import device

    device.make_ready()
    import drjit

    drjit.set_thread_count(1)
    _keep_freed_memory()


def _keep_freed_memory() -> None:
    """Until a candidate is done. glibc maps arrays of some 100 kB and more anew each time, and the system zeroes their
    pages: a tenth of what an update of a many-eyed brain takes. Other systems' libraries are left alone."""
    allocator = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if allocator is not None:
        allocator(M_MMAP_THRESHOLD, LARGEST_THRESHOLD)
        allocator(M_TRIM_THRESHOLD, KEPT)


def evaluate_candidate(
    phenotype: Phenotype,
    config: RunConfig,
    seed: int,
    policy_path: Path,
    stage: TrainingStage | None = None,
    *,
    progress: Callable[[int, int], None],
) -> Evaluation:
    """`evolve.learning.fitness.evaluate`, whose libraries are loaded in workers alone."""
    from evolve.learning.fitness import evaluate
    from sim.scene.mirror import MirrorWarning

    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", MirrorWarning
        )  # the same of every candidate: whoever began the run has been told
        return evaluate(phenotype, config, seed, policy_path, progress, stage)


def evaluated(
    evaluate: Callable[..., Evaluation], arguments: tuple[Any, ...], progress: Callable[[int, int], None]
) -> Evaluation:
    """The candidate's evaluation; whatever goes wrong in it becomes its failure, but what the machine refuses: a disk
    that is full says nothing about an animal, and neither does memory that others have taken. Nor do settings that
    cannot be used: they are the same for all.

    Raises:
        OSError: its policy cannot be written, say.
        MemoryError: there is no more.
        ConfigError: its run's own task cannot be begun here, say.
    """
    began = time.perf_counter()
    try:
        return evaluate(*arguments, progress=progress)
    except (OSError, MemoryError, ConfigError):
        raise
    except Exception as error:
        if isinstance(error, RuntimeError) and any(words in str(error) for words in NO_MEMORY):
            raise MemoryError(_one_line(error)) from error
        return Evaluation.failed(_one_line(error), time.perf_counter() - began)
    finally:
        _give_back_memory()


def refusal(error: OSError | MemoryError) -> str:
    """What the machine refuses, and what to do about it."""
    if isinstance(error, OSError):
        return f"{error}; mend that"
    reason = " ".join(str(error).split())[:200]
    return f"out of memory ({reason}); take fewer workers (workers in config.toml), or free some"


def _give_back_memory() -> None:
    """To the system, what the last candidate's arrays have left free between what is still in use: glibc keeps it, some
    10 MB a candidate, and arrays of other sizes do not fill it. Dr.Jit keeps its kernels, those of every shape of eye
    that has been; what is needed again it finds on the disk."""
    gc.collect()  # frozen functions first, which hold kernels
    if (drjit := sys.modules.get("drjit")) is not None and multiprocessing.parent_process() is not None:
        drjit.flush_kernel_cache()
        drjit.flush_malloc_cache()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if os.name == "posix" else None
    if trim is not None:
        trim(0)


def _one_line(error: Exception) -> str:
    """ "ValueError: what it says (file.py:12)"."""
    where = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})"


def _die_with_parent() -> None:
    """A parent that is killed cannot end its workers, and nobody would want what they are working on."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
