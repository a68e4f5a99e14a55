"""A MuJoCo model as a Mitsuba scene.

mirror         Mirror: build, sync, render
source         a file, a spec or text -> the model
bombs          models too large to build, or standing nowhere
shapes         geoms -> Mitsuba shapes, and their poses
merged_parts   shapes that share a material as one
tessellation   geoms -> triangles with MuJoCo's texture coordinates
cube           triangles under cube textures
surfaces       colours and textures
bsdfs          materials -> BSDFs
spectra        measured spectra in the place of colours
lights         lights -> emitters, with daylight's spectrum
sky            the skybox -> light from infinity
whereabouts    where everything was at one moment
cameras        cameras -> sensors
rays           what a sensor sees of a scene
inventory      what has no counterpart, in words
color          sRGB and linear light
device_arrays  numbers where kernels read them
variant        Mitsuba's variant, for the span of a call
"""
