"""Python's garbage collection of another environment does not disturb the recording of a kernel."""

import subprocess
import sys
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from optics.numerics.precision import PACKET, aligned
from sim.scene.device_arrays import Divisor, SharedBuffer, floats, whole_numbers
from sim.scene.frozen_kernels import FrozenKernel
from sim.scene.variant import variant

# A first environment becomes garbage, and a collection is due during the recording of the second one.
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
        assert array.ctypes.data % PACKET == 0
        assert whole.ctypes.data + whole.nbytes >= array.ctypes.data + array.nbytes + PACKET


@dataclass(frozen=True)
class Weights:
    """Inputs with the nesting of kernels' inputs: lists of arrays, and optional parts."""

    each: list[Any]
    offset: Any = None


@dataclass(frozen=True)
class Inputs:
    x: Any
    weights: Weights


def weighted(scenes, x, inputs):
    first, second = inputs.weights.each
    total = x * first + inputs.x * second
    return total if inputs.weights.offset is None else total + inputs.weights.offset


def test_typed_inputs_keep_their_places_when_a_kernel_is_replayed():
    """A recording is used again with other arrays in the same positions. Other positions need another recording."""
    with variant():
        kernel = FrozenKernel(weighted)

        def of(number):
            # a separate array, because Dr.Jit records again if one array has two positions
            return floats(np.full(100, number))

        fixed = Inputs(of(5), Weights([of(2), of(3)]))
        for moving, given, expected in (
            (of(7), fixed, 7 * 2 + 5 * 3),
            (of(4), fixed, 4 * 2 + 5 * 3),
            (of(7), Inputs(of(2), Weights([of(5), of(6)])), 7 * 5 + 2 * 6),
        ):
            np.testing.assert_array_equal(kernel(None, moving, given).numpy(), expected)
        assert kernel.n_recordings == 1
        shifted = Inputs(of(5), Weights([of(2), of(3)], offset=of(9)))
        np.testing.assert_array_equal(kernel(None, of(7), shifted).numpy(), 7 * 2 + 5 * 3 + 9)
        assert kernel.n_recordings == 2


@pytest.mark.parametrize("backend", [dr.JitBackend.LLVM, dr.JitBackend.CUDA])
def test_a_shared_buffer_says_what_was_written_last(backend, monkeypatch):
    """A GPU cannot read NumPy's memory and gets a copy each time. The test simulates this on the processor."""
    with variant():
        buffer = SharedBuffer(64)
        if backend != dr.JitBackend.LLVM:
            buffer._array = mi.Float(np.full(64, -1.0))  # outdated, as on a GPU
            monkeypatch.setattr(dr, "backend_v", lambda kind: backend)
        for number in (1.0, 2.0):
            buffer.values[:] = number
            np.testing.assert_array_equal(buffer.array.numpy(), number)


def test_quotients_of_whole_numbers_are_exact():
    """Numbers next to multiples of the divisor, and the largest ones, divided by small, random and large divisors."""
    rng, largest = np.random.default_rng(1), 2**32 - 1
    divisors = [*range(1, 70), *(2**k + d for k in range(7, 32) for d in (-1, 0, 1)), *rng.integers(70, largest, 100)]
    with variant():
        for divisor in map(int, [*divisors, largest]):
            multiples = rng.integers(0, largest // divisor + 1, 30) * divisor
            near = np.add.outer([-1, 0, 1], multiples).ravel()
            values = np.concatenate([near[(near >= 0) & (near <= largest)], [0, 1, largest - 1, largest]])
            found = Divisor.from_number(divisor).quotient(whole_numbers(values)).numpy()
            np.testing.assert_array_equal(found, values // divisor)
