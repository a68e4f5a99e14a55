"""Which test fails when a module of optics/apertures is broken.

aperture: test_aperture.py
circular: test_aperture.py
outline: test_pixelated.py
pixelated: test_pixelated.py
polygonal: test_polygonal.py
soft_edge: test_soft_edge.py
soft_polygon: test_polygonal.py
triangulation: test_aperture.py, test_polygonal.py
"""
