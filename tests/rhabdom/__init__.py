"""Which test covers which module of rhabdom.

importing: test_importing.py, test_wheel.py
command: test_wheel.py
"""
