"""Tests of ray tracing: which test covers which module.

tracer: test_closed_form_tracer.py
medium_on_rays: test_medium_on_rays.py
light_components: test_closed_form_tracer.py
closed_form_tracer: test_closed_form_tracer.py, worlds/test_foraging.py
eye_places: test_upright_scene.py, render/test_model_renderer.py
eye_ray: render/test_batched_renderer.py
upright_scene: test_upright_scene.py, test_closed_form_tracer.py
spheres: render/test_batched_renderer.py
walls: test_closed_form_tracer.py, test_equal_worlds.py
wall_intersection: test_closed_form_tracer.py
reflectance_atlas: test_closed_form_tracer.py
areas.area_tracer: test_areas.py, test_areas_behind_pupils.py
areas.light_table: test_light_table.py
areas.light_nodes: test_light_table.py
areas.light_baking: test_light_table.py, test_light_store.py
areas.light_store: test_light_store.py, test_light_table.py
areas.cell_grid: test_light_table.py
areas.branches: test_areas.py
areas.distances: test_medium_on_rays.py
areas.columns: test_areas.py
areas.half_planes: test_area_integrals.py, test_areas.py
areas.illumination: test_illumination.py, test_areas.py
areas.illuminated_bodies: test_illuminated_bodies.py, test_light_table.py
areas.body_light: test_body_light.py, test_areas.py
areas.borders: render/test_area_kernel.py
areas.patch: test_areas.py
areas.shadows: test_areas.py
areas.sphere_areas: test_area_integrals.py, test_areas.py
areas.stripes: test_area_integrals.py, test_areas.py
lighting: test_lighting.py, render/test_batched_renderer.py, render/test_reference_renderer.py
paint: envs/test_differing_worlds.py, render/test_glow_colors.py
model_scene: render/test_model_renderer.py, test_equal_worlds.py
model_lights: render/test_model_renderer.py, render/test_model_lamps.py
model_tracer: render/test_model_renderer.py, render/test_model_light.py
primitives: test_movers.py
movers: test_movers.py
mesh_atlas: test_movers.py
world_rows: test_movers.py
"""
