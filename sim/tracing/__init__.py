"""Where rays end, and the light that they find there.

tracer               the protocol of tracers, and which of them a scene gets
eye_places           where the eyes of a model are, and whether they stay level
eye_ray              a ray that leaves an eye
closed_form_tracer   ClosedForm: walls, floor and spheres in closed form
upright_scene        a model as that, or why it is something else
spheres              what moves there
walls                what stands there, as upright walls
wall_intersection    where rays meet them
reflectance_atlas    all reflectances in one table
areas                means over rectangles of the visual field, without rays
lighting             light that bounces
model_tracer         ModelTracer: any shapes
model_scene          what stands still of any model, and what moves
model_lights         its lights
movers               what moves, met by rays
primitives           rays that meet primitives
paint                colours that differ between worlds
world_rows           rows of floats that differ from world to world
"""
