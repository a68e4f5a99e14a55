"""Tests that fail when a module of optics/elements is broken.

ball_lens: test_ball_lens.py
beam: methods/test_textbook.py
converging_wave: test_exit_pupil.py, test_exit_pupil_off_axis.py
derivative_knots: point_spread/test_gradients.py
exit_pupil: test_exit_pupil.py, test_exit_pupil_off_axis.py
exit_pupils: test_exit_pupils.py
fine_detail: test_fine_detail.py, eye/test_scattered_light.py
human_eye: test_human_eye.py
light_geometry: methods/test_kept_plans.py
light_stack: test_light_stack.py
pupil_polynomials: test_light_stack.py
phase_pupil: test_phase_pupil.py
pixel_relief: test_pixel_relief.py
pupil_slopes: test_pupil.py
pupil_path: test_pupil.py, test_torch_stacks.py
zernike_modes: test_wavefront.py
pupil: test_pupil.py
pupil_rim: test_exit_pupil.py, test_exit_pupil_off_axis.py
ray_field: point_spread/test_vector_focus.py
refractive_index: test_refractive_index.py, test_media.py
relief: test_relief.py
source: test_source.py
spherical_index: test_ball_lens.py
spline_map: test_relief.py, methods/test_sampled_path.py
square_samples: test_relief.py, methods/test_even_pupils.py
torch_numbers: test_derivatives_refused.py, test_torch.py
turbid_medium: test_turbid_medium.py
transmittance: test_transmittance.py
wavefront: test_wavefront.py
wavefront_slopes: test_pupil.py
zernike_order: test_zernike_order.py
"""
