"""Tests of sim: each folder covers the folder of the same name and lists which test covers which module.

exr: test_exr.py, test_exr_previews.py
"""
