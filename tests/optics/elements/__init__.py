"""Which test fails when a module of optics/elements is broken.

beam: methods/test_textbook
pixel_relief: test_pixel_relief
pupil: test_pupil
refractive_index: test_refractive_index
relief: test_relief
source: test_source
wavefront_slopes: test_pupil
"""
