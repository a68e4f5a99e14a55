"""Which test fails when a module of optics/point_spread is broken.

batch: test_batch
image_quality: test_image_quality
pictures: test_pictures
planner: test_planner
psf: test_psf, test_derivatives, test_robustness
request: test_psf
spot_check: test_spot_check
"""
