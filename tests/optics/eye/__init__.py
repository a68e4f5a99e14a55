"""Which test fails when a module of optics/eye is broken.

band_choice: spectra/test_bands
eye: test_eye, test_eye_derivatives, test_eye_robustness
kernel_bank: test_kernel_bank
kernel_interpolation: test_kernel_bank
photoreceptor: test_photoreceptor
receptive_field: test_eye
retinal_image: test_retinal_image
summary: test_summary
"""
