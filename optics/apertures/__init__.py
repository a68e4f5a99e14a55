"""Shapes of a pupil's opening, made ready for sums: with a soft edge for samples on a grid, or as quadrature nodes.

aperture       Aperture: what every shape offers
circular       Circle, Annulus
polygonal      Polygon, Slit
pixelated      any shape, tiled by square pixels
outline        where lines cross an edge
soft_edge      the kernel that softens an edge
soft_polygon   a polygon convolved with it
triangulation  polygons as triangles
"""
