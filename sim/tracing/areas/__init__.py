"""Light by areas: means over rectangles of the visual field in closed form, where rays would have to be many.

area_tracer    AreaTracer: what an area sees
branches       what is left out where no area needs it
illumination   the light that falls on a patch
patch          Area, and the Patch of a surface that is seen in it
lit_bodies     and on bodies that move
body_light     what of it arrives where they are seen
half_planes    shares that straight lines cut off
borders        between columns of areas
columns        walls, floor and sky behind an area
sphere_areas   spheres in front of them
light_table    light that walls and floor send on to each other
light_nodes    where that is known, and between
light_baking   how that is found
light_store    and kept on disk
cell_grid      the cells that it is kept for
stripes        textures, averaged
shadows        shares of a patch that a light reaches
"""
