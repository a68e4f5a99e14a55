"""Tests that fail when a module of optics/ommatidia is broken.

acceptance: test_acceptance.py
coupling: test_ommatidium.py
radiation: test_radiation.py, test_ommatidium.py
facet: test_facet.py
mosaic: test_mosaic.py
ommatidium: test_ommatidium.py
waveguide: test_waveguide.py, test_taper.py
"""
