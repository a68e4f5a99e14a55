"""Who tests what of sim/robots.

model_renderer: test_model_renderer.py
renderable: test_model_renderer.py, test_edge_rays.py
model_wavefront: test_model_renderer.py
model_fidelity: test_model_fidelity.py, test_model_light.py
edge_rays: test_edge_rays.py
eye_kinds: envs/test_eye_kinds.py
mounts: test_mounts.py
task: envs/test_task_vec_env.py, envs/test_encounter.py
encounter: envs/test_encounter.py, envs/test_bad_encounters.py
controls: test_controls.py
variation: test_variation.py
world_models: envs/test_differing_worlds.py, envs/test_own_models.py
model_settings: envs/test_own_models.py
paint: envs/test_differing_worlds.py, test_glow_colors.py
as_built: test_as_built.py
appearances: envs/test_differing_materials.py
optic_flow: test_labels.py
eye_marks: test_eye_marks.py
inside: test_mounts.py
poses: test_model_renderer.py
model_scene: test_model_renderer.py
model_lights: test_model_renderer.py, test_model_lamps.py
model_tracer: test_model_renderer.py, test_model_light.py
primitives: test_movers.py
solids: evolve/report/test_rerun_bodies.py
movers: test_movers.py
"""
