"""Worker process, which evaluates one candidate after another.

It ends when its pipe is closed, its parent process ends, or it cannot evaluate candidates.
"""

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
from evolve.config.task_errors import error_in_task
from evolve.genome.phenotype import Phenotype
from evolve.learning.training_rung import TrainingRung
from evolve.store.evaluation import Evaluation
from rhabdom.streams import send_all_to_stderr

__all__ = ["Message", "evaluate_candidate", "evaluated", "prepare_device", "refusal", "work"]

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # numbers of two settings of `mallopt`, from glibc's malloc.h
LARGEST_THRESHOLD = 2**25  # [bytes] size from which arrays get new pages; the maximum that glibc accepts
KEPT = 2**30  # [bytes] freed memory that glibc keeps; more than a training run's arrays need at the same time
NO_MEMORY = ("allocate memory", "out of memory", "bad_alloc", "bad allocation")  # in messages of PyTorch and Dr.Jit


@dataclass(frozen=True)
class Message:
    """Message from a worker to its executor.

    kind, content: "progress" with (steps trained, steps planned); "done" with the Evaluation; "unfit" with the reason
        why the worker cannot evaluate candidates; or "died" with None. The executor itself creates the message "died"
        if the pipe is closed.
    """

    kind: Literal["progress", "done", "unfit", "died"]
    content: Any = None


def work(connection: Connection, evaluate: Callable[..., Evaluation], prepare: Callable[[], None] | None) -> None:
    """Evaluate the candidates that arrive through the pipe, and send messages with progress and results.

    This is the main function of a worker process. It returns when the pipe is closed. It also returns after the message
    "unfit", if the worker cannot evaluate candidates.

    connection: the worker's end of the pipe
    evaluate: function that is called as `evaluate(*arguments, progress=...)` with the arguments from the pipe
    prepare: function that is called before the first candidate; None: no preparation
    """
    send_all_to_stderr()
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
        send_all_to_stderr()  # repeated, because a task may have closed or replaced the streams
        try:
            outcome = evaluated(evaluate, arguments, lambda *steps: connection.send(Message("progress", steps)))
        except (OSError, MemoryError) as error:
            connection.send(Message("unfit", f"{refusal(error)}, then use evolve resume"))
            return
        except ConfigError as error:
            connection.send(Message("unfit", " ".join(str(error).split())))
            return
        connection.send(Message("done", outcome))


def prepare_device() -> None:
    """Prepare Dr.Jit for one of several workers: find a usable LLVM library or a GPU, and use one thread.

    Also configure glibc so that freed memory is kept for later arrays.

    Raises:
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
    """
    from optics.numerics import device
    from sim.envs.threads import set_threads

    device.make_ready()
    set_threads(1)
    _keep_freed_memory()


def _keep_freed_memory() -> None:
    """Make glibc keep up to 1 GiB of freed memory until the evaluation of a candidate is complete.

    By default, glibc requests new pages from the system for each array of about 100 kB or more, and the system fills
    these pages with zeros. With many eyes, getting new pages takes a tenth of the time of an update of the policy. On
    systems other than Linux, this function does nothing.
    """
    allocator = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if allocator is not None:
        allocator(M_MMAP_THRESHOLD, LARGEST_THRESHOLD)
        allocator(M_TRIM_THRESHOLD, KEPT)


def evaluate_candidate(
    phenotype: Phenotype,
    config: RunConfig,
    seed: int,
    policy_path: Path,
    rung: TrainingRung | None = None,
    *,
    progress: Callable[[int, int], None],
) -> Evaluation:
    """Call `evolve.learning.fitness.evaluate`, which is imported here, so that only workers load its libraries."""
    from evolve.learning.fitness import evaluate
    from sim.scene.mirror import MirrorWarning

    with warnings.catch_warnings():
        # The warning is the same for all candidates, and was shown at the start of the run.
        warnings.simplefilter("ignore", MirrorWarning)
        return evaluate(phenotype, config, seed, policy_path, progress, rung)


def evaluated(
    evaluate: Callable[..., Evaluation], arguments: tuple[Any, ...], progress: Callable[[int, int], None]
) -> Evaluation:
    """Call `evaluate`, and return the candidate's evaluation.

    If `evaluate` raises an exception, the candidate counts as failed. Exceptions that every animal could cause are
    instead passed on to the caller: KeyboardInterrupt, a full disk, insufficient memory, and invalid settings.

    arguments: positional arguments of `evaluate`
    progress: function that is called with (steps trained, steps planned)

    Raises:
        OSError: a file cannot be written, for example the policy.
        MemoryError: memory is insufficient.
        ConfigError: the run's settings cannot be used here, for example because a user task cannot start.
    """
    began = time.perf_counter()
    try:
        return evaluate(*arguments, progress=progress)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        place = error_in_task(error)  # a task may raise any exception, such as SystemExit or an OSError
        if isinstance(error, MemoryError | ConfigError) or (isinstance(error, OSError) and place is None):
            raise
        if isinstance(error, RuntimeError) and any(words in str(error) for words in NO_MEMORY):
            raise MemoryError(_one_line(error)) from error
        return Evaluation.failed(place or _one_line(error), time.perf_counter() - began)
    finally:
        _give_back_memory()


def refusal(error: OSError | MemoryError) -> str:
    """Return the end of a message: the resource that is missing, and the remedy."""
    if isinstance(error, OSError):
        return f"{error}; correct this"
    reason = " ".join(str(error).split())[:200]
    return f"out of memory ({reason}); use fewer workers (workers in config.toml), or free some memory"


def _give_back_memory() -> None:
    """Return freed memory to the system after a candidate.

    Otherwise, the memory of a worker would grow with every candidate. glibc keeps about 10 MB per candidate, in gaps
    that are too small for the next arrays. Dr.Jit compiles kernels (machine code)
    for each new number of eyes and receptors, and keeps all kernels in memory. If a kernel is needed again after its
    memory has been freed, Dr.Jit reloads it from disk.
    """
    gc.collect()  # this must precede the next call, because it frees frozen functions, which refer to kernels
    if (drjit := sys.modules.get("drjit")) is not None and multiprocessing.parent_process() is not None:
        drjit.flush_kernel_cache()
        drjit.flush_malloc_cache()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if os.name == "posix" else None
    if trim is not None:
        trim(0)


def _one_line(error: BaseException) -> str:
    """Return an error as one line, such as "ValueError: message (file.py:12)"."""
    where = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})"


def _die_with_parent() -> None:
    """End this process when its parent process ends, because a parent that is killed cannot stop its workers."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
