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
poses          Poses: where everything is, in all worlds
moved_bodies   the same where only a few bodies move
variation      ranges of what differs between episodes
world_models   a model for each world, where these differ
model_settings fields of a model that physics uses, as bytes
appearances    materials that a geom may have
as_built       a model as it was when its renderer was made
primitive_geoms geoms that rays meet in closed form
solids         geoms as plain shapes, for other programs
band_error     errors of a few bands on measured colours
frozen_kernels conditions for recording kernels
"""
