"""Which test fails when a module of optics/point_spread is broken.

batch: test_batch.py
image_quality: test_image_quality.py
pictures: test_pictures.py
planner: test_planner.py
psf: test_psf.py, test_derivatives.py, test_robustness.py
request: test_psf.py
spot_check: test_spot_check.py
"""
