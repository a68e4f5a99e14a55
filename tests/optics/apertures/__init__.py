"""Tests that fail when a module of optics/apertures is broken.

aperture: test_aperture.py
bitmap: test_bitmap.py
boundary: test_combined.py, test_nearly_touching.py
circular: test_aperture.py
combined: test_combined.py
curved_disk: test_curved_disk.py
outline: test_pixelated.py
pixelated: test_pixelated.py
polygonal: test_polygonal.py
rings: test_combined.py
shapes: test_combined.py
soft_edge: test_soft_edge.py
soft_outline: test_combined.py
soft_polygon: test_polygonal.py
strips: test_pixelated.py
triangulation: test_aperture.py, test_polygonal.py
"""
