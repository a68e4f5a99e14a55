"""Tests that fail when a module of optics/numerics is broken.

accuracy: point_spread/test_psf.py, test_accuracy.py
arguments: test_arguments.py, test_any_input.py
array_library: elements/test_array_libraries.py
array_sum_cost: propagation/test_predicted_times.py
autodiff: point_spread/test_derivatives.py
backend: test_backend.py
device: test_device.py
bessel: test_bessel.py
cost: test_fourier.py, point_spread/test_planner.py
even_fields: test_even_fields.py, methods/test_even_pupils.py
field: test_fourier.py, methods/test_textbook.py
fourier: test_fourier.py
fourier_matrices: test_fourier.py
grid: test_grid.py
interpolation: test_interpolation.py
kept_values: test_kept_values.py
matrices: test_fourier.py
number_types: test_number_types.py, sim/test_number_types.py
precision: test_precision.py
quadrature: test_quadrature.py
radial_profile: test_radial_profile.py
read_only: optics/test_read_only.py, sim/envs/test_handed_out.py
renamed: test_renamed.py
scattered_sum: test_scattered_sum.py
torch_graph: optics/test_torch.py, optics/test_torch_refusals.py
"""
