"""Fixtures and settings that tests of several packages share."""

import os
import sys

import pytest

# colour-science loads OpenImageIO if it is installed and keeps some of its objects. If torch is loaded too, these
# objects outlive the interpreter, and a run without failures ends in a page of "nanobind: leaked". The test that needs
# OpenImageIO starts a process of its own.
sys.modules["OpenImageIO"] = None  # type: ignore[assignment]

# Idle threads of OpenBLAS and OpenMP spin. With a worker on every core, that took up to half of the CPU time of tests
# with large matrices. Nothing has imported NumPy or torch yet, and child processes inherit the variables.
os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))

pytest_plugins = ["pytester", "tests.cpu_times", "tests.sharing", "tests.slow_part"]


# Tests start many processes, including xdist's workers. Without bytecode, each process would compile all sources again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


def pytest_configure() -> None:
    """Give each xdist worker a single Dr.Jit thread.

    A second thread spins while it waits, which slows down the other workers.
    """
    if "PYTEST_XDIST_WORKER" in os.environ:
        import drjit

        drjit.set_thread_count(1)


@pytest.fixture(scope="module")
def short_episodes():
    """Episodes of 32 actions instead of 256, for tests that run many episodes and do not depend on their length."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sim.tasks.built_in.EPISODE_STEPS", 32)
        yield
