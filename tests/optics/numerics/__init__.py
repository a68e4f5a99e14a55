"""Which test fails when a module of optics/numerics is broken.

accuracy: point_spread/test_psf
arguments: test_any_input
autodiff: point_spread/test_derivatives
backend: test_backend
bessel: test_bessel
cost: test_fourier, point_spread/test_planner
field: test_fourier, methods/test_textbook
fourier: test_fourier
grid: test_grid
interpolation: test_interpolation
matrices: test_fourier
precision: test_precision
quadrature: test_quadrature
radial_profile: test_radial_profile
"""
