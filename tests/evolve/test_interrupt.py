"""Ctrl-C at any moment from the first line on: one line, code 130, no traceback."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# The script `evolve` in pip's form, with a line that reports when its first lines have run.
SCRIPT = """
import sys
from rhabdom.command import run_command
print("started", flush=True)
sys.exit(run_command())
"""


def interrupted_after(seconds, arguments):
    child = subprocess.Popen(
        [sys.executable, "-c", SCRIPT, *arguments],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert child.stdout.readline() == "started\n"
    time.sleep(seconds)
    os.killpg(child.pid, signal.SIGINT)  # a terminal sends it to the workers, too
    _, told = child.communicate(timeout=60)
    return child.returncode, told


@pytest.mark.slow
def test_ctrl_c_while_it_loads(tmp_path):
    """The command is interrupted while it loads its own modules, reads its arguments, or loads the heavy libraries."""
    chance = random.Random(0)
    found = []
    for number in range(24):
        arguments = ["run", "detection", "--dry-run"] if number % 2 else ["genes"]
        seconds = 0.002 + chance.random() * (0.5 if number % 2 else 0.1)
        found.append(interrupted_after(seconds, arguments))
    for code, told in found:
        # Python itself exits silently if it has already begun to shut down.
        assert code in (0, 130) or (code, told) == (-signal.SIGINT, ""), told
        assert "Traceback" not in told
        assert told.count("evolve: interrupted\n") == (code == 130)
    assert [code for code, _ in found].count(130) >= 5, "too few interrupts for a valid test"
