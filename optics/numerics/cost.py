"""Time per operation. Methods predict their time from these values, and the planner chooses by predicted time.

The values are for calls with compiled kernels on two cores. They are precise enough to choose between methods. `python
-m validation.benchmarks.fit_costs` times the operations and prints the results next to these values.
"""

from __future__ import annotations

__all__ = [
    "BESSEL_PAIR",
    "CALL",
    "DFT_CALL",
    "FFT_COPY",
    "FFT_FLOPS",
    "FFT_LINE_SAMPLE",
    "FOLDED_SAMPLE",
    "FOURIER_ENTRY",
    "KERNEL_ENTRY",
    "MATMUL_FLOPS",
    "NODE",
    "NODE_FOURIER_ENTRY",
    "PAIRS_PER_SECOND",
    "PIXEL_NODE",
    "PIXEL_NODE_GEOMETRY",
    "PROFILE_ENTRY",
    "PROFILE_SAMPLE",
    "PUPIL_SAMPLE",
    "RAY",
    "SOFT_EDGE_SAMPLE",
    "SPECTRUM_SAMPLE",
    "WINDOW_SAMPLE",
]

# Arithmetic [1/s].
MATMUL_FLOPS = {"float32": 45e9, "float64": 22e9}  # additions and multiplications in matrix products
FFT_FLOPS = 12e9  # counted as 5 n log2 n for a line of n samples
PAIRS_PER_SECOND = 2.5e8  # pairs of node and point in the direct sum

# Seconds per call, independent of its size.
CALL = {
    "angular_spectrum": 2e-3,  # also "split_angular_spectrum"
    "far_field": 2e-3,  # per node of the window
    "fresnel": 3e-4,  # also "fraunhofer"
    "geometric": 1e-3,
    "hankel": 1e-3,
    "low_rank": 1.5e-3,
    "pinhole": 1e-4,
    "rayleigh_sommerfeld": 1e-3,
}
DFT_CALL = 2e-4  # per Fourier sum

# Seconds per sample, entry, node or pair.
FFT_LINE_SAMPLE = 5e-9  # copying a sample into the line of a transform
FOLDED_SAMPLE = 5e-9  # sample of a sum that is computed from even and odd parts
FFT_COPY = 8e-9  # copying a sample between Dr.Jit and SciPy
PUPIL_SAMPLE = 1e-8  # optical path and phase, without the soft edge
SOFT_EDGE_SAMPLE = 1e-8  # soft edge from a table along one edge
SPECTRUM_SAMPLE = 1e-8  # transfer function
KERNEL_ENTRY = 2e-8  # entry of the slow factor between pupil and window
FOURIER_ENTRY = 1e-8  # entry of the Fourier kernel between pupil and window, in NumPy
NODE_FOURIER_ENTRY = 4e-8  # entry of the Fourier kernel between nodes and frequencies, in Dr.Jit
WINDOW_SAMPLE = 1e-7  # sample of the window, interpolated from 8 x 8 directions
BESSEL_PAIR = 1e-8  # pair of nodes in a Hankel transform
PROFILE_ENTRY = 1e-9  # entry of the matrix that refines the radius of a symmetric image
PROFILE_SAMPLE = 1.5e-8  # sample of a symmetric image, interpolated from 8 radii
NODE = 4e-9  # path at a node of the direct sum
PIXEL_NODE = 6e-8  # path and phase at a node within a pixel
PIXEL_NODE_GEOMETRY = 1e-8  # position and weight of a node within a pixel
RAY = 1e-7  # path, four slopes, nine cells
