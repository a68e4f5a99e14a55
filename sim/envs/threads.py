"""Number of threads of the libraries that a training run uses: Dr.Jit, torch, OpenMP and BLAS."""

from __future__ import annotations

import os
import sys

from optics.numerics.arguments import whole

__all__ = ["set_threads"]

LARGEST = 1024  # largest number of threads
VARIABLES = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")


def set_threads(count: int = 1) -> None:
    """Set the number of threads of Dr.Jit, torch, OpenMP and BLAS in this process.

    Processes that this process starts afterwards use the same number for torch, OpenMP and BLAS, but not for Dr.Jit.

    Call this function at the beginning of a training script, before it makes environments or a learner. By default,
    torch and BLAS use one thread per core. Networks for small eyes give so many threads too little work: most of the
    time, the threads wait for each other, and waiting takes CPU time. `evolve` uses one thread per process.

    Rendering and physics use the threads of Dr.Jit. If a machine executes a single training run, call
    ``drjit.set_thread_count(n)`` afterwards to give rendering and physics more threads than torch.

    count: number of threads, from 1 to 1024

    Raises:
        ValueError: the number is not a whole number in this range.
    """
    count = whole("count", count, 1, LARGEST)
    import drjit
    from threadpoolctl import threadpool_limits

    os.environ.update(dict.fromkeys(VARIABLES, str(count)))  # for libraries loaded later, and for child processes
    threadpool_limits(count)  # for libraries that are loaded
    if (torch := sys.modules.get("torch")) is not None:
        torch.set_num_threads(count)
    drjit.set_thread_count(count)
