"""Eyes on any robot: models that are not one of our worlds.

task                Task: what a robot has to do
controls            which controls belong to which actuators
variation           what differs between episodes: light, sizes, colours, materials, starts
world_models        a model for each world, where these differ or a task changes it
model_settings      what physics goes by of a model, to notice and to undo changes
paint               colours that differ, for the kernel
appearances         materials that differ: how a geom may look, of which a world has one
encounter           Encounter: several tasks in one world; Frozen: an animal that does not learn
model_renderer      ModelRenderer: eyes mounted on any MuJoCo model, in many worlds at once
model_fidelity      how many rays eyes on a model need
eye_kinds           kinds of eyes of one animal
mounts              Mount: where an eye is, on a body, a site or a camera
eye_marks           eyes on pictures of a model
inside              eyes that are inside of a geom
poses               Poses: where everything is, in all worlds
model_wavefront     its kernels
optic_flow          where what eyes look at moves on their retinas
edge_rays           many rays where a receptor sees an edge, few elsewhere
model_scene         what stands still, as a Mitsuba scene, and what moves
as_built            what a renderer was built of, and what therefore must not change
renderable          what eyes may be, and how finely they may see
model_lights        lights, that may move
model_tracer        light along rays
primitives          rays that meet ellipsoids, capsules, cylinders and boxes
solids              geoms as plain shapes, for what others draw
movers              the same, for all that move in a world
"""
