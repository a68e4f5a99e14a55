"""Numbers and arrays that know nothing of light.

accuracy        Plan, AccuracyError: what a result promises
arguments       bad input ends in one line
autodiff        values that carry derivatives
backend         the LLVM library that Dr.Jit compiles with
bessel          J0 on Dr.Jit arrays
field           a sampled complex field
fourier         centred Fourier sums of any size and period
grid            sample positions
interpolation   Lagrange and Chebyshev
matrices        matrix products of Dr.Jit tensors
precision       float32 and float64 in Dr.Jit
quadrature      Gauss-Legendre, and how many nodes a wave needs
radial_profile  pictures that are symmetric about the axis
"""
