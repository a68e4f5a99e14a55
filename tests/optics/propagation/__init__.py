"""Tests that fail when a module of optics/propagation is broken.

misalignment: test_misalignment.py, test_tolerancing_example.py
planes: test_system.py
propagate: test_propagate.py, test_long_distances.py
separable_kernel: test_separable_kernel.py
spectrum_filter: test_propagate.py, test_separable_kernel.py
transform_sampling: test_transform_sampling.py
system: test_system.py
transfer_function: test_propagate.py, test_long_distances.py
"""
