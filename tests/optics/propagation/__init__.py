"""Tests that fail when a module of optics/propagation is broken.

field_derivatives: test_system_gradients.py
misalignment: test_misalignment.py, test_tolerancing_example.py
plane_step: test_system_batch.py, test_misalignment.py
planes: test_system.py
propagate: test_propagate.py, test_long_distances.py
separable_kernel: test_separable_kernel.py
spectrum_filter: test_propagate.py, test_separable_kernel.py
transform_sampling: test_transform_sampling.py
soft_pixels: test_soft_pixels.py, test_system_gradients.py
stack_result: test_system.py, test_system_gradients.py
system: test_system.py, test_system_batch.py
system_elements: test_system.py
transfer_function: test_propagate.py, test_long_distances.py
"""
