"""Memory passed to Dr.Jit."""

import numpy as np

from optics.numerics.precision import padded_for_packets


def test_memory_goes_on_after_the_last_number():
    values = np.arange(24.0).reshape(4, 6)[:, ::2]
    flat = padded_for_packets(values)
    assert flat.tolist() == values.ravel().tolist()
    start, end = np.lib.array_utils.byte_bounds(flat.base)
    assert start == flat.ctypes.data
    assert end - (start + flat.nbytes) >= 16 * flat.itemsize  # a packet of AVX-512
