"""A MuJoCo model as a Mitsuba scene.

mirror         Mirror: build, sync, render
shapes         geoms -> Mitsuba shapes, and their poses
tessellation   geoms -> triangles with MuJoCo's texture coordinates
surfaces       materials and textures -> BSDFs
spectra        measured spectra in the place of colours
lights         lights -> emitters, with daylight's spectrum
cameras        cameras -> sensors
"""
