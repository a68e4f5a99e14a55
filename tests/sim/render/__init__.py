"""Tests of rendering: which test covers which module.

one_ray: test_scene_parts.py, test_one_ray.py
batched_renderer: test_signals.py, test_ray_parts.py, test_batched_renderer.py, test_reference_renderer.py
eye_renderer: test_signals.py, test_renderer_parts.py, test_eye_renderer.py, test_model_renderer.py
ray_kernel: test_ray_parts.py, test_batched_renderer.py, test_one_ray.py
eye_rays: test_ray_parts.py, test_batched_renderer.py, test_model_renderer.py
area_kernel: test_area_kernel.py
light_factors: test_renderer_parts.py, test_eye_renderer.py, envs/test_light_levels.py
labels: test_signals.py, test_renderer_parts.py, test_labels.py
world_scene: test_batched_renderer.py, test_vertical_field.py
reference_renderer: test_scene_parts.py, test_ray_parts.py, test_renderer_parts.py, test_reference_renderer.py
fidelity: test_fidelity_levels.py, test_fidelity.py, eyes/test_depth_layers.py
fidelity_choice: test_sample_rules.py, test_fidelity_choice.py, test_fidelity.py, test_model_fidelity.py
world_fidelity: test_world_fidelity.py, test_fidelity.py, eyes/test_depth_layers.py
fidelity_stages: test_model_rules.py, test_fidelity_levels.py, test_fidelity_choice.py, test_fidelity.py
sample_choice: test_sample_rules.py, test_fidelity_levels.py, test_sample_choice.py, test_fidelity.py
random_views: test_trial_errors.py, test_model_rules.py, test_fidelity_trials.py, test_fidelity.py
populations: test_trial_errors.py, test_model_rules.py, test_sample_choice.py, test_fidelity.py
fidelity_trials: test_signals.py, test_trial_errors.py, test_trial_parts.py, test_model_rules.py, test_fidelity.py
prepared_scene: test_signals.py, test_scene_parts.py, test_trial_parts.py, test_renderer_parts.py
memory_budget: test_fidelity_levels.py, test_memory_budget.py, test_sample_choice.py
receptors_in_time: test_renderer_parts.py, test_receptors_in_time.py
receptor_noise: test_signals.py, test_renderer_parts.py, test_receptor_noise.py
pending_frame: test_renderer_parts.py, test_pending_frame.py, envs/test_eyes_of_kind.py
model_renderer: test_renderable.py, test_model_renderer.py, test_pupil_axes.py
renderable: test_renderable.py, test_fidelity_levels.py, test_model_renderer.py, test_edge_rays.py
model_fidelity: test_model_rules.py, test_model_fidelity.py, test_needed_light.py, test_model_light.py
edge_rays: test_model_rules.py, test_edge_rays.py
optic_flow: test_signals.py, test_ray_parts.py, test_labels.py
"""
