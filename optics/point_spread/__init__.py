"""The point spread function of a pupil, and what it is worth.

psf            psf, plan
planner        the cheapest method within the tolerance
spot_check     a picture held against the direct sum
batch          psf_batch: many eyes at once
image_quality  mtf, strehl_ratio, encircled_energy, image_quality
"""
