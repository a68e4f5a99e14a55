"""What tests hold of ray tracing, module by module.

tracer: test_closed_form_tracer.py
closed_form_tracer: test_closed_form_tracer.py, worlds/test_foraging.py
mitsuba_tracer: test_closed_form_tracer.py, render/test_batched_renderer.py
static_scene: test_closed_form_tracer.py, render/test_batched_renderer.py
spheres: render/test_batched_renderer.py
walls: test_closed_form_tracer.py
wall_intersection: test_closed_form_tracer.py
reflectance_atlas: test_closed_form_tracer.py
lighting: test_lighting.py, render/test_batched_renderer.py, render/test_reference_renderer.py
"""
