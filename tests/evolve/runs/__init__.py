"""Tests of evolve/runs: which test covers which module.

begin: test_two_faces.py
resume: test_two_faces.py
carry_on: test_two_faces.py
start_from: test_start_from.py
progress: test_progress.py
output: test_output.py
"""
