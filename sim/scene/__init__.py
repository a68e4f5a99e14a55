"""A MuJoCo model as a Mitsuba scene.

mirror           Mirror: build, sync, render
source           loading of a model from a file, a spec or text
bombs            checks for models that are too large, or not finite
shapes           geoms as Mitsuba shapes, and their poses
merged_parts     shapes that share a material, merged into one
tessellation     geoms as triangles with MuJoCo's texture coordinates
cube             triangles under cube textures
surfaces         colours and textures
coincident       geoms in the same place
model_hash       hash of a model, under which values computed from it are stored
linear_textures  textures whose values are linear light
bsdfs            materials as BSDFs
spectra          measured spectra that replace colours
lights           lights as emitters with daylight's spectrum
shadowless       lights that cast no shadow
sky              the skybox as light from infinity
pose_snapshot    a copy of all poses at one moment
cameras          cameras as sensors
rays             radiance and first hits along a sensor's rays
inventory        messages about features without a counterpart in the scene
color            sRGB and linear light
device_arrays    aligned arrays for kernels
variant          Mitsuba's variant during a call
poses            Poses: poses, sizes, colours and materials in all worlds
moved_bodies     poses of models in which only a few bodies move
variation        ranges of quantities that differ between episodes
world_models     a model for each world, if worlds differ
model_settings   the fields of a model that physics uses, as bytes
appearances      materials that a geom may have
model_snapshot   a renderer's model at the time when the renderer was made
primitive_geoms  geoms that rays intersect in closed form
solids           geoms as plain shapes, for other programs
band_error       errors of measured colours in a few bands
frozen_kernels   kernels that are recorded once and replayed
"""
