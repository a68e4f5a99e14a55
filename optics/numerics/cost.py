"""Time and memory per operation, from which methods predict their costs. The planner chooses by predicted time.

The times are for calls with compiled kernels on two cores. They are precise enough to choose between methods. `python
-m validation.benchmarks.fit_costs` times the operations and prints the results next to these values.
"""

from __future__ import annotations

__all__ = [
    "ARRAY_FFT_FLOPS",
    "ARRAY_LINE_SAMPLE",
    "ARRAY_MATMUL_FLOPS",
    "ARRAY_MATRIX_ENTRY",
    "BESSEL_PAIR",
    "CALL",
    "CHECK_BYTES",
    "CHECK_SAMPLE",
    "CHECK_SYMMETRIC_SAMPLE",
    "DFT_CALL",
    "DIRECTION_BYTES",
    "FFT_COPY",
    "FFT_FLOPS",
    "FFT_LINE_SAMPLE",
    "FOLDED_SAMPLE",
    "FOURIER_ENTRY",
    "ITEM_BYTES",
    "KERNEL_ENTRY",
    "MATMUL_FLOPS",
    "NODE",
    "NODE_BYTES",
    "NODE_FOURIER_ENTRY",
    "OUTPUT_ARRAYS",
    "OUTPUT_SAMPLE",
    "PAIRS_PER_SECOND",
    "PASSAGE_CALL",
    "PIXEL_NODE",
    "PIXEL_NODE_GEOMETRY",
    "PROFILE_ENTRY",
    "PROFILE_SAMPLE",
    "PSF_CALL",
    "PUPIL_SAMPLE",
    "RAY",
    "RAY_BYTES",
    "SEPARABLE_ENTRY",
    "SERIES_TERM",
    "SMOOTH_SAMPLE",
    "SOFT_EDGE_SAMPLE",
    "SOFT_SIDE_SAMPLE",
    "SPECTRUM_SAMPLE",
    "SYMMETRIC_BYTES",
    "TRANSFER_SAMPLE",
    "WINDOW_SAMPLE",
]

# Arithmetic [1/s].
MATMUL_FLOPS = {"float32": 45e9, "float64": 22e9}  # additions and multiplications in matrix products
FFT_FLOPS = 12e9  # counted as 5 n log2 n for a line of n samples
PAIRS_PER_SECOND = {"float32": 2.5e8, "float64": 1.8e8}  # pairs of node and point in the direct sum

# The same for complex NumPy arrays, in `optics.propagate` [1/s].
ARRAY_MATMUL_FLOPS = {"float32": 95e9, "float64": 47e9}
ARRAY_FFT_FLOPS = {"float32": 20e9, "float64": 10e9}

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
PSF_CALL = 6e-3  # per PSF with a new plan: comparing methods, planning samples, and preparing the check
PASSAGE_CALL = {"angular_spectrum": 4e-3, "separable_kernel": 1e-3}  # per call of `optics.propagate` at a new distance

# Seconds per sample, entry, node or pair.
FFT_LINE_SAMPLE = 5e-9  # copying a sample into the line of a transform
FOLDED_SAMPLE = 5e-9  # sample of a sum that is computed from even and odd parts
ARRAY_LINE_SAMPLE = {"float32": 4e-9, "float64": 8e-9}  # padding and copying a sample of a NumPy array
ARRAY_MATRIX_ENTRY = 4e-8  # entry of a Fourier matrix, in NumPy
SEPARABLE_ENTRY = 5e-8  # entry of a separable kernel, in NumPy
SERIES_TERM = 4e-9  # term of a series at one point, in NumPy
TRANSFER_SAMPLE = 3e-8  # transfer function in NumPy, including the product with the spectrum
FFT_COPY = 8e-9  # copying a sample between Dr.Jit and SciPy
PUPIL_SAMPLE = 1e-8  # optical path and phase, without the soft edge
SOFT_EDGE_SAMPLE = 1e-8  # soft edge from a table along one edge
SOFT_SIDE_SAMPLE = 2.5e-8  # soft edge of one straight side; an arc takes three times as long
SMOOTH_SAMPLE = 2e-7  # light of a steep pupil, convolved with a Gaussian
SPECTRUM_SAMPLE = 1e-8  # transfer function
KERNEL_ENTRY = 2e-8  # entry of the slow factor between pupil and window
FOURIER_ENTRY = 1e-8  # entry of the Fourier kernel between pupil and window, in NumPy
NODE_FOURIER_ENTRY = 4e-8  # entry of the Fourier kernel between nodes and frequencies, in Dr.Jit
WINDOW_SAMPLE = 1e-7  # sample of the window, interpolated from 8 x 8 directions
BESSEL_PAIR = 1e-8  # pair of nodes in a Hankel transform
PROFILE_ENTRY = 1e-9  # entry of the matrix that refines the radius of a symmetric image
PROFILE_SAMPLE = 1.5e-8  # sample of a symmetric image, interpolated from 8 radii
OUTPUT_SAMPLE = {"float32": 1.5e-8, "float64": 3e-8}  # sample of the finished window, computed and copied to NumPy
CHECK_SAMPLE = 5.5e-8  # sample of the window, in the selection of points for the spot check
CHECK_SYMMETRIC_SAMPLE = 1e-7  # the same if the points are selected by their radius
NODE = 4e-9  # path at a node of the direct sum
PIXEL_NODE = 6e-8  # path and phase at a node within a pixel
PIXEL_NODE_GEOMETRY = 1e-8  # position and weight of a node within a pixel
RAY = 1e-7  # path, four slopes, nine cells

# Bytes.
ITEM_BYTES = {"float32": 4.0, "float64": 8.0}  # real number
OUTPUT_ARRAYS = 4.0  # arrays of real numbers that are as large as the window
CHECK_BYTES = 80.0  # per sample of the window: float64 arrays of the spot check
NODE_BYTES = 72.0  # node of the direct sum: position, weight, path, and copies while the rule is computed
RAY_BYTES = 112.0  # node of the ray method
SYMMETRIC_BYTES = 48.0  # per sample of the window: sorting of distinct radii
DIRECTION_BYTES = 24.0  # direction of the far field, without the weights of nodes
