"""What tests of several packages share."""

import os
import sys

import pytest

# colour-science loads OpenImageIO where it can and keeps some of its objects. Where torch is loaded, too, they outlive
# the interpreter, and a green run ends in a page of "nanobind: leaked". The test that needs it starts a process.
sys.modules["OpenImageIO"] = None  # type: ignore[assignment]


def pytest_configure() -> None:
    """Workers beside each other have a thread each: Dr.Jit's second one spins while it waits, at the others' cost."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        import drjit

        drjit.set_thread_count(1)


@pytest.fixture(scope="module")
def short_episodes():
    """Episodes of 32 actions, not 256: for what does not depend on their length, and needs many of them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sim.tasks.built_in.EPISODE_STEPS", 32)
        yield
