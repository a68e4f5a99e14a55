"""Shapes of a pupil's opening, made ready for sums: with a soft edge for samples on a grid, or as quadrature nodes.

aperture       Aperture: what every shape offers
circular       Circle, Annulus
rings          Rings: zone plates
polygonal      Polygon, Slit
shapes         Disk, Oblong, Spider: what openings are cut from
combined       union, difference, intersection; hexagonal segments
boundary       the edge of a combination
pixelated      any shape, tiled by square pixels
outline        where lines cross an edge
strips         quadrature over what an outline encloses
soft_edge      the kernel that softens an edge
soft_polygon   a polygon convolved with it
soft_outline   straight pieces and arcs convolved with it
triangulation  polygons as triangles
"""
