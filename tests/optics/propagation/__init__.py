"""Which test fails when a module of optics/propagation is broken.

planes: test_system
propagate: test_propagate
sampling: test_sampling
system: test_system
transfer_function: test_propagate
"""
