"""Area sampling: mean light in rectangles of the visual field, in closed form instead of from many rays.

area_tracer         AreaTracer: the light in an area
branches            computations that are skipped for areas that do not need them
illumination        light that falls on a patch
patch               Area, and the Patch of a surface that is visible in an area
illuminated_bodies  table of the light on moving bodies
body_light          light on the visible part of a body
half_planes         fraction of an area on one side of a straight line
distances           path lengths from an eye to surfaces in an area
borders             borders between columns of areas
columns             walls, floor and sky behind an area
sphere_areas        spheres in an area
light_table         lookup of the light that walls and floor reflect to each other
light_nodes         nodes of the light tables, and interpolation between them
light_baking        computation of the light tables
light_store         cache of light tables on disk
cell_grid           grid of the free cells of a world
stripes             averages of textures
shadows             fraction of a patch that each light reaches
"""
