"""Tests of spectral OpenEXR files: which test covers which module.

view: test_files.py, test_previews.py
files: test_files.py, test_writing.py, test_previews.py, test_spectral_layout.py
previews: test_previews.py
spectral_layout: test_spectral_layout.py
"""
