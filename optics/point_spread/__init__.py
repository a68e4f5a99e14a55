"""The point spread function of a pupil: which method computes it, whether it was right, and what it is worth.

psf            psf, plan
psf_result     PSFResult: a picture, and how to look again
request        Request: what is asked
planner        the cheapest method within the tolerance
pictures       requests answered, and what becomes of a wrong picture
spot_check     a picture held against the direct sum at a few points
vector_focus   vector_focus: beyond scalar theory
converging     VectorFocus: polarised light on its way, and its field
disk_sum       what falls on a round receptor
microvilli     Microvilli: receptors that know polarisation
population     one plan for many pupils
population_members  what it takes of each
batch          psf_batch: many eyes at once
modulation_transfer  MTF: contrast at any frequency
contrast       mtf, image_quality
mixture        sums over wavelengths
white          white_psf: a lamp's light as receptors weigh it
concentration  strehl_ratio, encircled_energy
"""
