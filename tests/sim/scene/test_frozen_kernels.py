"""Recording a kernel survives that Python would collect another environment's remains just then."""

import subprocess
import sys

import numpy as np

from sim.scene.device_arrays import ALIGNMENT, PACKET, aligned

# A first environment becomes garbage; collection falls due in the middle of the second one's recording.
PROGRAM = """
import gc
import sim
from sim.tracing import spheres

def environment(seed):
    return sim.make_vec_env("detection", sim.Eyes(n_eyes=1, resolution=(3, 3)), 2, seed=seed, rays_per_receptor=1)

gc.disable()
first = environment(0)
first.reset()
first.itself = first
del first
second = environment(1)
gc.set_threshold(10**9)
gc.enable()
blocks = spheres.blocks

def collection_falls_due(*arguments):
    gc.set_threshold(1, 1, 1)
    kept = [[] for _ in range(10_000)]
    gc.set_threshold(10**9)
    return blocks(*arguments)

spheres.blocks = collection_falls_due
second.reset()
assert gc.isenabled()
print("survived")
"""


def test_collection_waits_until_the_kernel_is_recorded():
    child = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False)
    assert child.stdout.strip() == "survived", child.stderr[-500:]


def test_aligned_arrays_are_whole_and_a_packet_may_be_read_beyond_their_end():
    for n in range(1, 200):
        array = aligned(n, np.float32)
        whole = array
        while whole.base is not None:
            whole = whole.base
        assert array.shape == (n,)
        assert array.ctypes.data % ALIGNMENT == 0
        assert whole.ctypes.data + whole.nbytes >= array.ctypes.data + array.nbytes + PACKET
