"""Which test fails when a module of optics/apertures is broken.

aperture: test_aperture
circular: test_aperture
outline: test_pixelated
pixelated: test_pixelated
polygonal: test_polygonal
soft_edge: test_soft_edge
soft_polygon: test_polygonal
triangulation: test_aperture, test_polygonal
"""
