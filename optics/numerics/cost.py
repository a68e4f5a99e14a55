"""What operations cost: the numbers by which every method predicts its time, and the planner chooses.

Of warm calls on two cores, rounded to what decides between methods. `python -m validation.benchmarks.fit_costs` times
the operations and prints what it finds beside these numbers.
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
FFT_FLOPS = 12e9  # the usual 5 n log2 n of a line of n samples
PAIRS_PER_SECOND = 2.5e8  # nodes times points of the direct sum

# Seconds of a call, whatever its size.
CALL = {
    "angular_spectrum": 2e-3,  # and with its paraxial part split off
    "far_field": 2e-3,  # for each node of the window
    "fresnel": 3e-4,  # and Fraunhofer's
    "geometric": 1e-3,
    "hankel": 1e-3,
    "low_rank": 1.5e-3,
    "pinhole": 1e-4,
    "rayleigh_sommerfeld": 1e-3,
}
DFT_CALL = 2e-4  # of each Fourier sum

# Seconds of each sample, entry, node or pair.
FFT_LINE_SAMPLE = 5e-9  # on its way into a transform's line
FOLDED_SAMPLE = 5e-9  # of a sum by matrices of halves
FFT_COPY = 8e-9  # between Dr.Jit and SciPy
PUPIL_SAMPLE = 1e-8  # optical path and phase, but for the soft edge
SOFT_EDGE_SAMPLE = 1e-8  # of a table along one edge
SPECTRUM_SAMPLE = 1e-8  # transfer function
KERNEL_ENTRY = 2e-8  # of the slow rest between pupil and window
FOURIER_ENTRY = 1e-8  # of Fourier's kernel between pupil and window, in NumPy
NODE_FOURIER_ENTRY = 4e-8  # of Fourier's kernel between nodes and frequencies, in Dr.Jit
WINDOW_SAMPLE = 1e-7  # interpolated from 8 x 8 directions
BESSEL_PAIR = 1e-8  # of a Hankel transform
PROFILE_ENTRY = 1e-9  # of the matrix that refines a symmetric picture's radius
PROFILE_SAMPLE = 1.5e-8  # of a symmetric picture, interpolated from 8 radii
NODE = 4e-9  # of the direct sum: its path
PIXEL_NODE = 6e-8  # path and phase at a node within a pixel
PIXEL_NODE_GEOMETRY = 1e-8  # its place and weight
RAY = 1e-7  # path, four slopes, nine cells
