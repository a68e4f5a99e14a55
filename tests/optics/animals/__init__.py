"""Tests that fail when a module of optics/animals is broken.

camera_eyes: test_animals.py
compound_eyes: test_animals.py
"""
