"""Tests of sim: each folder covers the folder of the same name and lists which test covers which module.

exr: test_exr.py, test_exr_previews.py, test_spectral_layout.py
exr_previews: test_exr_previews.py
spectral_layout: test_spectral_layout.py
"""
