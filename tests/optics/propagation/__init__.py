"""Tests that fail when a module of optics/propagation is broken.

planes: test_system.py
propagate: test_propagate.py, test_long_distances.py
transform_sampling: test_transform_sampling.py
system: test_system.py
transfer_function: test_propagate.py, test_long_distances.py
"""
