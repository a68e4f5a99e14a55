"""Tests that fail when a module of rhabdom is broken.

importing: test_importing.py, test_wheel.py
command: test_wheel.py
streams: test_streams.py
"""
