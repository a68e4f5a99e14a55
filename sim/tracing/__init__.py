"""Where rays end, and the light that they find there.

tracer               which of the two tracers a world gets
closed_form_tracer   walls, floor and spheres in closed form
mitsuba_tracer       any shapes
static_scene         what does not move, and the movers' shapes
spheres              what moves
walls                a world as upright walls
wall_intersection    where rays meet them
reflectance_atlas    all reflectances in one table
areas                means over rectangles of the visual field, without rays
lighting             direct light and one bounce
model_scene          what stands still of any model, and what moves
model_tracer         light along rays through it
model_lights         its lights
movers               what moves, met by rays
primitives           rays that meet primitives
paint                colours that differ between worlds
"""
