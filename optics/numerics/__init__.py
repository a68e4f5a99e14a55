"""Numbers and arrays, and sums over them: nothing here is about light.

accuracy        Plan, AccuracyError: what a result promises
arguments       checks of what users give
autodiff        Array, Scalar: values that may carry derivatives
backend         the LLVM library that Dr.Jit compiles with
device          processor or GPU
bessel          J0 on Dr.Jit arrays
cost            what operations cost: how methods predict their time
even_fields     fields that are the same on all four sides, on a quarter of the plane
field           a sampled complex field
fourier         centred Fourier sums of any size and period
fourier_matrices  the same as products of matrices
grid            sample positions
interpolation   linear, Lagrange, B-splines; functions kept as tables
matrices        matrix products of Dr.Jit tensors
precision       float32 and float64 in Dr.Jit
quadrature      Gauss-Legendre, and how many nodes a wave needs
radial_profile  pictures that are symmetric about the axis, by one radius
scattered_sum   Fourier sums over points anywhere
"""
