"""Shapes of the pupil's opening. An aperture has a soft edge for samples on a grid, and nodes for integrals.

aperture       Aperture: interface of all shapes
circular       Circle, Annulus
rings          Rings: zone plates
polygonal      Polygon, Slit
shapes         Disk, Oblong, Spider: parts of combined openings
bitmap         Bitmap: openings drawn as images
combined       union, difference, intersection; hexagonal segments
boundary       computes the edge of a combined opening
pixelated      quadrature over an opening that is divided into pixels
outline        edge of an opening, and its crossings with lines
strips         quadrature over the area inside an outline
soft_edge      kernel that softens an edge
curved_disk    converging and diverging waves behind disks and rings with a soft edge
soft_polygon   polygons with a soft edge
soft_outline   openings with a soft edge, bounded by straight segments and arcs
triangulation  polygons as triangles
"""
