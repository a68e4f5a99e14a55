"""`sim.set_threads` reaches every library, whether it is loaded before or after the call, and child processes."""

import subprocess
import sys

import pytest

import sim
from tests.slow_part import slow

# Prints the number of threads of each library. torch is imported before or after the call.
SCRIPT = """
import os, sys
for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.pop(name, None)
import numpy
{before}
from rhabdom import sim
sim.set_threads({count})
import torch, drjit, subprocess
from threadpoolctl import threadpool_info
print(drjit.thread_count(), torch.get_num_threads(), *{{lib["num_threads"] for lib in threadpool_info()}}, flush=True)
child = "from threadpoolctl import threadpool_info; import numpy; print(threadpool_info()[0]['num_threads'])"
subprocess.run([sys.executable, "-c", child], check=True)
"""


@pytest.mark.parametrize(("before", "count"), [("import torch", 1), slow("", 2)])
def test_all_libraries_have_this_number_of_threads(before, count):
    script = SCRIPT.format(before=before, count=count)
    child = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert child.stderr == ""
    assert set(child.stdout.split()) == {str(count)}


@pytest.mark.parametrize("count", [0, -1, 1.5, "two", None, 10**6, True])
def test_bad_numbers_are_refused(count):
    with pytest.raises(ValueError, match=r"^count = .*: must be a whole number in \[1, 1024\]$"):
        sim.set_threads(count)
