"""The point spread function of a pupil: which method computes it, whether it was right, and what it is worth.

psf            psf, plan
request        Request: what is asked
planner        the cheapest method within the tolerance
pictures       requests answered, and what becomes of a wrong picture
spot_check     a picture held against the direct sum at a few points
batch          psf_batch: many eyes at once
image_quality  mtf, strehl_ratio, encircled_energy, image_quality
"""
