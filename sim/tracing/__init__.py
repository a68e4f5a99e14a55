"""Ray tracing: hit points of rays, and the light that comes from them.

tracer               protocol of tracers, and the choice of one for a scene
eye_places           positions of a model's eyes, and whether they stay level
eye_ray              a ray that leaves an eye
closed_form_tracer   ClosedForm: rays through upright walls, a floor and spheres in closed form
upright_scene        conversion of a model to upright walls, a floor and spheres, if it has this form
spheres              intersections of rays with moving spheres
walls                upright walls and the floor of a model
wall_intersection    intersections of rays with upright walls
reflectance_atlas    reflectances of all materials in one table
areas                mean light in rectangles of the visual field, without rays
lighting             directional light, after one or two reflections
light_components     components into which the closed-form tracer divides light
medium_on_rays       absorption and veiling light of water and air along rays
model_tracer         ModelTracer: rays through models with any shapes
model_scene          static and moving geoms of any model
model_lights         lights of any model
movers               intersections of rays with moving geoms
mesh_atlas           moving meshes in one scene
primitives           intersections of rays with MuJoCo's primitives
paint                colours that differ between worlds
world_rows           rows of floats that differ between worlds
"""
