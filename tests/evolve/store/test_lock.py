"""One process at a time works on a run, and the lock ends with the process."""

import os
import subprocess
import sys

import pytest

from evolve.store.directory import Run
from evolve.store.lock import LockedError, RunLock, holder
from tests.evolve.closed_form import tiny

CONFIG = tiny()


@pytest.fixture
def run(tmp_path):
    return Run.create(tmp_path / "run", CONFIG)


HOLD = """
import sys, time
from evolve.store.lock import RunLock
from pathlib import Path
with RunLock(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def test_second_process_is_refused_by_name_and_the_lock_dies_with_its_process(run):
    child = subprocess.Popen([sys.executable, "-c", HOLD, run.path], stdout=subprocess.PIPE)
    try:
        assert child.stdout.readline() == b"held\n"
        assert holder(run.path).startswith(str(child.pid))
        with pytest.raises(LockedError, match=f"in use by process {child.pid}"), run.lock():
            pass
        child.kill()
        child.wait()
        assert holder(run.path) is None
        with run.lock():
            assert holder(run.path).startswith(str(os.getpid()))
        assert holder(run.path) is None
    finally:
        child.kill()
        child.wait()
        child.stdout.close()


def test_lock_alone_does_not_make_a_directory_full(tmp_path):
    with RunLock(tmp_path):
        pass
    Run.create(tmp_path, CONFIG)
