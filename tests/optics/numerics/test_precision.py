"""Memory passed to Dr.Jit."""

import numpy as np
import pytest

from optics.numerics.precision import padded_for_packets


def test_memory_goes_on_after_the_last_number():
    values = np.arange(24.0).reshape(4, 6)[:, ::2]
    flat = padded_for_packets(values)
    assert flat.tolist() == values.ravel().tolist()
    start, end = np.lib.array_utils.byte_bounds(flat.base)
    assert start <= flat.ctypes.data
    assert end - (flat.ctypes.data + flat.nbytes) >= 16 * flat.itemsize  # a packet of AVX-512


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.uint32])
def test_memory_starts_where_packets_do(dtype):
    """Dr.Jit would otherwise compile kernels again for other alignments."""
    kept = [padded_for_packets(np.ones(count, dtype)) for count in range(1, 40)]
    assert {flat.ctypes.data % (16 * flat.itemsize) for flat in kept} == {0}
    assert all(flat.dtype == dtype for flat in kept)
