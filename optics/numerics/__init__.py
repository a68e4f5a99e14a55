"""Numbers, arrays, and sums over arrays. Little in this package is specific to light.

accuracy        Plan and AccuracyError: predicted errors of results
arguments       checks of user input
array_library   arrays of NumPy, PyTorch and Dr.Jit
array_sum_cost  predicted times of Fourier sums of NumPy arrays
autodiff        Array and Scalar: values that may carry derivatives
backend         the LLVM library that Dr.Jit compiles with
device          processor or GPU
bessel          Bessel functions: J0 of Dr.Jit arrays, Jm of NumPy arrays
cost            seconds per operation, from which each method predicts its computing time
even_fields     fields that are even in x and y, stored on a quarter of the plane
field           a sampled complex field
fourier         centred Fourier sums of any size and period
fourier_matrices  Fourier sums as products of matrices
grid            sample positions
interpolation   linear, Lagrange, B-splines; tabulated functions
kept_values     values that are computed once and kept, within a limit on their number or memory
matrices        matrix products of Dr.Jit tensors
number_types    checks of users' arrays: half precision, masked elements, PyTorch's lazy conjugation and negation
precision       float32 and float64 in Dr.Jit
quadrature      Gauss-Legendre nodes, and the number of nodes that the integral of a wave needs
radial_profile  rotationally symmetric images, computed along one radius
read_only       read-only arrays of results
renamed         deprecated names that warn once
scattered_sum   Fourier sums over scattered points
torch_graph     functions of Dr.Jit arrays as operations of PyTorch
"""
