"""Tests that fail when a module of optics/methods is broken. The oracles are closed forms that all methods satisfy.

angular_spectrum: test_angular_spectrum.py, test_textbook.py, test_oracles_waves.py, test_even_pupils.py
axis_kernel: test_sine_stack.py, test_diffraction_kernel.py
carrier: point_spread/test_field.py
derivative_cells: point_spread/test_gradients.py
diffraction_kernel: test_diffraction_kernel.py
far_field: test_textbook.py, test_far_field.py
far_field_nodes: test_far_field.py
fresnel: test_fresnel.py
geometric: test_geometric.py
hankel: test_textbook.py, test_oracles_circular.py
pupil_edge: test_sine_samples.py
slow_factor: test_low_rank.py
window_check: test_window_sampling.py
window_crossings: test_window_crossings.py
window_rank: test_window_sampling.py, test_torch_stacks.py
window_sampling: test_window_sampling.py
window_edges: test_window_edges.py
window_bands: test_window_edges.py
window_geometry: test_kept_plans.py, test_window_sampling.py
window_plan: test_window_sampling.py, point_spread/test_coarse_batch.py
window_images: test_sine_stack.py, point_spread/test_coarse_batch.py
window_stack: test_torch_stacks.py
stack_operation: test_torch_stacks.py
mirrored_matrix: test_mirrored_matrix.py
window_sums: test_window_sampling.py
low_rank: test_low_rank.py, test_textbook.py
pixel_nodes: test_pixel_nodes.py
pixelated_spectrum: elements/test_pixel_relief.py
problem: point_spread/test_planner.py
sampled_path: test_sampled_path.py
remaining_factor: test_sine_stack.py, test_diffraction_kernel.py
row_blocks: test_row_blocks.py
spectrum_sampling: test_row_blocks.py, test_even_pupils.py
pupil_sampling: test_textbook.py, elements/test_pixel_relief.py
rayleigh_sommerfeld: test_textbook.py, test_oracles_circular.py
rays: test_geometric.py
method_sampling: point_spread/test_planner.py
scalar_theory: test_scalar_theory.py
sine_samples: test_sine_samples.py
sine_stack: test_sine_stack.py
single_stack: test_kept_plans.py
smooth_pupil: test_smooth_spectrum.py
smooth_spectrum: test_smooth_spectrum.py, eye/test_steep_reliefs.py
smythe: point_spread/test_vector_focus.py
spectral_taper: test_angular_spectrum.py, test_textbook.py
textbook: test_textbook.py
vector_sum: point_spread/test_vector_focus.py
"""
