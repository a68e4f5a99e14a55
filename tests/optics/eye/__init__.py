"""Tests that fail when a module of optics/eye is broken.

acuity: test_acuity.py
band_choice: test_choice_parts.py, spectra/test_bands.py, test_sight_tolerance.py
cell_integrals: test_cell_integrals.py
eye: test_eye_calls.py, test_eye.py, test_kept_kernels.py, test_axes.py, test_eye_derivatives.py
eye_spec: test_spec_parts.py, test_eye.py, test_patches.py, test_receptor_density.py, test_vertical_field.py
geometry: test_spec_parts.py, test_patches.py, test_vertical_field.py
immersion: test_spec_parts.py, elements/test_turbid_medium.py
depth_range: test_depth_range.py, test_occlusion.py, test_kernel_bank.py
kernel_bank: test_choice_parts.py, test_eye_parts.py, test_kernel_bank.py, test_layer_counts.py, test_sight_tolerance.py
kernel_interpolation: test_choice_parts.py, test_eye_parts.py, test_kernel_interpolation.py
layered_image: test_image_parts.py, test_occlusion.py
occlusion: test_image_parts.py, test_eye_parts.py, test_occlusion.py
photoreceptor: test_image_parts.py, test_photoreceptor.py
polarization: test_eye_parts.py, test_polarization.py
signals: test_image_parts.py, test_eye.py, test_polarization.py, test_eye_robustness.py
visual_kernel: test_window_parts.py, test_eye_parts.py, test_visual_kernel.py, test_scattered_light.py, test_axes.py
guided_field: test_guide_parts.py, test_guided_field.py, test_axes.py
receptor_kernel: test_eye_calls.py, test_guided_field.py, test_eye.py
retina: test_choice_parts.py, test_window_parts.py, test_kept_kernels.py, test_visual_kernel.py, test_steep_reliefs.py
retinal_image: test_image_parts.py, test_retinal_image.py, test_receptor_density.py
sensor_pixels: test_choice_parts.py, test_torch.py
camera: test_camera_parts.py, test_camera.py
receptor_density: test_choice_parts.py, test_receptor_density.py
receptor_lattice: test_receptor_lattice.py, test_receptor_density.py
patch: test_choice_parts.py, test_receptor_density.py
summary: test_eye_parts.py, test_summary_parts.py, test_summary.py
"""
